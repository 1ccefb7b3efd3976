"""One model per act: a form and an API body say the same command, and every act is exactly one gate command."""

from collections.abc import Iterator
from typing import Any, get_args

import pytest
from pydantic import TypeAdapter

from app.acts import alerts, handoffs, missions
from app.acts.base import Act
from app.auth.command_permissions import PERMISSIONS
from harness.contracts import commands, person_commands
from harness.contracts.actors import Actor
from harness.contracts.errors import ContractInvalid
from tests.saying import raises_saying

ADA = Actor(name="ada", role="operator")
SEEN = {"cycle": 2, "subject": "a" * 64, "evidence": "b" * 64}
HELD = {"reason": "seen on camera", "key": "k-1", "claim": "t"}
BODIES: dict[str, dict[str, Any]] = {
    "look": {},
    "claim": {"claim": "t"},
    "release": {"claim": "t"},
    "on-my-way": {"reason": "two corridors away"},
    "choose": {"action": "verify_again", "cycle": 2, "claim": "t"},
    "attest": {"condition_id": "door", "statement": "it is open", "key": "k-1", "cycle": 2, "claim": "t"},
    "take-over": HELD | {"device": "desk 2"},
    "hand-back": HELD,
    "close": HELD,
    "mission stop": {"reason": "person in the way"},
    "mission pause": {"reason": "look first"},
    "mission resume": {"reason": "clear"},
    "mission withdraw": {"reason": "no longer needed"},
    "mission autonomy": {"autonomy": "approve_risky", "reason": "new floor"},
    "autonomy limit": {"autonomy": "approve_risky", "reason": "new floor"},
    "acknowledge": {"seen": 3, "note": "a cable"},
    "shelve": {"reason": "known", "for_s": 900},
    "suppress": {"reason": "known"},
    "restore": {"reason": ""},
    "assign": {"assignee": "bob"},
    "approve": HELD | SEEN | {"decision": "approve"},
    "reject": HELD | SEEN | {"decision": "reject"},
}
KINDS: dict[str, type[Act]] = {
    **handoffs.ACTS,
    **handoffs.DECISIONS,
    **alerts.ACTS,
    "mission stop": missions.StopMissionAct,
    "mission pause": missions.PauseMissionAct,
    "mission resume": missions.ResumeMissionAct,
    "mission withdraw": missions.WithdrawMissionAct,
    "mission autonomy": missions.SetAutonomyAct,
    "autonomy limit": missions.LimitAutonomyAct,
}


def every_act(kind: type[Act] = Act) -> Iterator[type[Act]]:
    """All acts that can be said; a base that several share is none."""
    if "becomes" in vars(kind):
        yield kind
    for one in kind.__subclasses__():
        yield from every_act(one)


@pytest.mark.parametrize("word", sorted(KINDS))
def test_a_form_and_an_api_body_are_the_same_command(word: str) -> None:
    body = BODIES[word]
    said = KINDS[word].model_validate(body)
    typed = {name: str(value) for name, value in body.items()}
    from_form = KINDS[word].from_form(typed | {"another_button": "of the page"})
    assert from_form == said
    assert isinstance(said, Act)
    command = said.to_command(ADA)
    assert type(command) is KINDS[word].becomes
    assert command.actor == ADA
    assert KINDS[word].model_validate(said.body()) == said, "what the command line posts is the act again"


def test_the_page_types_a_statement_into_the_field_for_reasons() -> None:
    typed = {"condition_id": "door", "reason": " it is open ", "key": "k-1", "cycle": "2"}
    said = handoffs.AttestHandoffAct.from_form(typed)
    assert isinstance(said, handoffs.AttestHandoffAct) and said.statement == "it is open"
    assert handoffs.AttestHandoffAct.from_form(typed | {"reason": ""}) != ()


def test_a_decision_in_the_api_is_one_of_two_acts() -> None:
    adapter: TypeAdapter[Any] = TypeAdapter(handoffs.Decision)
    assert isinstance(adapter.validate_python(BODIES["approve"]), handoffs.ApproveHandoffAct)
    assert isinstance(adapter.validate_python(BODIES["reject"]), handoffs.RejectHandoffAct)


@pytest.mark.parametrize("missing", ["key", "cycle", "subject", "evidence", "decision"])
def test_a_form_that_lost_what_binds_it_is_not_ours(missing: str) -> None:
    typed = {name: str(value) for name, value in BODIES["approve"].items() if name != missing}
    with raises_saying(ContractInvalid, match="not bound"):
        handoffs.ApproveHandoffAct.from_form(typed)


@pytest.mark.parametrize(("reason", "told"), [("", "Say why"), ("   ", "Say why"), ("x" * 201, "below")])
def test_a_reason_that_is_missing_or_too_long_is_told_beside_the_form(reason: str, told: str) -> None:
    wrong = handoffs.CloseHandoffAct.from_form({"key": "k", "claim": "t", "reason": reason})
    assert isinstance(wrong, tuple)
    assert [(one.field, told in one.text) for one in wrong] == [("reason", True)]


def test_every_act_is_exactly_one_gate_command() -> None:
    acts = list(every_act())
    known = {*get_args(commands.AnyCommand), *get_args(person_commands.PersonCommand)}
    assert len(acts) >= len(KINDS)
    assert all(one.becomes in known for one in acts), "an act becomes a command that the gate decides"
    assert len({one.becomes for one in acts}) == len(acts), "no two acts are the same command"
    assert {one.becomes for one in acts} <= set(PERMISSIONS), "and each needs a permission"
    assert set(get_args(person_commands.PersonCommand)) <= {one.becomes for one in acts}


def test_a_dispute_names_its_condition_and_posts_its_reason_alone() -> None:
    said = missions.DisputeCompletionAct.of(condition_id="arrived", reason="it is next door")
    assert said.body() == {"reason": "it is next door"}
    assert said.to_command(ADA).condition_id == "arrived"


def test_a_mission_to_start_is_what_the_runtime_compiles() -> None:
    order = missions.StartMissionAct.of(template="circuit", seed=3).to_command(ADA)
    assert (order.actor, order.template, order.seed, order.autonomy) == (ADA, "circuit", 3, "autonomous")
