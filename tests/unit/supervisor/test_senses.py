"""What the supervisor keeps of the robot's samples: each once, the last seconds, an execution's own in its spool."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import pytest
from msgspec.structs import replace

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.pictures import PICTURES
from harness.adapters.stores.memory import MemorySpool
from harness.bootstrap import simulated
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import Digest, InvocationId, RobotId
from harness.contracts.observations import AnySample, Pose, Scan
from harness.contracts.ports import Clock, Robot
from harness.contracts.protocol import Observations
from harness.settings import HarnessSettings
from harness.supervisor.observations import RECENT_S, ObservationBuffer
from harness.supervisor.robot_connection import RobotConnection
from simulator.in_process import SIMULATOR
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings

OPEN = InvocationId("inv-1")


class RecordingSpool(MemorySpool):
    """A spool that can say for whom it was written."""

    def __init__(self) -> None:
        super().__init__()
        self.names: set[InvocationId] = set()

    def add(self, invocation: InvocationId, samples: Iterable[AnySample]) -> None:
        """The spool's add."""
        self.names.add(invocation)
        super().add(invocation, samples)


class Gone(SimulatedRobot):
    """A robot that answers until it is switched off."""

    off = False

    def __init__(self, world: WorldSettings) -> None:
        super().__init__(world)
        self.asked: list[Digest] = []

    def observations(self, after: int, limit: int = 5000) -> Observations:
        """The robot's observations."""
        if self.off:
            raise ProviderUnreachable("The robot is off", where="vbot-1", do="switch it on")
        return super().observations(after, limit)

    def blob(self, digest: Digest) -> bytes:
        """The robot's blob."""
        self.asked.append(digest)
        return super().blob(digest)


@dataclass
class Watch:
    """Senses over a simulated robot that stands."""

    robot: Gone
    spool: RecordingSpool
    observations: ObservationBuffer
    clock: Clock

    def after(self, seconds: float) -> None:
        self.clock.wait_until(self.clock.now().mission_s + seconds)


@pytest.fixture
def watch() -> Iterator[Watch]:
    with simulated(HarnessSettings(fidelity="kinematic", speed=0), simulator=SIMULATOR, seed=1) as harness:
        robot, spool = Gone(WorldSettings()), RecordingSpool()
        clock = LockstepClock(robot.advance_to, at_s=robot.at_s, wall=lambda: robot.at_s)
        connection = RobotConnection(
            robot_id=RobotId("vbot-1"),
            robot=_as_robot(robot),
            providers={},
            clock=clock,
            ids=SeededIds(1),
            spool=spool,
            prepare=lambda mission: None,
            revive=lambda: False,
            pictures=PICTURES,
        )
        yield Watch(robot, spool, ObservationBuffer(runtime=harness.runtime, connection=connection), clock)


def _as_robot(robot: Gone) -> Robot:
    return robot


def test_each_sample_is_seen_once_in_the_order_of_its_number(watch: Watch) -> None:
    for _ in range(3):
        watch.after(1.0)
        assert watch.observations.collect(OPEN)
    assert watch.observations.collect(OPEN)
    numbers = [sample.seq for sample in watch.spool.samples(OPEN)]
    assert numbers == sorted(set(numbers)) and len(numbers) > 100
    assert [sample.seq for sample in watch.observations.recent] == numbers


def test_samples_of_no_execution_are_spooled_for_nobody(watch: Watch) -> None:
    watch.after(1.0)
    assert watch.observations.collect(None)
    assert watch.spool.names == set() and watch.observations.recent
    watch.after(1.0)
    assert watch.observations.collect(OPEN)
    first = watch.spool.samples(OPEN)[0]
    assert first.at_s > watch.robot.at_s - 1.01 and watch.spool.names == {OPEN}


def test_no_sweep_of_long_ago_is_fetched_from_a_robot_that_ran_before_this_harness_began(watch: Watch) -> None:
    watch.after(10 * RECENT_S)
    sweeps = [one for one in watch.robot.observations(0, 100_000).samples if isinstance(one, Scan)]
    assert watch.observations.collect(None)
    recent = {one.blob for one in sweeps if one.at_s >= watch.robot.at_s - RECENT_S}
    assert set(watch.robot.asked) == recent and len(recent) < len({one.blob for one in sweeps})
    assert min(one.at_s for one in watch.observations.recent) >= watch.robot.at_s - RECENT_S


def test_the_sweeps_of_an_open_execution_are_fetched_however_old_they_are(watch: Watch) -> None:
    watch.after(10 * RECENT_S)
    assert watch.observations.collect(OPEN)
    sweeps = {one.blob for one in watch.spool.samples(OPEN) if isinstance(one, Scan)}
    assert sweeps == set(watch.robot.asked)
    assert min(one.at_s for one in watch.spool.samples(OPEN)) < watch.robot.at_s - 9 * RECENT_S


def test_only_the_last_seconds_are_kept_and_a_silent_robot_changes_nothing(watch: Watch) -> None:
    watch.after(RECENT_S + 5.0)
    assert watch.observations.collect(None)
    kept = watch.observations.recent
    horizon_s = watch.observations.recent[-1].at_s - RECENT_S
    assert kept and min(sample.at_s for sample in kept) >= horizon_s
    watch.robot.off = True
    assert not watch.observations.collect(OPEN)
    assert watch.observations.recent == kept and watch.spool.names == set()


def test_a_seal_names_frame_and_map_only_where_all_poses_agree(watch: Watch) -> None:
    watch.after(1.0)
    assert watch.observations.collect(None)
    poses = [one for one in watch.observations.recent if isinstance(one, Pose)]
    rest = [one for one in watch.observations.recent if not isinstance(one, Pose)]
    whole, trajectory = watch.observations.seal([*rest, *poses], source="robot")
    assert (whole.frame, whole.map_version, whole.confidence) == ("map", poses[0].map_version, 0.95)
    assert (whole.from_s, whole.until_s) == (trajectory.odometry[0].at_s, trajectory.imu[-1].at_s)
    torn, _ = watch.observations.seal([poses[0], replace(poses[1], map_version="other")], source="robot")
    assert (torn.frame, torn.map_version) == ("map", "")
    blind, kept = watch.observations.seal(rest, source="robot")
    assert (blind.frame, blind.map_version, blind.confidence, kept.poses) == ("", "", 1.0, ())
    nothing, _ = watch.observations.seal([], source="robot")
    assert (nothing.from_s, nothing.until_s) == (0.0, 0.0)
