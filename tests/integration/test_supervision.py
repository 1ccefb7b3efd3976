"""Supervision of providers that answer late, twice, never, or not to a stop: whole missions in virtual time."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import pytest

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.providers.simulation.camera import CAMERA
from harness.adapters.providers.simulation.robot import SimulatedRobot
from harness.adapters.providers.simulation.world import WorldSettings
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.bootstrap import Harness, Parts, Unheard, assemble, local_providers
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.commands import AcquireLease, QuarantineLease, StopMission
from harness.contracts.contexts import Context
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import UnknownName
from harness.contracts.events import (
    CommitRejected,
    DispatchIntended,
    InvocationAccepted,
    InvocationEnded,
    NodeCommitted,
)
from harness.contracts.handoff_commands import DecideHandoff
from harness.contracts.ids import InvocationId, MissionId, ResourceId, RobotId, lease_stream
from harness.contracts.tasks import Node
from harness.contracts.values import decode
from harness.gate.commit import Request
from harness.projections.leases import Lease
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from tests.builders.crews import CrewRobot, Stage, Wrap, only, staged, template, with_node
from tests.builders.missions_run import OPERATOR, ROBOT, Ran
from tests.fakes.passing import Passing
from tests.fakes.supervised import Deaf, LateStart, Line, LostAcknowledgement, Remote, Runaway, Stubborn, Twice

BASE = ResourceId("vbot-1/mobile_base")


def base(harness: Harness) -> Lease:
    return harness.runtime.lease(BASE)


def under_way(mission: Mission) -> bool:
    """The circuit has begun and goes on."""
    return mission.invocation is not None and mission.invocation.intent.node_id == "circuit"


def walking(stage: Stage, *, seconds: float = 6.0) -> MissionId:
    """A circuit, some seconds under way."""
    mission_id = stage.begin("circuit")
    mission = stage.until(mission_id, under_way)
    since_s = mission.invocation.intent.dispatched_s if mission.invocation else 0.0
    stage.until(mission_id, lambda _: stage.harness.clock.now().mission_s > since_s + seconds)
    return mission_id


def starts(ran: Ran) -> list[str]:
    return [start.request_id for start in ran.harness.starts(ran.mission.mission_id)]


@pytest.mark.ledger("R82", "R89", symbol="harness.supervisor.attend:Attendant._report")
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


@pytest.mark.ledger("R44", "R91", symbol="harness.supervisor.attend:Attendant._supervise")
def test_a_stop_that_nobody_acknowledges_leaves_the_base_in_quarantine() -> None:
    with staged(wrap=only("navigate", Deaf)) as stage:
        mission_id = walking(stage)
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
        ran = stage.run(mission_id)
        assert base(ran.harness).status == "quarantined"
        assert "not acknowledged" in base(ran.harness).reason
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


@pytest.mark.ledger("R44", symbol="harness.supervisor.attend:Attendant._abandon")
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


@pytest.mark.ledger("R85", "R90", symbol="harness.gate.leases:_acquire")
def test_nobody_gets_a_base_in_quarantine_until_a_named_person_frees_it_on_static_evidence() -> None:
    with staged(wrap=only("navigate", Deaf)) as stage:
        mission_id = walking(stage)
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
        stage.run(mission_id)
        refused = stage.run(stage.begin("circuit"))
        assert refused.mission.status == "awaiting_human"
        assert "quarantined" in refused.mission.reason
        assert starts(refused) == []
        freed = stage.supervisor.free(BASE, actor=OPERATOR, reason="I stand beside it")
        assert isinstance(freed, Accepted), freed
        assert base(stage.harness).status == "free"
        assert stage.robot.status().armed is False
        for provider in stage.robot.providers():
            for start in stage.harness.starts(mission_id):
                provider.stop(f"{start.provider_id}:{start.request_id}")
        stage.harness.clock.wait_until(stage.harness.clock.now().mission_s + 2.0)
        assert starts(stage.run(stage.begin("circuit"))), "the base can be had again"


@pytest.mark.ledger("R86", symbol="harness.supervisor.supervisor:Supervisor.free")
def test_freeing_a_lease_is_refused_while_the_body_moves_and_never_stops_or_starts_anything() -> None:
    with staged(wrap=only("navigate", Runaway)) as stage:
        mission_id = walking(stage)
        stage.harness.clock.wait_until(stage.harness.clock.now().mission_s + 0.1)
        held = stage.supervisor.free(BASE, actor=OPERATOR, reason="too early")
        assert isinstance(held, Refused) and held.rule == "not_quarantined"
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
        stage.until(mission_id, lambda _: base(stage.harness).status == "quarantined")
        for handle in [start.request_id for start in stage.harness.starts(mission_id)]:
            stage.robot.providers()[0].resume(f"route-follower:{handle}")
        stage.harness.clock.wait_until(stage.harness.clock.now().mission_s + 0.8)
        moving = stage.supervisor.free(BASE, actor=OPERATOR, reason="it looks fine")
        assert isinstance(moving, Refused) and moving.rule == "not_static"
        assert len(stage.harness.starts(mission_id)) == 1
        assert base(stage.harness).status == "quarantined"


@pytest.mark.ledger("R86", symbol="harness.supervisor.supervisor:Supervisor.free")
def test_a_resource_that_nobody_had_and_a_robot_that_is_not_there_cannot_be_freed() -> None:
    with staged() as stage:
        with pytest.raises(UnknownName, match="never leased"):
            stage.supervisor.free(ResourceId("arm"), actor=OPERATOR, reason="why not")
        elsewhere = Start(actor=OPERATOR, robot_id=RobotId("vbot-9"), template="circuit")
        assert isinstance(stage.runtime.start(elsewhere), Accepted)
        elsewhere_base = ResourceId("vbot-9/mobile_base")
        mission_id, lost = stage.runtime.missions()[0].mission_id, InvocationId("inv_lost")
        held = AcquireLease(resource=elsewhere_base, mission_id=mission_id, invocation_id=lost, token=1, expires_s=9e9)
        for command in (held, QuarantineLease(invocation_id=lost, reason="lost")):
            stage.runtime.commit([Request(lease_stream(elsewhere_base), command)])
        refused = stage.supervisor.free(elsewhere_base, actor=OPERATOR, reason="not mine")
        assert isinstance(refused, Refused) and refused.rule == "no_robot"


@pytest.mark.ledger("R84", symbol="harness.supervisor.leases:expired")
def test_a_supervisor_that_slept_past_the_expiry_quarantines_and_frees_only_after_the_end_was_reported() -> None:
    with staged() as stage:
        mission_id = walking(stage)
        held = base(stage.harness)
        stage.harness.clock.wait_until(held.expires_s + 1.0)
        stage.supervisor.step(mission_id)
        assert base(stage.harness).status == "quarantined"
        assert "expired" in base(stage.harness).reason
        ran = stage.run(mission_id)
        assert ran.mission.status in ("succeeded", "awaiting_human")
        assert len(starts(ran)) == len(set(starts(ran)))
        assert base(stage.harness).token > held.token


@pytest.mark.ledger("R44", symbol="harness.supervisor.attend:Attendant._silence")
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


@dataclass
class House:
    """Everything that outlives a supervisor: stores, clock, robot."""

    robot: SimulatedRobot
    parts: Parts

    @contextmanager
    def opened(self, wrap: Wrap) -> Iterator[Stage]:
        """A supervisor of its own over the same log and the same robot."""
        with ExitStack() as stack:
            harness = assemble(
                stack,
                HarnessSettings(speed=0, fidelity="kinematic"),
                self.parts,
                robot=CrewRobot(self.robot, wrap),
                local=[wrap(provider) for provider in local_providers(self.parts, camera=CAMERA, folder=None)],
                configure=lambda mission: self.robot.configure(mission.mission_id, mission.seed, ()),
            )
            yield Stage(harness, self.robot, self.parts)


@pytest.fixture
def house() -> House:
    robot = SimulatedRobot(WorldSettings(fidelity="kinematic", seed=3), robot_id=ROBOT)
    parts = Parts(
        store=MemoryEventStore(),
        blobs=MemoryBlobStore(),
        spool=MemorySpool(),
        ids=SeededIds(3),
        clock=LockstepClock(robot.advance_to, at_s=robot.at_s),
        signals=Unheard(),
    )
    return House(robot, parts)


def remote(line: Line, made: list[Remote], **card: object) -> Wrap:
    def wrap(inner: object) -> Remote:
        made.append(Remote(inner, line, **card))  # type: ignore[arg-type]
        return made[-1]

    return only("navigate", wrap)


def died_under_way(house: House, wrap: Wrap) -> MissionId:
    """A supervisor that ended, as by a crash, some seconds into the circuit; the robot stands by its dead man."""
    with house.opened(wrap) as stage:
        mission_id = walking(stage)
    house.parts.clock.wait_until(house.parts.clock.now().mission_s + 4.0)
    return mission_id


@pytest.mark.ledger("R88", symbol="harness.supervisor.attend:Attendant._accepted")
def test_a_restarted_supervisor_goes_on_by_the_handle_it_kept(house: House) -> None:
    mission_id = died_under_way(house, remote(Line(), [], reattach="by_handle"))
    made: list[Remote] = []
    with house.opened(remote(Line(), made, reattach="by_handle")) as stage:
        ran = stage.run(mission_id)
        assert ran.mission.status == "succeeded", ran.mission.reason
        assert len(starts(ran)) == 1
        assert {call for one in made for call in one.calls} == {"report", "keepalive", "resume"}
        (kept,) = [event for event in ran.events if isinstance(event, InvocationAccepted)]
        assert kept.handle.startswith("route-follower:")


@pytest.mark.ledger("R88", symbol="harness.supervisor.attend:Attendant._lost")
def test_a_restarted_supervisor_asks_a_person_about_a_provider_that_cannot_be_asked(house: House) -> None:
    mission_id = died_under_way(house, remote(Line(), [], reattach="none"))
    made: list[Remote] = []
    with house.opened(remote(Line(), made, reattach="none")) as stage:
        ran = stage.run(mission_id)
        assert ran.mission.status == "awaiting_human"
        assert ran.mission.invocation is not None and ran.mission.invocation.status == "outcome_unknown"
        assert base(stage.harness).status == "quarantined"
        assert [call for one in made for call in one.calls] == [], "nothing was sent blindly"
        assert len(starts(ran)) == 1


@pytest.mark.parametrize("reattach", ["none", "by_handle"])
def test_a_lost_acknowledgement_without_a_way_to_ask_is_never_sent_again(reattach: str) -> None:
    lost: list[LostAcknowledgement] = []

    def wrap(inner: object) -> LostAcknowledgement:
        lost.append(LostAcknowledgement(inner, reattach=reattach))  # type: ignore[arg-type]
        return lost[-1]

    with staged(wrap=only("navigate", wrap)) as stage:
        ran = stage.run(stage.begin("circuit"))
        assert ran.mission.status == "awaiting_human"
        assert sum(one.sent for one in lost) == 1
        assert base(ran.harness).status == "quarantined"


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
        assert "still has the base" in refused.reason
        assert asked is not None and stage.runtime.handoff(asked).status == "failed"


def approved(stage: Stage, mission_id: MissionId) -> object:
    handoff_id = stage.runtime.mission(mission_id).handoff_id
    assert handoff_id is not None
    handoff = stage.runtime.handoff(handoff_id)
    assert handoff.opened is not None
    answer = DecideHandoff(
        handoff_id=handoff_id,
        decision="approve",
        actor=OPERATOR,
        reason="seen",
        key=f"key-{handoff.cycle}-{base(stage.harness).version}",
        cycle=handoff.cycle,
        subject=handoff.opened.subject,
        evidence=handoff.opened.evidence,
    )
    return stage.runtime.answer(answer)


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
