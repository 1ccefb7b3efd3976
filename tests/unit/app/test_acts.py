"""One model per act: a form and an API body say the same command, and every act is exactly one gate command."""

from collections.abc import Iterator
from typing import Any, get_args

import pytest
from pydantic import TypeAdapter

from app.acts import accounts, alerts, handoffs, leases, missions, places, releases, robots
from app.acts.base import Act
from app.auth.command_permissions import PERMISSIONS
from harness.contracts import commands, person_commands
from harness.contracts.actors import Actor
from harness.contracts.errors import ContractInvalid
from rsi_reviews import commands as review_commands
from rsi_reviews.suite_growth import AddCase
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
    "ask-colleague": {"reason": "a second look"},
    "hand-back": HELD,
    "close": HELD,
    "free": {"reason": "beside it"},
    "safe": {"reason": "people come"},
    "wheel": {"reason": "stuck", "device": "desk 2"},
    "posture": {"posture": "lying", "reason": "for the night"},
    "remove place": {"basis": 2, "reason": "torn down"},
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
    "free": leases.FreeLeaseAct,
    "safe": robots.SendToSafetyAct,
    "wheel": robots.BeginTeleoperationAct,
    "posture": robots.OrderPostureAct,
    "remove place": places.RemovePlaceAct,
    "mission stop": missions.StopMissionAct,
    "mission pause": missions.PauseMissionAct,
    "mission resume": missions.ResumeMissionAct,
    "mission withdraw": missions.WithdrawMissionAct,
    "mission autonomy": missions.SetAutonomyAct,
    "autonomy limit": missions.LimitAutonomyAct,
}


SUPERVISED = ("safe", "wheel", "posture")
"""Whose command the supervisor makes: it measures, and takes the lease of the base."""
NAMED: dict[str, dict[str, Any]] = {"remove place": {"place_id": "dock_1"}}
"""What the address names."""


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
    if word not in SUPERVISED:
        command = said.to_command(ADA, **NAMED.get(word, {}))
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
    known = {*get_args(commands.AnyCommand), *get_args(person_commands.PersonCommand), AddCase}
    known |= {*get_args(review_commands.CandidateCommand), *get_args(review_commands.PointerCommand)}
    assert len(acts) >= len(KINDS)
    assert all(one.becomes in known for one in acts), "an act becomes a command that the gate decides"
    assert len({one.becomes for one in acts}) == len(acts), "no two acts are the same command"
    assert {one.becomes for one in acts} <= set(PERMISSIONS), "and each needs a permission"
    assert set(get_args(person_commands.PersonCommand)) <= {one.becomes for one in acts}


SEEN_SUBJECT = {"cycle": 2, "subject": "a" * 64}
CANDIDATE_BODIES: dict[str, dict[str, Any]] = {
    **dict.fromkeys(("request-changes", "approve", "reject", "authorise"), SEEN_SUBJECT),
    "release": SEEN_SUBJECT | {"robot_id": "vbot-1"},
    "adjudicate": {"mission_id": "msn_1", "finding": "sound"},
}


@pytest.mark.parametrize("verb", sorted(releases.ACTS))
def test_a_form_about_a_candidate_is_the_act_of_the_api_with_a_key_of_its_own(verb: str) -> None:
    kind, body = releases.ACTS[verb], {"reason": "holds", "key": "k-1", **CANDIDATE_BODIES.get(verb, {})}
    said = kind.model_validate(body)
    typed = {name: str(value) for name, value in body.items()}
    assert kind.from_form(typed | {"second-step": "yes"}) == said.model_copy(update={"key": f"{verb}:k-1"})
    assert kind.model_validate(said.body()) == said
    assert isinstance(kind.from_form(typed | {"reason": " "}), tuple)
    for bound in set(body) - {"reason"}:
        with raises_saying(ContractInvalid, match="not bound"):
            kind.from_form({name: text for name, text in typed.items() if name != bound})


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [("kind", "dictator", "no such policy"), ("quorum", "", "1 to 10"), ("cooling_off_h", "many", "no number"),
     ("cooling_off_h", "721", "no number"), ("cooling_off_h", "nan", "no number"), ("reason", "", "Say why")],
)  # fmt: skip
def test_a_policy_that_is_not_well_said_is_told_beside_the_form(field: str, value: str, told: str) -> None:
    typed = {"kind": "two_person", "quorum": "2", "cooling_off_h": "1.5", "reason": "we are two"}
    said = releases.SavePolicyAct.from_form(typed)
    assert isinstance(said, releases.SavePolicyAct) and said.policy().cooling_off_s == 5400.0
    wrong = releases.SavePolicyAct.from_form(typed | {field: value})
    assert isinstance(wrong, tuple) and told in wrong[0].text


PLACE = {
    "name": "Dock", "aliases": "ramp, ramp, bay", "x": "2.5", "y": "-1", "heading": "90", "basis": "0",
    "region": "2, -2; 3, -2; 3, 0", "verification": "configured", "reason": "new", "place_id": "dock_1",
}  # fmt: skip


def test_a_place_is_saved_as_the_form_or_the_api_says_it() -> None:
    said = places.SavePlaceAct.from_form(PLACE)
    assert isinstance(said, places.SavePlaceAct)
    assert (said.aliases, said.region_m) == (("ramp", "bay"), ((2.0, -2.0), (3.0, -2.0), (3.0, 0.0)))
    assert places.SavePlaceAct.model_validate(said.body()) == said
    wrong = places.SavePlaceAct.from_form(PLACE | {"x": "far", "region": "1; 2; 3"})
    assert isinstance(wrong, tuple) and {one.field for one in wrong} == {"x", "region"}


def test_what_is_ticked_for_a_person_is_what_the_api_takes() -> None:
    ticked = {"name": [" Eve "], "roles": ["viewer", "operator"], "password": [" x" * 9]}
    made = accounts.AddAccountAct.from_people(ticked)
    assert isinstance(made, accounts.AddAccountAct)
    assert (made.name, made.roles) == ("eve", ["viewer", "operator"])
    assert made.password == " x" * 9, "a password stays as it was typed"
    change = accounts.ChangeAccountAct
    assert change.from_people({"do": ["enable"]}) == change(disabled=False)
    assert change.from_people({"do": ["disable"]}) == change(disabled=True)
    for nothing in ({"do": ["roles"]}, {"do": ["password"]}, {"do": ["roles"], "roles": ["king"]}):
        assert isinstance(change.from_people(nothing), tuple), nothing
    assert isinstance(accounts.IssueTokenAct.from_people({"name": ["dock"], "scopes": []}), tuple)


def test_a_dispute_names_its_condition_and_posts_its_reason_alone() -> None:
    said = missions.DisputeCompletionAct.of(reason="it is next door")
    assert said.body() == {"reason": "it is next door"}
    assert said.to_command(ADA, condition_id="arrived").condition_id == "arrived"


def test_a_mission_to_start_is_what_the_runtime_compiles() -> None:
    order = missions.StartMissionAct.of(template="circuit", seed=3).to_command(ADA)
    assert (order.actor, order.template, order.seed, order.autonomy) == (ADA, "circuit", 3, "autonomous")
