"""Supervision of providers that answer late, twice, never, or not to a stop: whole missions in virtual time."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.commands import ApproveHandoff, StopMission
from harness.contracts.contexts import Context
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.events import (
    CommitRejected,
    DispatchIntended,
    InvocationAccepted,
    InvocationEnded,
    NodeCommitted,
)
from harness.contracts.ids import MissionId
from harness.contracts.tasks import Node
from harness.contracts.values import decode
from tests.builders.connections import Stage, only, staged, template, with_node
from tests.builders.missions_run import OPERATOR
from tests.builders.walking import BASE, base, starts, walking
from tests.fakes.passing import Passing
from tests.fakes.supervised import Deaf, LateStart, Line, LostAcknowledgement, Remote, Runaway, Stubborn, Twice


@pytest.mark.ledger("R82", "R89", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._report")
@pytest.mark.parametrize("kind", [LostAcknowledgement, LateStart, Twice])
def test_a_start_answered_late_never_or_twice_is_one_physical_start(kind: type[Passing]) -> None:
    with staged(wrap=only("navigate", kind)) as stage:
        ran = stage.run(stage.begin("circuit"))
        assert ran.mission.status == "succeeded", ran.mission.reason
        assert len(starts(ran)) == 1
        assert ran.mission.spent_total == 0
        assert sum(isinstance(event, DispatchIntended) for event in ran.events) == 2
        assert not [event for event in ran.events if isinstance(event, InvocationAccepted)], "nothing to keep by handle"


def test_a_second_reply_after_the_commit_changes_nothing() -> None:
    with staged(wrap=only("navigate", Twice)) as stage:
        ran = stage.run(stage.begin("circuit"))
        committed = [event for event in ran.events if isinstance(event, NodeCommitted)]
        assert [event.node_id for event in committed] == ["request", "circuit"]
        assert not [event for event in ran.events if isinstance(event, CommitRejected)]


@pytest.mark.ask("isar#926")
@pytest.mark.ledger("R44", "R91", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._supervise")
def test_a_stop_that_nobody_acknowledges_leaves_the_base_in_quarantine() -> None:
    with staged(wrap=only("navigate", Deaf)) as stage:
        mission_id = walking(stage)
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
        ran = stage.run(mission_id)
        assert base(ran.harness).status == "quarantined"
        assert "not acknowledged" in sentence(base(ran.harness).reason)
        ended = next(event for event in ran.events if isinstance(event, InvocationEnded))
        assert (ended.status, ended.failure) == ("stopping", "cancel_unacknowledged")
        assert ran.mission.status == "cancelled"
        assert ran.mission.stopped is not None and ran.mission.stopped.static


def test_a_body_that_goes_on_after_a_stop_ends_the_mission_as_failed_and_keeps_the_base_locked() -> None:
    with staged(wrap=only("navigate", Runaway)) as stage:
        mission_id = walking(stage)
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
        before_s = stage.harness.clock.now().mission_s
        ran = stage.run(mission_id)
        assert stage.harness.clock.now().mission_s < before_s + 30.0
        assert base(ran.harness).status == "quarantined"
        assert ran.mission.status == "cancelled"
        assert ran.mission.stopped is not None and ran.mission.stopped.static


@pytest.mark.ledger("R44", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._abandon")
def test_a_late_leg_that_does_not_stop_is_a_question_to_a_person_with_the_base_locked() -> None:
    hurried = with_node(template("circuit"), "circuit", timeout_s=8.0)
    with staged(wrap=only("navigate", Stubborn)) as stage:
        ran = stage.run(stage.begin(hurried))
        assert ran.mission.status == "awaiting_human"
        assert [failure.failure for failure in ran.mission.nodes["circuit"].failures][:2] == [  # type: ignore[index]
            "timeout",
            "cancel_unacknowledged",
        ]
        ended = next(event for event in ran.events if isinstance(event, InvocationEnded))
        assert (ended.status, ended.failure) == ("stopping", "cancel_unacknowledged")
        assert stage.parts.spool.samples(ended.invocation_id) == []
        assert base(ran.harness).status == "quarantined"


def test_a_second_timeout_stops_the_body_before_a_person_is_asked() -> None:
    hurried = with_node(template("circuit"), "circuit", timeout_s=8.0)
    with staged() as stage:
        ran = stage.run(stage.begin(hurried))
        assert ran.mission.status == "awaiting_human"
        assert ran.mission.invocation is None
        assert base(ran.harness).status == "free"
        assert len(starts(ran)) == 2


@pytest.mark.ask("flotilla#2613")
@pytest.mark.ledger("R44", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._silence")
def test_a_line_that_stays_cut_ends_as_outcome_unknown_and_a_person_decides() -> None:
    line = Line()
    with staged(wrap=only("navigate", lambda inner: Remote(inner, line))) as stage:
        mission_id = walking(stage)
        line.cut = True
        cut_s = stage.harness.clock.now().mission_s
        stage.until(mission_id, lambda _: base(stage.harness).status == "quarantined")
        assert 20.0 <= stage.harness.clock.now().mission_s - cut_s < 22.0, "a short silence is waited out"
        ran = stage.run(mission_id)
        assert ran.mission.status == "awaiting_human"
        assert ran.mission.invocation is not None and ran.mission.invocation.status == "outcome_unknown"
        assert base(ran.harness).status == "quarantined"
        assert len(starts(ran)) == 1
        assert stage.robot.world.body.state.still


def test_a_line_that_comes_back_finds_the_same_execution_and_stops_it_before_anything_else() -> None:
    line = Line()
    with staged(wrap=only("navigate", lambda inner: Remote(inner, line))) as stage:
        mission_id = walking(stage)
        line.cut = True
        stage.until(mission_id, lambda _: base(stage.harness).status == "quarantined")
        line.cut = False
        ran = stage.run(mission_id)
        assert ran.mission.status == "succeeded", ran.mission.reason
        (first, *later) = ran.mission.nodes["circuit"].packets  # type: ignore[index]
        assert first.terminal == "cancelled"
        assert first.estimates, "the samples before the silence are part of the evidence"
        assert later
        moved = [start for start in ran.harness.starts(mission_id) if start.moves]
        assert len(moved) == 2
        assert ran.duplicate_starts() == 0


@pytest.mark.ledger("R82", symbol="harness.supervisor.leases:freed")
def test_after_an_unknown_outcome_the_operator_frees_the_base_and_grants_one_retry() -> None:
    line = Line()
    with staged(wrap=only("navigate", lambda inner: Remote(inner, line))) as stage:
        mission_id = walking(stage)
        line.cut = True
        stage.run(mission_id)
        line.cut = False
        assert isinstance(approved(stage, mission_id), Refused), "the base is in quarantine"
        assert isinstance(stage.supervisor.free(BASE, actor=OPERATOR, reason="I stand beside it"), Accepted)
        asked = stage.runtime.mission(mission_id).handoff_id
        assert isinstance(approved(stage, mission_id), Accepted)
        ran = stage.run(mission_id)
        assert ran.duplicate_starts() == 0
        moved = [start for start in ran.harness.starts(mission_id) if start.moves]
        assert moved[1].request_id != moved[0].request_id, "the granted attempt really started"
        assert asked is not None and stage.runtime.handoff(asked).status in ("confirmed", "failed")


def test_an_approved_attempt_that_the_robot_refuses_ends_its_handoff_as_failed() -> None:
    line = Line()
    with staged(wrap=only("navigate", lambda inner: Remote(inner, line))) as stage:
        mission_id = walking(stage)
        line.cut = True
        stage.run(mission_id)
        assert isinstance(stage.supervisor.free(BASE, actor=OPERATOR, reason="I stand beside it"), Accepted)
        line.cut = False
        asked = stage.runtime.mission(mission_id).handoff_id
        assert isinstance(approved(stage, mission_id), Accepted)
        ran = stage.run(mission_id)
        refused = next(e for e in ran.events if isinstance(e, InvocationEnded) and e.status == "failed")
        assert "still holds the base" in sentence(refused.reason)
        assert asked is not None and stage.runtime.handoff(asked).status == "failed"


def approved(stage: Stage, mission_id: MissionId) -> object:
    handoff_id = stage.runtime.mission(mission_id).handoff_id
    assert handoff_id is not None
    handoff = stage.runtime.handoff(handoff_id)
    assert handoff.opened is not None
    answer = ApproveHandoff(
        actor=OPERATOR,
        reason="seen",
        key=f"key-{handoff.cycle}-{base(stage.harness).version}",
        cycle=handoff.cycle,
        subject=handoff.opened.subject,
        evidence=handoff.opened.evidence,
    )
    return stage.supervisor.answer(handoff_id, answer)


def test_a_report_from_the_future_does_not_keep_the_mission_waiting() -> None:
    class Ahead(Passing):
        def report(self, handle: str) -> object:  # type: ignore[override]
            said = self.inner.report(handle)
            ahead = said.at_s + 1e6 if said.status == "succeeded" else said.at_s
            return type(said)(**{name: getattr(said, name) for name in said.__struct_fields__} | {"at_s": ahead})

    with staged(wrap=only("navigate", Ahead)) as stage:
        mission_id = stage.begin("circuit")
        begun_s = stage.harness.clock.now().mission_s
        ran = stage.run(mission_id)
        assert stage.harness.clock.now().mission_s < begun_s + 900.0
        assert ran.mission.status in ("awaiting_human", "succeeded")


@pytest.mark.ledger("R22", symbol="harness.contexts.skill:skill_context")
def test_an_invocation_carries_a_version_and_its_six_bindings() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin("circuit"))
        intent = [event for event in ran.events if isinstance(event, DispatchIntended)][-1]
        c2 = decode(stage.runtime.record(intent.context).body, Context)
        card_record, node_record = c2.one("card"), c2.one("node")
        assert card_record is not None and node_record is not None
        card, node = card_record.read(CapabilityCard), node_record.read(Node)
        assert (card.provider_id, card.version) == (intent.provider_id, intent.provider_version)
        assert [condition.predicate for condition in node.preconditions] == ["localised", "hardware_stop_released"]
        assert [condition.condition_id for condition in node.success_conditions] == ["circuit.closed", "circuit.static"]
        assert set(intent.resources) == set(card.resources) == set(node.resources)
        assert node.evidence.mandatory == ("trajectory",)
        assert card.cancel.acknowledged and card.cancel.within_s == 2.0
        assert node.recovery.total == 4
