"""Whose question it is, how long it waits, who is called, who drives: on whole missions, by a wall clock in hand."""

from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.auditing.replay import replay_mission
from harness.baseline.load import site
from harness.contracts.actors import Actor
from harness.contracts.commands import AnswerMission, ExpireHandoff, PauseMission, RaiseVeto, ResumeMission, StopMission
from harness.contracts.decisions import Accepted, Refused, refused
from harness.contracts.events import DispatchIntended, RecoveryAuthorised
from harness.contracts.handoff_events import (
    HandoffApproved,
    HandoffEscalated,
    HandoffExtended,
    HandoffReleased,
    NoAnswerTaken,
)
from harness.contracts.ids import handoff_stream, mission_stream
from harness.contracts.reasons import because
from harness.gate.commit import CommandEnvelope
from harness.gate.decide import DECIDER as MISSION
from harness.supervisor.handoff_timeouts import TIMEOUT
from tests.builders.missions_run import ROBOT
from tests.builders.waiting import ADA, BOB, Waiting, waiting


@pytest.fixture
def asked() -> Iterator[Waiting]:
    with waiting() as made:
        yield made.asked()


def rule(decision: object) -> str:
    """The rule that refused; fails for what was accepted."""
    assert isinstance(decision, Refused), decision
    return decision.rule


def mission_kinds(asked: Waiting) -> list[str]:
    return [type(MISSION.codec.decode(one)).__name__ for one in asked.runtime.events(asked.mission_id)]


# claims --------------------------------------------------------------------------------------------------------------


def test_whoever_claims_a_question_is_the_only_one_who_can_decide_it(asked: Waiting) -> None:
    assert isinstance(asked.claim(), Accepted)
    assert asked.handoff.status == "claimed"
    told = asked.decide(actor=BOB)
    assert rule(told) == "claimed"
    assert isinstance(told, Refused) and told.reason.facts["actor"] == "ada"
    assert rule(asked.claim(BOB, "t-bob")) == "claimed"
    assert rule(asked.look(BOB)) == "claimed"
    assert isinstance(asked.decide(claim="t-ada"), Accepted)


def test_a_claim_lapses_after_a_minute_and_voids_the_answer_that_rested_on_it(asked: Waiting) -> None:
    asked.claim()
    asked.pass_s(61.0)
    assert asked.handoff.status == "open"
    assert isinstance(asked.told[-1], HandoffReleased | HandoffEscalated)
    asked.look()
    assert rule(asked.decide(claim="t-ada")) == "claim_lost"
    assert isinstance(asked.decide(actor=BOB), Accepted)


def test_a_claim_is_renewed_by_the_same_token_and_given_up_by_its_holder(asked: Waiting) -> None:
    asked.claim()
    asked.pass_s(40.0)
    assert isinstance(asked.claim(), Accepted)
    asked.pass_s(40.0)
    assert asked.handoff.status == "claimed"
    assert isinstance(asked.release(BOB), Refused)
    assert isinstance(asked.release(), Accepted)
    assert asked.handoff.status == "open"
    assert isinstance(asked.claim(BOB, "t-bob"), Accepted)


def test_deciding_claims_implicitly_and_another_window_of_the_same_person_is_told(asked: Waiting) -> None:
    asked.claim(ADA, "window-1")
    assert rule(asked.decide(claim="")) == "other_window"
    asked.release(ADA, "window-1")
    assert isinstance(asked.decide(), Accepted)


# clock ---------------------------------------------------------------------------------------------------------------


def test_an_unclaimed_question_calls_at_once_then_the_next_person_then_outside(asked: Waiting) -> None:
    def levels() -> list[str]:
        return [event.level for event in asked.told if isinstance(event, HandoffEscalated)]

    assert levels() == ["sound"] or levels() == []
    asked.pass_s(1.0)
    assert levels() == ["sound"]
    asked.pass_s(60.0)
    assert levels() == ["sound", "next_person"]
    asked.claim()
    asked.pass_s(30.0)
    asked.claim()
    asked.pass_s(55.0)
    assert levels() == ["sound", "next_person"]
    asked.pass_s(60.0)
    assert levels() == ["sound", "next_person", "outside"]


def test_on_my_way_extends_the_time_once_and_names_who_comes(asked: Waiting) -> None:
    assert asked.handoff.opened is not None
    before = asked.handoff.opened.deadline_at_s
    assert isinstance(asked.on_my_way(BOB), Accepted)
    assert asked.handoff.opened.deadline_at_s == pytest.approx(before + 600.0)
    told = asked.on_my_way()
    assert rule(told) == "extended" and isinstance(told, Refused) and told.reason.facts["actor"] == "bob"
    asked.pass_s(before - asked.wall_s + 10.0)
    assert asked.handoff.status == "open"
    asked.pass_s(600.0)
    assert asked.handoff.status == "expired"


def test_on_my_way_never_goes_beyond_what_the_zone_allows() -> None:
    zones = tuple(replace(zone, hold_limit_s=1000.0) for zone in site().zones)
    with waiting(site=replace(site(), zones=zones)) as made:
        asked = made.asked()
        opened = asked.handoff.opened
        assert opened is not None
        asked.on_my_way()
        extended = next(event for event in asked.told if isinstance(event, HandoffExtended))
        assert extended.deadline_at_s == pytest.approx(opened.opened_at_s + 1000.0, abs=0.01)
    short = tuple(replace(zone, hold_limit_s=300.0) for zone in site().zones)
    with waiting(site=replace(site(), zones=short)) as made:
        assert rule(made.asked().on_my_way()) == "zone_limit"


@pytest.mark.ledger("R174", symbol="harness.supervisor.handoff_timeouts:HandoffTimeouts._expire")
@pytest.mark.parametrize(("no_answer", "posture"), [("hold", "standing"), ("lie_down", "lying")])
def test_without_an_answer_the_robot_really_takes_the_zones_action(no_answer: str, posture: str) -> None:
    zones = tuple(replace(zone, no_answer=no_answer) for zone in site().zones)
    with waiting(site=replace(site(), zones=zones)) as made:
        asked = made.asked()
        before = len(asked.starts)
        asked.pass_s(901.0)
        assert (asked.handoff.status, asked.mission.status) == ("expired", "safe_stopped")
        taken = asked.told[-1]
        assert isinstance(taken, NoAnswerTaken)
        assert (taken.action, taken.done) == (no_answer, True)
        assert asked.robot.status().posture == posture
        assert not any(start.moves for start in asked.starts[before:])


def test_a_no_answer_action_that_a_crash_cut_off_is_taken_at_the_next_start() -> None:
    zones = tuple(replace(zone, no_answer="lie_down") for zone in site().zones)
    with waiting(site=replace(site(), zones=zones)) as made:
        asked = made.asked()
        asked.pass_s(899.0)
        expired = AnswerMission(
            handoff_id=asked.handoff_id, decision="expired", actor=TIMEOUT, reason="nobody answered in time"
        )
        at_s = asked.wall_s + 2.0
        asked.turn_to(at_s)
        asked.runtime.commit(
            [
                CommandEnvelope(handoff_stream(asked.handoff_id), ExpireHandoff(), None),
                CommandEnvelope(mission_stream(asked.mission_id), expired, None),
            ]
        )
        assert asked.robot.status().posture == "standing"
        asked.restart()
        asked.supervisor.finish_unanswered(ROBOT)
        asked.supervisor.finish_unanswered(ROBOT)
        assert asked.robot.status().posture == "lying"
        assert asked.kinds.count("NoAnswerTaken") == 1


def test_a_late_answer_is_refused_and_changes_nothing(asked: Waiting) -> None:
    asked.pass_s(901.0)
    events = len(asked.told)
    assert rule(asked.decide()) == "not_open"
    assert rule(asked.claim()) == "not_open"
    assert (len(asked.told), asked.mission.status) == (events, "safe_stopped")


# another action ------------------------------------------------------------------------------------------------------


def test_another_action_of_the_ladder_is_asked_anew_and_paid_from_the_budget(asked: Waiting) -> None:
    opened = asked.handoff.opened
    assert opened is not None and "re_perceive" in opened.choices
    old_cycle, spent = asked.handoff.cycle, asked.mission.spent_total
    assert isinstance(asked.choose("re_perceive"), Accepted)
    assert asked.handoff.opened is not None and asked.handoff.opened.proposal is not None
    assert asked.handoff.opened.proposal.action == "re_perceive"
    assert asked.handoff.opened.proposal.spends == 1
    assert rule(asked.decide(cycle=old_cycle)) == "wrong_cycle"
    assert isinstance(asked.decide(), Accepted)
    assert asked.mission.spent_total == spent + 1
    log = [MISSION.codec.decode(one) for one in asked.runtime.events(asked.mission_id)]
    intent = next(event for event in reversed(log) if isinstance(event, DispatchIntended))
    assert (intent.verify_only, intent.moves, intent.action) == (True, False, "re_perceive")
    paid = next(event for event in reversed(log) if isinstance(event, RecoveryAuthorised))
    assert (paid.action, paid.cost) == ("re_perceive", 1)


def test_no_choice_lies_beyond_ladder_and_budget(asked: Waiting) -> None:
    assert rule(asked.choose("switch_skill")) == "no_choice"
    assert rule(asked.choose("stop")) == "no_choice"
    assert rule(asked.choose("retry", cycle=99)) == "wrong_cycle"


# by hand -------------------------------------------------------------------------------------------------------------


def test_taking_over_pauses_the_deadline_and_names_the_device(asked: Waiting) -> None:
    assert rule(asked.take_over()) in ("not_claimed", "claim_lost")
    asked.claim()
    assert isinstance(asked.take_over(), Accepted)
    handoff = asked.handoff
    assert handoff.taken_by == ADA and handoff.control is not None
    assert handoff.control.device == "keyboard at desk 2"
    assert asked.mission.status == "awaiting_human"
    for _ in range(25):
        asked.claim()
        asked.pass_s(50.0)
    assert asked.handoff.status == "taken_over"
    assert rule(asked.decide(actor=BOB)) == "taken_over"


def test_a_link_that_is_lost_gives_control_back_and_the_time_runs_on(asked: Waiting) -> None:
    asked.claim()
    asked.take_over()
    left = asked.handoff.control.left_s if asked.handoff.control else 0.0
    asked.pass_s(61.0)
    assert asked.handoff.status == "open"
    assert asked.handoff.opened is not None
    assert asked.handoff.opened.deadline_at_s == pytest.approx(asked.wall_s + left, abs=1.0)


def test_a_robot_handed_back_is_looked_at_afresh_and_nothing_moves(asked: Waiting) -> None:
    asked.claim()
    asked.take_over()
    before, k = len(asked.starts), asked.mission.k
    assert isinstance(asked.hand_back(), Accepted)
    asked.run()
    looks = asked.starts[before:]
    assert looks and not any(start.moves for start in looks)
    assert asked.mission.k > k
    answer = asked.handoff.answer
    assert answer is not None and answer.decision == "handed_back" and answer.fresh is not None
    assert asked.handoff.status in ("confirmed", "failed")
    assert rule(asked.hand_back(BOB)) == "decided"
    again = asked.hand_back()
    assert isinstance(again, Accepted) and again.events == ()
    report = replay_mission(asked.runtime, asked.mission_id)
    assert report.differences == ()


def test_the_gate_takes_no_robot_back_while_somebody_has_its_wheel(asked: Waiting) -> None:
    asked.claim()
    asked.take_over()
    teleoperation = asked.harness.teleoperation
    assert isinstance(teleoperation.take(ROBOT, actor=ADA, device="tablet", reason="round the pallet"), Accepted)
    before, starts = asked.runtime.head(), len(asked.starts)
    refused = asked.hand_back()
    assert rule(refused) == "wheel_held"
    assert isinstance(refused, Refused)
    assert refused.reason == because("wheel_held", actor="ada", robot_id="vbot-1", device="tablet")
    assert asked.runtime.head() == before and len(asked.starts) == starts
    assert isinstance(teleoperation.give_back(ROBOT, actor=ADA, reason="round it"), Accepted)
    assert isinstance(asked.hand_back(), Accepted)
    assert asked.kinds.count("HandoffHandedBack") == 1


def test_closing_without_handing_back_ends_handed_off(asked: Waiting) -> None:
    assert rule(asked.close()) == "claim_lost"
    asked.claim()
    asked.take_over()
    assert isinstance(asked.close(), Accepted)
    assert (asked.handoff.status, asked.mission.status) == ("closed", "handed_off")
    assert "ada" in sentence(asked.mission.reason)


# what voids an approval ----------------------------------------------------------------------------------------------


@pytest.mark.ask("langgraph#7895")
@pytest.mark.ledger("R171", symbol="harness.supervisor.approvals:clear_to_send")
@pytest.mark.parametrize("change", ["pause", "veto", "late", "stop", "role"])
def test_an_approval_is_void_once_what_it_was_bound_to_changes_and_nothing_is_sent(asked: Waiting, change: str) -> None:
    asked.link.down = True
    before = len(asked.starts)
    assert isinstance(asked.decide(), Accepted)
    assert asked.handoff.status == "approved"
    if change == "pause":
        asked.runtime.submit(asked.mission_id, PauseMission(actor=BOB, reason="lunch"))
    if change == "veto":
        asked.runtime.submit(asked.mission_id, RaiseVeto(layer="site", reason="people in the hall"))
    if change == "stop":
        asked.runtime.submit(asked.mission_id, StopMission(actor=BOB, reason="enough"))
    if change == "role":
        asked.obey(
            lambda command: refused("role_revoked", actor="ada") if type(command).__name__ == "MarkDispatched" else None
        )
    asked.link.down = False
    asked.pass_s(121.0 if change == "late" else 0.0)
    asked.pass_s(0.0)
    assert asked.handoff.status == "voided"
    assert "HandoffDispatched" not in asked.kinds
    moved = [start for start in asked.starts[before:] if start.moves]
    assert moved == []
    if change in ("late", "role"):
        asked.obey(lambda command: None)
        asked.run()
        assert asked.mission.status == "awaiting_human" and asked.mission.handoff_id != asked.handoff_id


def test_a_pause_while_a_question_is_open_keeps_the_question(asked: Waiting) -> None:
    asked.runtime.submit(asked.mission_id, PauseMission(actor=BOB, reason="lunch"))
    assert rule(asked.decide()) == "not_active"
    asked.runtime.submit(asked.mission_id, ResumeMission(actor=BOB, reason="back"))
    assert asked.mission.status == "awaiting_human"
    asked.look()
    assert isinstance(asked.decide(), Accepted)


def test_a_role_that_was_taken_back_is_noticed_inside_the_commit(asked: Waiting) -> None:
    def gone(command: object) -> Refused | None:
        actor = getattr(command, "actor", None)
        mine = isinstance(actor, Actor) and actor.name == "ada"
        return refused("role_revoked", actor="ada") if mine else None

    asked.obey(gone)
    assert rule(asked.decide()) == "role_revoked"
    assert "HandoffApproved" not in asked.kinds
    assert isinstance(asked.decide(actor=BOB), Accepted)


def test_an_approval_stores_the_fresh_look_it_was_given_on_and_what_was_shown(asked: Waiting) -> None:
    asked.decide()
    approved = next(event for event in asked.told if isinstance(event, HandoffApproved))
    assert approved.fresh is not None and approved.fresh.static
    assert approved.shown is not None and asked.runtime.blob(approved.shown)
    assert approved.fresh.image is not None
    assert asked.runtime.blob(approved.fresh.image)[:2] == b"\xff\xd8"


def test_everything_said_at_a_handoff_is_derived_again_from_the_log(asked: Waiting) -> None:
    asked.pass_s(1.0)
    asked.on_my_way()
    asked.claim()
    asked.pass_s(61.0)
    asked.claim()
    asked.choose("re_perceive")
    asked.decide(claim="t-ada")
    asked.run()
    report = replay_mission(asked.runtime, asked.mission_id)
    assert report.differences == ()
    assert report.handoffs >= 8
