"""Runs executions of the simulated robot, and keeps what its sensors published beside where it truly was."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, MissionId, NodeId, RequestId, sha256
from harness.contracts.observations import AnySample, Image, Imu, Odometry, Pose, Scan, Trajectory
from harness.contracts.protocol import (
    TERMINAL,
    InvocationIdentity,
    InvocationReport,
    Parameters,
    Receipt,
    RobotStatus,
    StartRequest,
)
from harness.contracts.values import Point, encode
from simulator.cards import ROUTE_FOLLOWER
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.solids import SiteModel
from simulator.world import WorldSettings

Floats = NDArray[np.float64]
TICK_S = 0.05
LONGEST_S = 240.0
SETTLE_S = 1.5
SPAN = 5000


@dataclass(frozen=True)
class SimulatedExecution:
    """One execution. `truth` holds (at_s, x_m, y_m, yaw_rad) at every tick; `arrivals` when each sample came."""

    samples: tuple[AnySample, ...]
    arrivals: tuple[float, ...]
    truth: Floats
    blobs: dict[Digest, bytes]
    report: InvocationReport
    status: RobotStatus
    from_s: float
    fault: str = ""

    @property
    def terminal_s(self) -> float:
        return self.report.at_s

    @property
    def until_s(self) -> float:
        return float(self.truth[-1, 0])

    @cached_property
    def scans(self) -> tuple[Scan, ...]:
        return tuple(one for one in self.samples if isinstance(one, Scan))

    @cached_property
    def images(self) -> tuple[Image, ...]:
        return tuple(one for one in self.samples if isinstance(one, Image))

    def between(self, from_s: float, until_s: float) -> Trajectory:
        """What arrived in this span, sealed as the supervisor seals it."""
        low, high = np.searchsorted(self.arrivals, [from_s, until_s + 1e-6])
        return sealed(self.samples[int(low) : int(high)])

    def true_at(self, at_s: float) -> tuple[float, float, float]:
        """Where the body truly was: x_m, y_m, yaw_rad."""
        index = min(int(np.searchsorted(self.truth[:, 0], at_s - 1e-6)), len(self.truth) - 1)
        x, y, yaw = self.truth[index, 1:]
        return float(x), float(y), float(yaw)

    def true_path(self, from_s: float, until_s: float) -> Floats:
        """True positions (N, 2) in a span."""
        within = (self.truth[:, 0] >= from_s - 1e-6) & (self.truth[:, 0] <= until_s + 1e-6)
        return np.asarray(self.truth[within, 1:3])

    def true_motion(self, until_s: float, window_s: float = 1.0) -> float:
        """How far the body truly moved in the window that ends then, as standing still is defined (D15), metres: from
        the median of its first third to that of its last third, extrapolated to the whole window."""
        path = self.true_path(until_s - window_s, until_s)
        third = len(path) // 3
        if third < 2:
            return math.inf
        return 1.5 * float(np.hypot(*(np.median(path[-third:], axis=0) - np.median(path[:third], axis=0))))


def executed(
    card: CapabilityCard,
    parameters: Parameters,
    *,
    at: tuple[float, float, float],
    seed: int,
    site: SiteModel | None = None,
    fault: str = "",
    after_s: float = 4.0,
    request: str = "r-1",
) -> SimulatedExecution:
    """One invocation of the kinematic robot, put down at a pose; it stands SETTLE_S before and `after_s` afterwards."""
    robot = placed(at, seed=seed, site=site, fault=fault)
    truth: list[tuple[float, float, float, float]] = []
    _let(robot, SETTLE_S, truth)
    from_s = robot.at_s
    provider = next(one for one in robot.providers() if one.card is card)
    provider.start(_request(card, parameters, request, robot))
    report = robot.find(RequestId(request))
    while report is not None and report.status not in TERMINAL and robot.at_s < from_s + LONGEST_S:
        provider.keepalive(report.handle)
        _let(robot, TICK_S, truth)
        report = robot.find(RequestId(request))
    assert report is not None
    _let(robot, after_s, truth)
    return recorded(robot, truth, report=report, from_s=from_s, fault=fault)


def placed(
    at: tuple[float, float, float], *, seed: int, site: SiteModel | None = None, fault: str = ""
) -> SimulatedRobot:
    """A robot put down at a true pose (m, rad) of a site; its odometry does not count that."""
    robot = SimulatedRobot(WorldSettings(seed=seed), robot_id="vbot-1")
    robot.configure(MissionId("campaign"), seed, parse_faults([fault] if fault else []))
    world = robot.world
    if site is not None:
        world.site = site
        world.body.furnish(site)
    state = world.body.state
    state.x_m, state.y_m, state.yaw_rad = at
    world.sensors.put_down()
    return robot


def recorded(
    robot: SimulatedRobot,
    truth: Sequence[tuple[float, float, float, float]],
    *,
    report: InvocationReport,
    from_s: float,
    fault: str = "",
) -> SimulatedExecution:
    """Everything that the robot published so far, with the bytes that it cites."""
    samples: list[AnySample] = []
    arrivals: list[float] = []
    now_s, after = from_s - SETTLE_S, 0
    while found := robot.observations(after, SPAN).samples:
        for one in found:
            now_s = max(now_s, one.at_s)
            samples.append(one)
            arrivals.append(now_s)
        after = found[-1].seq
    cited = [one.blob for one in samples if isinstance(one, Scan | Image)]
    cited += [one.blob for one in report.receipts if one.blob]
    blobs = {digest: robot.blob(digest) for digest in cited}
    return SimulatedExecution(
        samples=tuple(samples),
        arrivals=tuple(arrivals),
        truth=np.array(truth),
        blobs=blobs,
        report=report,
        status=robot.status(),
        from_s=from_s,
        fault=fault,
    )


def driven(route: Sequence[Point], *, seed: int, fault: str = "", site: SiteModel | None = None) -> SimulatedExecution:
    """A drive along a route with the route follower, from its first point."""
    (x, y), (next_x, next_y) = route[0], route[1]
    parameters: Parameters = {
        "route": tuple(route),
        "target": route[-1],
        "frame": "map",
        "tolerance_m": 0.4,
        "speed_cap_mps": 0.5,
        "lookahead_m": 0.6,
    }
    heading = math.atan2(next_y - y, next_x - x)
    return executed(ROUTE_FOLLOWER, parameters, at=(x, y, heading), seed=seed, fault=fault, site=site)


def sealed(samples: Sequence[AnySample]) -> Trajectory:
    """Samples in order of sensor time, as the supervisor seals them."""
    ordered = sorted(samples, key=lambda one: (one.at_s, one.seq))
    return Trajectory(
        poses=tuple(one for one in ordered if isinstance(one, Pose)),
        odometry=tuple(one for one in ordered if isinstance(one, Odometry)),
        imu=tuple(one for one in ordered if isinstance(one, Imu)),
        scans=tuple(one for one in ordered if isinstance(one, Scan)),
    )


def reference_to(track: Trajectory, blobs: dict[Digest, bytes], *, kind: str = "trajectory") -> EvidenceReference:
    """A reference to sealed samples, whose bytes are put among the blobs."""
    times = [one.at_s for one in (*track.poses, *track.odometry, *track.imu)]
    frames = {one.frame for one in track.poses}
    maps = {one.map_version for one in track.poses}
    body = encode(track)
    digest = sha256(body)
    blobs[digest] = body
    confidences = sorted(one.confidence for one in track.poses)
    return EvidenceReference(
        kind=kind,
        origin="sensor",
        source="robot",
        from_s=min(times, default=0.0),
        until_s=max(times, default=0.0),
        confidence=confidences[len(confidences) // 2] if confidences else 1.0,
        blob=digest,
        frame=frames.pop() if len(frames) == 1 else "",
        map_version=maps.pop() if len(maps) == 1 else "",
    )


def receipts_for(receipts: Sequence[Receipt], request: RequestId) -> tuple[Receipt, ...]:
    """A provider's receipts as those of the request that is judged."""
    return tuple(replace(one, request_id=request) for one in receipts)


def _let(robot: SimulatedRobot, duration_s: float, truth: list[tuple[float, float, float, float]]) -> None:
    state = robot.world.body.state
    for _ in range(round(duration_s / TICK_S)):
        robot.advance_to(robot.at_s + TICK_S / 2)
        truth.append((robot.at_s, state.x_m, state.y_m, state.yaw_rad))


def _request(card: CapabilityCard, parameters: Parameters, request: str, robot: SimulatedRobot) -> StartRequest:
    return StartRequest(
        identity=InvocationIdentity(
            mission_id=MissionId("campaign"),
            node_id=NodeId("stage"),
            attempt=1,
            request_id=RequestId(request),
            provider_id=card.provider_id,
        ),
        capability=card.capability,
        parameters=parameters,
        k_ctx=1,
        configuration=Digest("c" * 64),
        deadline_s=robot.at_s + LONGEST_S,
        fencing=dict.fromkeys(card.resources, 1),
    )
