"""Stored values: one encoding, nothing unknown, nothing of the wrong type."""

from typing import Any, get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import FailureClass, RecoveryPolicy
from harness.contracts.effects import AnyEffect, Condition
from harness.contracts.errors import ContractInvalid, HarnessError, StoreNewer, StoreUnavailable
from harness.contracts.ids import MissionId, NodeId, invocation_id, packet_id, request_id, sha256
from harness.contracts.tasks import Goal, TaskContract
from harness.contracts.values import Value, decode, digest, encode, raw
from tests.unit.planning.building import card, contract

TWELVE = {
    "provider_id", "version", "embodiments", "parameters", "preconditions", "side_effects", "latency", "resources",
    "cancel", "risk", "failure_words", "evidence",
}  # fmt: skip


@pytest.mark.ledger("R57", symbol="harness.contracts.capabilities:CapabilityCard")
@pytest.mark.parametrize("field", sorted(TWELVE))
def test_a_card_without_one_of_its_twelve_fields_is_no_card(field: str) -> None:
    whole = msgspec.to_builtins(card())
    assert msgspec.convert(whole, CapabilityCard) == card()
    del whole[field]
    with pytest.raises(msgspec.ValidationError, match=f"missing required field `{field}`"):
        msgspec.convert(whole, CapabilityCard)


def test_a_card_promises_nothing_about_supervision_that_it_does_not_state() -> None:
    whole = card()
    assert not whole.resumable
    assert (whole.reattach, whole.sources, whole.software) == ("by_request", (), "")


@pytest.mark.ledger("R16", symbol="harness.contracts.values:decode")
def test_an_unknown_key_is_refused_with_its_path() -> None:
    body = msgspec.json.decode(encode(contract()))
    body["nodes"][1]["success_conditions"][0]["effect"]["colour"] = "blue"
    with pytest.raises(msgspec.ValidationError, match=r"unknown field `colour`.*\$\.nodes\[1\]"):
        decode(msgspec.json.encode(body), TaskContract)


@pytest.mark.parametrize(
    ("effect", "says"),
    [
        ({"type": "wishful", "predicate": "p"}, "Invalid value 'wishful'"),
        ({"predicate": "p"}, "missing required field `type`"),
        (
            {"type": "metric", "predicate": "arrival", "frame": "map", "map_version": "1", "tolerance_m": 0.4},
            "target_m",
        ),
        (
            {
                "type": "metric",
                "predicate": "a",
                "frame": "m",
                "map_version": "1",
                "target_m": [0, 0],
                "tolerance_m": 0,
            },
            "> 0",
        ),
        ({"type": "visual", "predicate": "p", "frames": 0, "width_px": 1, "height_px": 1}, ">= 1"),
        ({"type": "temporal", "predicate": "p", "interval_s": -1.0, "bound": 0.1}, "> 0"),
        ({"type": "symbolic", "predicate": "", "arguments": {}}, "length >= 1"),
        ({"type": "symbolic", "predicate": "p", "arguments": {"n": 4}}, "Expected `str`, got `int`"),
    ],
)
def test_an_effect_that_is_not_typed_is_refused(effect: dict[str, Any], says: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=says):
        decode(msgspec.json.encode({"condition_id": "c", "text": "t", "effect": effect}), Condition)


@pytest.mark.ledger("R13", symbol="harness.contracts.values:decode")
def test_effects_come_in_five_kinds_that_survive_their_bytes() -> None:
    kinds = {kind.__struct_config__.tag for kind in get_args(AnyEffect)}
    assert kinds == {"symbolic", "metric", "relational", "visual", "temporal"}
    task = contract()
    conditions = (*task.completion_conditions, *(c for node in task.nodes for c in node.success_conditions))
    assert {condition.effect.__struct_config__.tag for condition in conditions} == kinds
    for condition in conditions:
        assert decode(encode(condition), Condition) == condition


@given(
    items=st.dictionaries(
        st.text(max_size=5),
        st.recursive(st.integers() | st.text(), lambda inner: st.lists(inner, max_size=3)),
        max_size=6,
    )
)
def test_the_same_value_gives_the_same_bytes_whatever_the_order_of_its_keys(items: dict[str, Any]) -> None:
    reordered = dict(sorted(items.items(), reverse=True))
    assert encode(items) == encode(reordered)
    assert digest(items) == digest(reordered) == sha256(encode(items))
    assert b" :" not in encode({"a": 1})


def test_another_value_has_another_digest() -> None:
    assert digest(contract()) != digest(contract("circuit"))


@pytest.mark.parametrize("text", ["", "x" * 2001])
def test_a_goal_that_is_empty_or_too_long_does_not_decode(text: str) -> None:
    with pytest.raises(msgspec.ValidationError, match="length"):
        decode(msgspec.json.encode({"text": text, "digest": "ab"}), Goal)


@pytest.mark.ledger("R9", symbol="harness.contracts.ids:request_id")
def test_task_node_and_attempt_name_one_request_and_nothing_else_does() -> None:
    mission, go = MissionId("m1"), NodeId("go")
    requests = [
        request_id(mission, go, 1),
        request_id(mission, go, 2),
        request_id(mission, NodeId("return"), 1),
        request_id(MissionId("m2"), go, 1),
        request_id(MissionId("m1\ngo"), NodeId(""), 1),
    ]
    assert len(set(requests)) == len(requests)
    assert requests[0] == request_id(mission, go, 1) == sha256(b"m1\ngo\n1")
    invocations = [invocation_id(request) for request in requests]
    assert len(set(invocations)) == len({packet_id(invocation) for invocation in invocations}) == len(requests)


def test_a_policy_with_an_unknown_class_or_action_does_not_decode() -> None:
    ladders = {failure: ["human"] for failure in get_args(FailureClass)}
    body = {"ladders": ladders, "approval_share": 0.5, "wait_s": 20.0}
    assert msgspec.convert(body, RecoveryPolicy).ladders["violated"] == ("human",)
    for wrong in ({"bad_luck": ["human"]}, {"violated": ["pray", "human"]}):
        with pytest.raises(msgspec.ValidationError, match="Invalid enum value"):
            msgspec.convert({**body, "ladders": ladders | wrong}, RecoveryPolicy)


def test_an_error_says_what_where_and_what_to_do() -> None:
    error = ContractInvalid("The graph has a cycle.", where="nodes", do="remove a dependency")
    assert str(error) == "The graph has a cycle. Where: nodes. remove a dependency."
    assert (error.code, error.what) == ("contract_invalid", "The graph has a cycle.")
    assert issubclass(StoreNewer, StoreUnavailable)
    assert issubclass(StoreUnavailable, HarnessError)


class Inner(Value, tag="inner"):
    beta: float
    alpha: tuple[int, ...]


class Unsorted(Value):
    zeta: Any
    alpha: Inner


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False)
        | st.text(max_size=8),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
        max_leaves=12,
    )
)  # fmt: skip
def test_raw_json_is_what_reading_back_and_encoding_again_gives(value: object) -> None:
    stored = Unsorted(zeta=value, alpha=Inner(beta=1.0, alpha=()))
    assert bytes(raw(stored)) == encode(decode(encode(stored), object))
    assert encode({"value": raw(stored)}) == encode({"value": decode(encode(stored), object)})
