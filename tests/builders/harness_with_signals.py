"""Builds a harness with the release service and recorded signals: kinematic robot, stores in memory, virtual time."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.assembly import Harness, Member, Parts, joined, local_services
from harness.baseline.load import site
from harness.contracts.ports import Signals
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from simulator.camera import CAMERA
from simulator.robot import SimulatedRobot
from simulator.teleoperation import SimulatedTeleoperation
from simulator.world import WorldSettings
from tests.builders.missions_run import ROBOT


@contextmanager
def harness_with_signals(signals: Signals, *, seed: int = 3) -> Iterator[Harness]:
    """A harness in which nobody approves the motion of canary missions: the release service alone is tested."""
    with ExitStack() as stack:
        robot = SimulatedRobot(WorldSettings(fidelity="kinematic", seed=seed), robot_id=ROBOT)
        clock = LockstepClock(robot.advance_to, at_s=robot.at_s)
        parts = Parts(
            store=MemoryEventStore(),
            blobs=MemoryBlobStore(),
            spool=MemorySpool(),
            ids=SeededIds(seed),
            clock=clock,
            signals=signals,
            site=site(),
            deciders=DECIDERS,
            select=selected,
        )
        beside = local_services(parts, camera=CAMERA, folder=None, room=robot.room)
        member = Member(
            robot_id=ROBOT,
            robot=robot,
            clock=clock,
            local=beside.providers,
            sources=beside.sources,
            configure=lambda mission: robot.configure(mission.mission_id, mission.seed, ()),
            camera=robot,
            hand=SimulatedTeleoperation(robot),
        )
        yield joined(stack, HarnessSettings(speed=0, fidelity="kinematic"), parts, [member])
