"""A supervisor that starts again beside an execution that goes on: it reattaches, asks, or says that it cannot know."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import pytest

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.bootstrap import NullSignals, Parts, assemble, local_services
from harness.contracts.events import FailureReported, HandoffRequested, InvocationAccepted
from harness.contracts.ids import MissionId
from harness.settings import HarnessSettings
from simulator.camera import CAMERA
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings
from tests.builders.connections import CrewRobot, Stage, Wrap, only, staged
from tests.builders.missions_run import ROBOT
from tests.builders.walking import base, starts, walking
from tests.fakes.supervised import Line, LostAcknowledgement, Remote


@dataclass
class Durable:
    """Everything that outlives a supervisor: stores, clock, robot."""

    robot: SimulatedRobot
    parts: Parts

    @contextmanager
    def opened(self, wrap: Wrap) -> Iterator[Stage]:
        """A supervisor of its own over the same log and the same robot."""
        with ExitStack() as stack:
            beside = local_services(self.parts, camera=CAMERA, folder=None, room=self.robot.room)
            harness = assemble(
                stack,
                HarnessSettings(speed=0, fidelity="kinematic"),
                self.parts,
                robot=CrewRobot(self.robot, wrap),
                local=[wrap(provider) for provider in beside.providers],
                sources=beside.sources,
                configure=lambda mission: self.robot.configure(mission.mission_id, mission.seed, ()),
            )
            yield Stage(harness, self.robot, self.parts)


@pytest.fixture
def durable() -> Durable:
    robot = SimulatedRobot(WorldSettings(fidelity="kinematic", seed=3), robot_id=ROBOT)
    parts = Parts(
        store=MemoryEventStore(),
        blobs=MemoryBlobStore(),
        spool=MemorySpool(),
        ids=SeededIds(3),
        clock=LockstepClock(robot.advance_to, at_s=robot.at_s),
        signals=NullSignals(),
    )
    return Durable(robot, parts)


def remote(line: Line, made: list[Remote], **card: object) -> Wrap:
    def wrap(inner: object) -> Remote:
        made.append(Remote(inner, line, **card))  # type: ignore[arg-type]
        return made[-1]

    return only("navigate", wrap)


def died_under_way(durable: Durable, wrap: Wrap) -> MissionId:
    """A supervisor that ended, as by a crash, some seconds into the circuit; the robot stands by its dead man."""
    with durable.opened(wrap) as stage:
        mission_id = walking(stage)
    durable.parts.clock.wait_until(durable.parts.clock.now().mission_s + 4.0)
    return mission_id


@pytest.mark.ledger("R88", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._accepted")
def test_a_restarted_supervisor_goes_on_by_the_handle_it_kept(durable: Durable) -> None:
    mission_id = died_under_way(durable, remote(Line(), [], reattach="by_handle"))
    made: list[Remote] = []
    with durable.opened(remote(Line(), made, reattach="by_handle")) as stage:
        ran = stage.run(mission_id)
        assert ran.mission.status == "succeeded", ran.mission.reason
        assert len(starts(ran)) == 1
        assert {call for one in made for call in one.calls} == {"report", "keepalive", "resume"}
        (kept,) = [event for event in ran.events if isinstance(event, InvocationAccepted)]
        assert kept.handle.startswith("route-follower:")


def test_an_act_that_moves_nothing_and_was_never_sent_has_all_its_time_after_a_restart(durable: Durable) -> None:
    with durable.opened(lambda provider: provider) as stage:
        mission_id = stage.begin("circuit")
        dispatched = stage.until(mission_id, lambda mission: mission.invocation is not None)
        assert dispatched.invocation is not None and dispatched.invocation.intent.node_id == "request"
        deadline_s = dispatched.invocation.intent.deadline_s
    durable.parts.clock.wait_until(deadline_s + 30.0)
    with durable.opened(lambda provider: provider) as stage:
        ran = stage.run(mission_id)
    assert ran.mission.status == "succeeded", ran.mission.reason
    assert not [event for event in ran.events if isinstance(event, FailureReported | HandoffRequested)]


@pytest.mark.ask("flotilla#1943")
@pytest.mark.ledger("R88", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._lost")
def test_a_restarted_supervisor_asks_a_person_about_a_provider_that_cannot_be_asked(durable: Durable) -> None:
    mission_id = died_under_way(durable, remote(Line(), [], reattach="none"))
    made: list[Remote] = []
    with durable.opened(remote(Line(), made, reattach="none")) as stage:
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
