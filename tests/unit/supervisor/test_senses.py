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
from harness.contracts.ids import Digest, InvocationId, RobotId, sha256
from harness.contracts.observations import AnySample, Battery, Pose, Scan
from harness.contracts.ports import Clock, Robot
from harness.contracts.protocol import Observations
from harness.contracts.reasons import because
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from harness.supervisor.observations import (
    BATCH,
    BLOBS_S,
    DRAIN_S,
    MOST_A_SECOND,
    MOST_AT_ONCE,
    MOST_BATCHES,
    MOST_LOST,
    RECENT_S,
    ObservationBuffer,
)
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
    """A robot that answers until it is switched off, and that may flood whoever reads its samples."""

    off = False
    flood = 0
    """How many samples of its battery every batch holds, if any."""
    late_s = 0.0
    """How much wall time each of its batches takes."""
    wall_s = 0.0

    def __init__(self, world: WorldSettings) -> None:
        super().__init__(world)
        self.asked: list[Digest] = []
        self.blobs: dict[Digest, bytes] = {}
        self.losing: dict[Digest, int] = {}
        """How many requests for these bytes are lost yet."""
        self.sweeps: tuple[Scan, ...] = ()
        """What the next batch holds beside the robot's own samples."""

    def observations(self, after: int, limit: int = 5000) -> Observations:
        """The robot's observations."""
        if self.off:
            raise ProviderUnreachable("The robot is off", where="vbot-1", do="switch it on")
        self.wall_s += self.late_s
        if self.flood:
            numbers = range(after + 1, after + 1 + self.flood)
            charges = [Battery(seq=number, at_s=self.at_s, source="battery", charge=0.5) for number in numbers]
            return Observations(samples=tuple(charges), next_seq=numbers[-1], at_s=self.at_s)
        batch, more = super().observations(after, limit), self.sweeps
        self.sweeps = ()
        return replace(batch, samples=(*batch.samples, *more))

    def blob(self, digest: Digest) -> bytes:
        """The robot's blob."""
        if self.losing.get(digest):
            self.losing[digest] -= 1
            raise ProviderUnreachable(because("robot_did_not_answer"), where="vbot-1")
        self.asked.append(digest)
        self.wall_s += self.late_s
        return self.blobs.get(digest) or super().blob(digest)

    def sweep(self, seq: int, body: bytes) -> Scan:
        """A sweep of these bytes, which the robot gives out."""
        self.blobs[sha256(body)] = body
        return Scan(seq=seq, at_s=self.at_s, source="lidar", frame="body", blob=sha256(body), points=1)


@dataclass
class Watch:
    """Senses over a simulated robot that stands."""

    robot: Gone
    spool: RecordingSpool
    observations: ObservationBuffer
    clock: Clock
    runtime: Runtime

    def after(self, seconds: float) -> None:
        self.clock.wait_until(self.clock.now().mission_s + seconds)


@pytest.fixture
def watch() -> Iterator[Watch]:
    with simulated(HarnessSettings(fidelity="kinematic", speed=0), simulator=SIMULATOR, seed=1) as harness:
        robot, spool = Gone(WorldSettings()), RecordingSpool()
        clock = LockstepClock(robot.advance_to, at_s=robot.at_s, wall=lambda: robot.at_s + robot.wall_s)
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
        yield Watch(
            robot, spool, ObservationBuffer(runtime=harness.runtime, connection=connection), clock, harness.runtime
        )


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


def trouble(watch: Watch) -> str:
    return watch.observations.trouble.code if watch.observations.trouble is not None else ""


def test_full_batches_count_from_one_reading_to_the_next_however_few_of_them_come_in_each(watch: Watch) -> None:
    watch.robot.flood, watch.robot.late_s = BATCH, DRAIN_S / 4
    for _ in range(MOST_BATCHES):
        watch.after(0.5)
        assert watch.observations.collect(OPEN)
    assert trouble(watch) == "observations_endless"
    assert len(watch.spool.samples(OPEN)) <= MOST_BATCHES * BATCH
    watch.robot.flood = 0
    watch.after(0.5)
    assert watch.observations.collect(None)
    assert trouble(watch) == ""


def test_an_execution_has_no_more_samples_than_a_robot_can_make_in_its_time(watch: Watch) -> None:
    assert watch.observations.collect(None)
    watch.robot.flood = BATCH - 1
    for _ in range(12):
        watch.after(0.5)
        assert watch.observations.collect(OPEN)
    assert trouble(watch) == "samples_too_many"
    assert len(watch.spool.samples(OPEN)) <= MOST_AT_ONCE + 6 * MOST_A_SECOND
    watch.robot.flood = 0
    watch.after(600.0)
    assert watch.observations.collect(OPEN)
    assert trouble(watch) == "samples_too_many", "an execution that was once too much stays so"
    assert watch.observations.collect(InvocationId("inv-2"))
    assert trouble(watch) == ""


def test_what_a_robot_made_while_no_harness_was_there_is_no_flood(watch: Watch) -> None:
    watch.robot.flood = BATCH - 1
    for _ in range(MOST_BATCHES):
        assert watch.observations.collect(OPEN)
    assert trouble(watch) == "" and len(watch.spool.samples(OPEN)) == MOST_BATCHES * (BATCH - 1)
    assert watch.observations.collect(OPEN)
    assert trouble(watch) == "samples_too_many"


def test_sweeps_that_come_slowly_are_fetched_in_several_readings_and_the_rest_before_the_packet(watch: Watch) -> None:
    assert watch.observations.collect(OPEN)
    watch.robot.asked.clear()
    watch.after(0.05)
    bodies = [b"%d" % number for number in range(100)]
    watch.robot.sweeps = tuple(watch.robot.sweep(10_000 + number, body) for number, body in enumerate(bodies))
    watch.robot.late_s = BLOBS_S / 10
    assert watch.observations.collect(OPEN)
    assert 0 < len(watch.robot.asked) <= 12
    assert watch.observations.collect(OPEN)
    first = len(watch.robot.asked)
    assert 12 < first <= 24
    watch.robot.late_s = 1.0
    watch.observations.fetch_rest(())
    assert first < len(watch.robot.asked) < 100, "and no longer than a minute"
    asked = len(watch.robot.asked)
    watch.robot.late_s = 0.0
    watch.observations.fetch_rest(())
    assert len(watch.robot.asked) == len(set(watch.robot.asked)) == asked, "what was not there then stays missing"
    assert [watch.runtime.has_blob(sha256(body)) for body in bodies].count(True) == asked


@pytest.mark.parametrize("lost", [1, MOST_LOST - 1, MOST_LOST])
def test_a_request_for_a_sweep_that_is_lost_is_repeated_and_then_passed_over(watch: Watch, lost: int) -> None:
    assert watch.observations.collect(OPEN)
    watch.after(0.05)
    first, second = b"first", b"second"
    watch.robot.sweeps = (watch.robot.sweep(10_000, first), watch.robot.sweep(10_001, second))
    watch.robot.losing = {sha256(first): lost}
    for _ in range(MOST_LOST):
        assert watch.observations.collect(OPEN)
    assert watch.runtime.has_blob(sha256(first)) is (lost < MOST_LOST)
    assert watch.runtime.has_blob(sha256(second))


def test_the_sweeps_of_an_execution_take_no_more_bytes_than_a_robot_can_make_in_its_time(watch: Watch) -> None:
    assert watch.observations.collect(OPEN)
    bodies = [b"%08d" % number * (1 << 20) for number in range(20)]
    watch.robot.sweeps = tuple(watch.robot.sweep(10_000 + number, body) for number, body in enumerate(bodies))
    watch.after(0.05)
    assert watch.observations.collect(OPEN)
    assert watch.observations.collect(OPEN)
    assert trouble(watch) == "sweeps_too_large"
    kept = sum(watch.runtime.has_blob(sha256(body)) for body in bodies)
    assert 8 <= kept <= 10
    watch.after(60.0)
    assert watch.observations.collect(None)
    assert trouble(watch) == ""


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
