"""The adjudicator's own arithmetic: where the body was, and what its evidence said, in hand-made tracks."""

import hashlib
from collections.abc import Callable, Sequence

import pytest
from msgspec.structs import replace

from experiments.campaigns.truths import contradicted, torn
from harness.conformance.hostile.truth import truly_reached
from harness.contracts.effects import Metric
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.observations import Odometry, Pose, Trajectory
from harness.contracts.values import Point, encode
from simulator.truth import Truth
from tests.builders.gate import after, created, dispatch, packet

GOAL: Point = (4.0, 0.0)
ROUTE: tuple[Point, ...] = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 0.0))
ARRIVAL = Metric(predicate="arrival", frame="map", map_version="site-1", target_m=GOAL, tolerance_m=0.4)
CIRCUIT = Metric(
    predicate="circuit", frame="map", map_version="site-1", target_m=ROUTE[0], tolerance_m=0.4, route_m=ROUTE
)
HZ = 20
END_S = 8.0


def truth_along(*points: Point) -> list[Truth]:
    """One line of truth a second."""
    return [
        Truth(kind="pose", at_s=float(second), x_m=x, y_m=y, yaw_rad=0.0, v_mps=0.5)
        for second, (x, y) in enumerate(points)
    ]


@pytest.mark.parametrize(
    ("reached", "why"),
    [((4.0, 0.0), ""), ((4.0, 0.44), ""), ((4.0, 0.46), "0.46 m from the target"), ((0.0, 0.0), "4.00 m from")],
)
def test_the_body_is_where_the_truth_says_and_not_where_it_ought_to_be(reached: Point, why: str) -> None:
    found = truly_reached(ARRIVAL, truth_along((0.0, 0.0), reached), from_s=0.0, at_s=5.0)
    assert (why in found) if why else found == ""


def test_what_came_after_the_instant_does_not_count_and_nothing_is_no_arrival() -> None:
    assert truly_reached(ARRIVAL, truth_along((0.0, 0.0), GOAL), from_s=0.0, at_s=0.5) != ""
    assert truly_reached(ARRIVAL, [], from_s=0.0, at_s=5.0) == "nothing is known of the body"


@pytest.mark.parametrize(
    ("way", "why"),
    [
        (ROUTE, ""),
        (((0.0, 0.0), (0.5, 0.0), (0.0, 0.0)), "the body never left"),
        (((0.0, 0.0), (4.0, 0.0), (0.0, 0.0)), "the body passed 2 of 4 waypoints"),
        (((0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 0.0)), "the body passed 2 of 4 waypoints"),
    ],
)
def test_a_circuit_is_walked_in_order_and_left_before_it_is_closed(way: Sequence[Point], why: str) -> None:
    assert truly_reached(CIRCUIT, truth_along(*way), from_s=0.0, at_s=60.0) == why


def test_what_was_walked_before_the_stage_began_is_no_part_of_its_circuit() -> None:
    assert truly_reached(CIRCUIT, truth_along(*ROUTE, (0.0, 0.0)), from_s=4.0, at_s=60.0) == "the body never left"


def walked(
    *, off_m: float = 0.0, until_s: float = END_S, creeping_mps: float = 0.0, slip: float = 0.0, shown: bool = True
) -> Trajectory:
    """Half a metre a second to the goal until a second before the end, then rest.

    `off_m` away by the localiser, `creeping_mps` by odometry while it should rest, `slip`: what odometry adds to every
    metre; `shown`: whether the localiser says anything in the two seconds before rest.
    """
    rest_s = END_S - 1.2
    times = [index / HZ for index in range(int(until_s * HZ) + 1)]
    poses = tuple(
        Pose(
            seq=index,
            at_s=at_s,
            source="localiser",
            frame="map",
            map_version="site-1",
            x_m=GOAL[0] + off_m - 0.5 * max(rest_s - at_s, 0.0),
            y_m=0.0,
            yaw_rad=0.0,
        )
        for index, at_s in enumerate(times)
        if shown or not rest_s - 2.5 < at_s < rest_s + 0.5
    )
    odometry = tuple(
        Odometry(
            seq=index,
            at_s=at_s,
            source="odometry",
            frame="odom",
            x_m=(1.0 + slip) * 0.5 * min(at_s, rest_s) + creeping_mps * max(at_s - rest_s, 0.0),
            y_m=0.0,
            yaw_rad=0.0,
            v_mps=0.0,
            w_radps=0.0,
        )
        for index, at_s in enumerate(i / HZ for i in range(int(END_S * HZ) + 1))
    )
    return Trajectory(poses=poses, odometry=odometry)


def evidence(samples: Trajectory) -> tuple[EvidencePacket, Callable[[Digest], bytes]]:
    """A packet over these samples, as its tail and as its whole trajectory, and the blobs behind it."""
    raw = encode(samples)
    digest = Digest(hashlib.sha256(raw).hexdigest())
    references = {
        kind: EvidenceReference(
            kind=kind, origin="harness", source="localiser", from_s=0.0, until_s=END_S, confidence=1.0, blob=digest
        )
        for kind in ("after", "trajectory")
    }
    made = replace(
        packet(after(created(), dispatch(created()))),
        after=(references["after"],),
        estimates=(references["trajectory"],),
        terminal_s=END_S,
        collected_s=END_S,
        verify_only=False,
    )
    return made, {digest: raw}.__getitem__


@pytest.mark.parametrize(
    ("samples", "why"),
    [
        (walked(), ""),
        (walked(off_m=0.39), ""),
        (walked(off_m=0.41), "the localiser itself says 0.41 m"),
        (walked(until_s=END_S - 1.0), ""),
        (walked(until_s=END_S - 1.1), "the newest pose was 1.10 s old"),
        (walked(creeping_mps=0.1), "odometry says that the body moved"),
        (Trajectory(poses=walked().poses[-2:], odometry=walked().odometry), "2 poses show"),
        (Trajectory(poses=walked().poses), "odometry says that the body moved inf"),
    ],
)
def test_evidence_speaks_against_an_arrival_where_it_is_off_old_or_moving(samples: Trajectory, why: str) -> None:
    judged, blobs = evidence(samples)
    found = contradicted(ARRIVAL, judged, blobs, whole=False)
    assert (why in found) if why else found == ""


def test_the_whole_way_is_compared_only_when_asked_for_and_never_for_a_look() -> None:
    judged, blobs = evidence(walked(slip=0.2))
    assert contradicted(ARRIVAL, judged, blobs, whole=False) == ""
    assert "localiser and odometry differ by" in contradicted(ARRIVAL, judged, blobs, whole=True)
    assert contradicted(ARRIVAL, replace(judged, verify_only=True), blobs, whole=True) == ""


@pytest.mark.parametrize(
    ("samples", "why"),
    [
        (walked(), ""),
        (walked(slip=0.05), ""),
        (walked(slip=0.15), "localiser and odometry differ by 0.15 m"),
        (walked(shown=False), "a source is missing before standstill"),
        (Trajectory(), "a source is missing"),
        (Trajectory(poses=walked().poses, odometry=walked().odometry[-HZ:]), ""),
    ],
)
def test_localiser_and_odometry_tell_one_story_of_the_way_or_are_torn(samples: Trajectory, why: str) -> None:
    assert torn(samples) == why


def test_a_step_of_the_clock_makes_the_whole_way_the_tail() -> None:
    tail, blobs = evidence(walked())
    empty = encode(Trajectory())
    nothing = Digest(hashlib.sha256(empty).hexdigest())
    cut = replace(tail, after=(replace(tail.after[0], blob=nothing),), terminal_s=END_S + 9.0)

    def blob(digest: Digest) -> bytes:
        return empty if digest == nothing else blobs(digest)

    assert contradicted(ARRIVAL, cut, blob, whole=True) == ""
    assert "0 poses show" in contradicted(ARRIVAL, replace(cut, terminal_s=END_S), blob, whole=True)
