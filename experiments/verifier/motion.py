"""Cases of the predicates on motion: arrival, static_body, inside, stable, circuit, stayed_out, arrival_without_target.

Their samples are those of simulated drives; faults are added to them, and the truth is where the body truly was.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np
from msgspec.structs import replace

from experiments.verifier import motion_faults
from experiments.verifier.cases import (
    CaseInputs,
    VerifierCase,
    condition_id_of,
    packet_of,
    shown_goal,
    shown_packet,
    stage,
)
from experiments.verifier.executions import TICK_S, SimulatedExecution, driven, reference_to
from experiments.verifier.motion_faults import FAULTS, Distort, JudgedSpan
from experiments.verifier.polygons import Floats, depth, drawn
from harness.baseline.load import site
from harness.contracts.effects import AnyEffect, Metric, Relational, Symbolic, Temporal
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import Digest, NodeId
from harness.contracts.observations import AnySample, Trajectory
from harness.contracts.tasks import Node
from harness.contracts.values import Point
from simulator.cards import ROUTE_FOLLOWER

TOLERANCE_M, EDGE_M = 0.40, 0.05
STILL_M, STILL_FROM_M, STILL_TO_M = 0.02, 0.015, 0.025
FRESH_S = 1.0
SEEN_S = 0.5
"""A shorter visit leaves fewer than the three poses that are more than noise at the region's edge."""
CORRIDOR_M, CORRIDOR_EDGE_M = 1.5, 0.15
SHARE, SHARE_EDGE = 0.95, 0.05
AWAY_M = 0.8
BIASED = "localiser biased from before the dispatch on"
MIRRORED = "localiser mirrored from before the dispatch on"
FORGED = "every source forged: a drive that arrived, with fresh stamps"
SIMULATED = ("stale-pose", "missing-pose", "frozen-localiser", "early-success", "interrupted", "lost-localisation")
Truth = bool | None


@dataclass(frozen=True)
class Drives:
    """Simulated drives between places, and rounds: whole ones, and some that leave something out."""

    ways: tuple[SimulatedExecution, ...]
    biased: tuple[SimulatedExecution, ...]
    rounds: tuple[SimulatedExecution, ...]
    cut_rounds: tuple[SimulatedExecution, ...]

    @property
    def distinct(self) -> int:
        return len(self.ways) + len(self.biased) + len(self.rounds) + len(self.cut_rounds)


def drives(seed: int, *, whole: bool) -> Drives:
    """Drives on the shipped routes; `whole`: all of them, else a few."""
    routes = {one.name: one.waypoints_m for one in site().routes}
    ways = ("A-B", "B-A") if whole else ("B-A",)
    seeds = range(seed, seed + (5 if whole else 1))
    plain = [driven(routes[way], seed=one) for way in ways for one in seeds]
    struck = [driven(routes[way], seed=seed, fault=name) for name in SIMULATED if whole for way in ways]
    biased = [driven(routes[way], seed=seed, fault="biased-localiser") for way in ways[: 2 if whole else 0]]
    circuit = routes["circuit"]
    rounds = [driven(circuit, seed=one) for one in seeds]
    cut = [driven(route, seed=seed) for route in _cut(circuit)[: None if whole else 2]]
    return Drives((*plain, *struck), tuple(biased), tuple(rounds), tuple(cut))


def _cut(circuit: Sequence[Point]) -> list[tuple[Point, ...]]:
    """Rounds that leave something out: half of it and back, the other way round, a chord, only a start, not at all."""
    points = tuple(circuit)
    half = points[: len(points) // 2]
    chord = (*points[:3], *points[-3:])
    return [
        (*half, *reversed(half[:-1])),
        points[::-1],
        chord,
        (*points[:2], points[0]),
        points[: -len(points) // 3],
        (*points[:-2], (points[-2][0] - 0.6, points[-2][1] + 0.5)),
    ]


def standing(chance: Random, count: int, pool: Drives) -> Iterator[VerifierCase]:
    """arrival, static_body and inside, `count` of each: one packet with the three conditions per case."""
    for _ in range(count):
        run, window = _window(chance, pool.ways, shortest_s=6.0, longest_s=22.0)
        name, distort, epistemic = _fault(chance)
        track = run.between(window.from_s - 1.0, window.until_s)
        if name == FORGED:
            track = _forged(chance, pool, window)
        track = distort(track, window, chance)
        target, region = _target(chance, run, window, track), _region(chance, run, window)
        effects: tuple[AnyEffect, ...] = (_arrival(target), _rest(1.0), _inside(region))
        inputs = _packet(effects, track, window)
        here = [run.true_at(window.until_s - back)[:2] for back in (0.0, 0.5, 1.0)]
        still = [run.true_motion(window.until_s - back) for back in (0.0, 0.5, 1.0)]
        truths = (
            _all([_both(_near(point, target), _still(moved)) for point, moved in zip(here, still, strict=True)]),
            _all([_still(moved) for moved in still]),
            _all([_beyond(float(depth(np.array([point]), region)[0]), 0.0, EDGE_M) for point in here]),
        )
        for effect, truth in zip(effects, truths, strict=True):
            yield _case(effect, name, truth, inputs, epistemic=epistemic)


def steady(chance: Random, count: int, pool: Drives) -> Iterator[VerifierCase]:
    """stable: an arrival, or a place in a region, at every look of an interval."""
    for _ in range(count):
        run, window = _window(chance, pool.ways, shortest_s=4.0, longest_s=5.0)
        name, distort, epistemic = _fault(chance)
        track = run.between(window.from_s - 1.0, window.until_s)
        if name == FORGED:
            track = _forged(chance, pool, window)
        interval_s = chance.uniform(0.6, 1.2)
        if chance.random() < 0.5:
            target = _target(chance, run, window, track)
            inner: Metric | Relational = _arrival(target)
        else:
            region = _region(chance, run, window)
            inner = _inside(region)
        backs = np.arange(0.0, interval_s + FRESH_S + 0.01, 0.1)
        points = [run.true_at(window.until_s - back)[:2] for back in backs]
        if isinstance(inner, Metric):
            moved = [run.true_motion(window.until_s - back) for back in backs]
            each = [_both(_near(at, inner.target_m), _still(one)) for at, one in zip(points, moved, strict=True)]
        else:
            each = [_beyond(float(value), 0.0, EDGE_M) for value in depth(np.array(points), region)]
        looks = round(interval_s / 0.1) + 1
        truth = _all([_throughout(each[back : back + looks]) for back in (0, 5, 10)])
        effect = Temporal(predicate="stable", interval_s=interval_s, bound=0.5, inner=inner)
        yield _case(
            effect, name, truth, _packet((effect,), distort(track, window, chance), window), epistemic=epistemic
        )


def rounds(chance: Random, count: int, pool: Drives) -> Iterator[VerifierCase]:
    """circuit: whole rounds, rounds that leave something out, and rounds that were broken off."""
    route = next(one.waypoints_m for one in site().routes if one.name == "circuit")
    home = route[0]
    bounds = {"departure_m": AWAY_M, "progress": SHARE}
    effect = Metric(
        predicate="circuit",
        frame="map",
        map_version="site-1",
        target_m=home,
        tolerance_m=TOLERANCE_M,
        route_m=route,
        bounds=bounds,
    )
    for _ in range(count):
        run = chance.choice(pool.rounds if chance.random() < 0.65 else pool.cut_rounds)
        until_s = run.until_s - chance.uniform(0.0, 2.5)
        if chance.random() < 0.2:
            until_s = run.from_s + chance.uniform(0.1, 1.0) * (run.until_s - run.from_s)
        window = JudgedSpan(run.from_s, until_s)
        name, distort, epistemic = _fault(chance)
        track = run.between(run.from_s - 1.0, until_s)
        if name == FORGED:
            track = _restamped(chance.choice(pool.rounds), window)
        declared = {"route_progress": chance.choice((1.0, 1.0, 0.97, 0.5))} if chance.random() < 0.5 else {}
        inputs = _packet((effect,), distort(track, window, chance), window, declared=declared)
        yield _case(effect, name, went_round(run, window, route, home), inputs, epistemic=epistemic)


def kept_out(chance: Random, count: int, pool: Drives) -> Iterator[VerifierCase]:
    """stayed_out: a goal over one or two executions, and a region beside, near or on the way of one of them."""
    for _ in range(count):
        name, distort, epistemic = _fault(chance)
        chosen = [_window(chance, pool.ways, shortest_s=5.0, longest_s=12.0) for _ in range(chance.randint(1, 2))]
        path = np.concatenate([run.true_path(window.from_s, window.until_s) for run, window in chosen])
        away_m = chance.choice((0.0, chance.uniform(0.5, 2.0), chance.uniform(1.0, 5.0)))
        centre, angle = path[chance.randrange(len(path))], chance.uniform(-math.pi, math.pi)
        middle = (float(centre[0]) + away_m * math.cos(angle), float(centre[1]) + away_m * math.sin(angle))
        region = drawn(chance, middle, radius_m=chance.uniform(0.3, 1.2))
        effect = _inside(region, predicate="stayed_out", relation="stayed_out", object="yard")
        blobs: dict[Digest, bytes] = {}
        nodes, packets = [], {}
        for index, (run, window) in enumerate(chosen):
            node = stage(_rest(1.0), node_id=NodeId(f"leg-{index}"))
            track = run.between(window.from_s - 0.5, window.until_s)
            if name == FORGED:
                track = _restamped(_elsewhere(chance, pool, region), window)
            packet = _sensed(node, distort(track, window, chance), window, blobs)
            nodes.append(node)
            packets[node.node_id] = (packet, 4 + index)
        run, window = max(chosen, key=lambda pair: pair[1].until_s)
        inputs = shown_goal((effect,), nodes, packets, blobs, at_s=window.until_s, recent=_recent(run, window))
        deep = depth(path, region)
        inside_s = TICK_S * int((deep > EDGE_M).sum())
        truth = False if inside_s >= SEEN_S else True if float(deep.max()) < -EDGE_M else None
        yield VerifierCase("stayed_out", name, truth, inputs, condition_id_of(effect, "goal"), epistemic=epistemic)


def aimless(chance: Random, count: int, pool: Drives) -> Iterator[VerifierCase]:
    """arrival_without_target: nobody told the harness where the drive was to go; the truth is where it was meant to."""
    effect = Symbolic(predicate="arrival_without_target", arguments={})
    for _ in range(count):
        run, window = _window(chance, pool.ways, shortest_s=6.0, longest_s=12.0)
        name, distort, epistemic = _fault(chance)
        track = run.between(window.from_s - 1.0, window.until_s)
        if name == FORGED:
            track = _forged(chance, pool, window)
        goal = _target(chance, run, window, track)
        here = [run.true_at(window.until_s - back)[:2] for back in (0.0, 0.5, 1.0)]
        truth = _all([_near(point, goal) for point in here])
        yield _case(
            effect, name, truth, _packet((effect,), distort(track, window, chance), window), epistemic=epistemic
        )


def earlier_jumps(chance: Random, count: int, pool: Drives) -> Iterator[VerifierCase]:
    """arrival and inside where the localiser was off before the two seconds that are compared with odometry."""
    runs = pool.biased or pool.ways
    for _ in range(count):
        run, window = _window(chance, runs, shortest_s=10.0, longest_s=22.0, rest=1.0)
        track = run.between(window.from_s - 1.0, window.until_s)
        if not run.fault:
            track = motion_faults.jumps_earlier(track, window, chance)
        target, region = _target(chance, run, window, track), _region(chance, run, window)
        effects: tuple[AnyEffect, ...] = (_arrival(target), _inside(region))
        inputs = _packet(effects, track, window)
        here = run.true_at(window.until_s)[:2]
        truths = (
            _both(_near(here, target), _still(run.true_motion(window.until_s))),
            _beyond(float(depth(np.array([here]), region)[0]), 0.0, EDGE_M),
        )
        for effect, truth in zip(effects, truths, strict=True):
            name = "localiser off by a jump in motion, before the 2 s that are compared"
            yield _case(effect, name, truth, inputs, epistemic=True)


def went_round(run: SimulatedExecution, window: JudgedSpan, route: Sequence[Point], home: Point) -> Truth:
    """Whether the body truly left, came along the whole route in its order, and stood at home at the end."""
    path = run.true_path(window.from_s, window.until_s)
    if not len(path):
        return False
    last = (float(path[-1, 0]), float(path[-1, 1]))
    left_m = float(np.hypot(*(path - np.array(home)).T).max())
    share = [_along(path, route, radius_m) for radius_m in (CORRIDOR_M - CORRIDOR_EDGE_M, CORRIDOR_M + CORRIDOR_EDGE_M)]
    passed = True if share[0] >= SHARE + SHARE_EDGE / 2 else False if share[1] < SHARE - SHARE_EDGE else None
    parts = [
        _beyond(left_m, AWAY_M, 0.1),
        passed,
        _near(last, home),
        _still(run.true_motion(window.until_s)),
    ]
    return _both(*parts)


def _along(path: Floats, route: Sequence[Point], radius_m: float) -> float:
    """The share of the route's points, every 0.25 m, that the path passed within a radius in their order.

    A point that was missed is left behind once the path is near a point at most two metres further on.
    """
    dense = [
        (a[0] + (b[0] - a[0]) * step / count, a[1] + (b[1] - a[1]) * step / count)
        for a, b in itertools.pairwise(route)
        for count in [max(1, round(math.dist(a, b) / 0.25))]
        for step in range(count)
    ] + [route[-1]]
    points, at, passed = np.array(dense), 0, 0
    for x, y in path:
        while at < len(points):
            ahead = points[at : at + 8]
            off = np.hypot(ahead[:, 0] - x, ahead[:, 1] - y)
            nearest = int(off.argmin())
            if off[nearest] > radius_m or (
                nearest == 0 and len(ahead) > 1 and off[1] > off[0] and at == len(points) - 1
            ):
                break
            passed, at = passed + 1, at + nearest + 1
            if nearest == 0 and len(ahead) > 1 and off[1] > off[0]:
                break
    return passed / len(points)


def _fault(chance: Random) -> tuple[str, Distort, bool]:
    drawn_at = chance.random()
    if drawn_at < 0.05:
        return BIASED, motion_faults.biased, True
    if drawn_at < 0.07:
        return MIRRORED, motion_faults.mirrored, True
    if drawn_at < 0.10:
        return FORGED, motion_faults.nothing, True
    name, distort = chance.choice(FAULTS)
    return name, distort, False


def _window(
    chance: Random, runs: Sequence[SimulatedExecution], *, shortest_s: float, longest_s: float, rest: float = 0.7
) -> tuple[SimulatedExecution, JudgedSpan]:
    """An execution, and the part of it that is judged; `rest`: how often the body stands at its end."""
    run = chance.choice(runs)
    until_s = run.from_s + chance.uniform(0.0, 1.0) * (run.until_s - run.from_s)
    if chance.random() < rest:
        until_s = chance.uniform(min(run.terminal_s, run.until_s - 0.1), run.until_s)
    from_s = max(run.from_s, until_s - chance.uniform(shortest_s, longest_s))
    return run, JudgedSpan(from_s, round(until_s, 3))


def _target(chance: Random, run: SimulatedExecution, window: JudgedSpan, track: Trajectory) -> Point:
    """A target at some distance from where the body is at the end, or from where its localiser takes it to be."""
    x, y, _ = run.true_at(window.until_s)
    if chance.random() < 0.3 and track.poses:
        x, y = track.poses[-1].x_m, track.poses[-1].y_m
    kinds = ((0.0, 0.34), (0.46, 1.2), (1.0, 6.0))
    away_m, angle = chance.uniform(*chance.choices(kinds, weights=(5, 2, 2))[0]), chance.uniform(-math.pi, math.pi)
    return round(x + away_m * math.cos(angle), 3), round(y + away_m * math.sin(angle), 3)


def _region(chance: Random, run: SimulatedExecution, window: JudgedSpan) -> tuple[Point, ...]:
    x, y, _ = run.true_at(window.until_s)
    away_m, angle = chance.choice((0.0, 0.3, 0.8, 2.0)), chance.uniform(-math.pi, math.pi)
    middle = (x + away_m * math.cos(angle), y + away_m * math.sin(angle))
    return drawn(chance, middle, radius_m=chance.uniform(0.4, 1.5))


def _arrival(target: Point) -> Metric:
    return Metric(predicate="arrival", frame="map", map_version="site-1", target_m=target, tolerance_m=TOLERANCE_M)


def _rest(interval_s: float) -> Temporal:
    return Temporal(predicate="static_body", interval_s=interval_s, bound=STILL_M)


def _inside(region: tuple[Point, ...], **changes: str) -> Relational:
    made = Relational(
        predicate="inside",
        relation="inside",
        subject="body",
        object="yard",
        frame="map",
        map_version="site-1",
        region_m=region,
    )
    return replace(made, **changes)


def _packet(effects: Sequence[AnyEffect], track: Trajectory, window: JudgedSpan, **parts: Any) -> CaseInputs:
    blobs: dict[Digest, bytes] = {}
    node = stage(*effects, mandatory=("trajectory",))
    packet = replace(_sensed(node, track, window, blobs), **parts)
    return shown_packet(node, packet, ROUTE_FOLLOWER, blobs)


def _sensed(node: Node, track: Trajectory, window: JudgedSpan, blobs: dict[Digest, bytes]) -> EvidencePacket:
    """A packet whose samples before the dispatch stand beside its trajectory, as a dispatch records them."""
    since = Trajectory(
        poses=tuple(one for one in track.poses if one.at_s >= window.from_s),
        odometry=tuple(one for one in track.odometry if one.at_s >= window.from_s),
        imu=tuple(one for one in track.imu if one.at_s >= window.from_s),
    )
    earlier = Trajectory(
        poses=tuple(one for one in track.poses if one.at_s < window.from_s),
        odometry=tuple(one for one in track.odometry if one.at_s < window.from_s),
    )
    before = (reference_to(earlier, blobs, kind="before"),) if earlier.odometry or earlier.poses else ()
    return packet_of(
        node,
        ROUTE_FOLLOWER,
        from_s=window.from_s,
        until_s=window.until_s,
        estimates=(reference_to(since, blobs),),
        before=before,
    )


def _forged(chance: Random, pool: Drives, window: JudgedSpan) -> Trajectory:
    return _restamped(chance.choice(pool.ways), window)


def _restamped(run: SimulatedExecution, window: JudgedSpan) -> Trajectory:
    """The last samples of another execution, with the stamps of this one."""
    shift = window.until_s - run.until_s
    track = run.between(window.from_s - 1.0 - shift, run.until_s)
    return Trajectory(
        poses=tuple(replace(one, at_s=one.at_s + shift) for one in track.poses),
        odometry=tuple(replace(one, at_s=one.at_s + shift) for one in track.odometry),
        imu=tuple(replace(one, at_s=one.at_s + shift) for one in track.imu),
    )


def _elsewhere(chance: Random, pool: Drives, region: tuple[Point, ...]) -> SimulatedExecution:
    """A drive that stays out of the region, if there is one."""
    out = [one for one in pool.rounds if float(depth(one.truth[:, 1:3], region).max()) < 0.0]
    return chance.choice(out or list(pool.ways))


def _recent(run: SimulatedExecution, window: JudgedSpan) -> tuple[AnySample, ...]:
    track = run.between(window.until_s - 3.0, window.until_s)
    return (*track.poses, *track.odometry, *track.imu)


def _case(effect: AnyEffect, fault: str, truth: Truth, inputs: CaseInputs, *, epistemic: bool) -> VerifierCase:
    return VerifierCase(effect.predicate, fault, truth, inputs, condition_id_of(effect), epistemic=epistemic)


def _near(point: Point, target: Point) -> Truth:
    return _beyond(-math.dist(point, target), -TOLERANCE_M, EDGE_M)


def _still(moved_m: float) -> Truth:
    return True if moved_m < STILL_FROM_M else False if moved_m > STILL_TO_M else None


def _beyond(value: float, bound: float, edge: float) -> Truth:
    """Whether a value exceeds its bound by the edge, stays below it by as much, or is too near to say."""
    return True if value > bound + edge else False if value < bound - edge else None


def _both(*parts: Truth) -> Truth:
    """False if any part is false, true if all are."""
    return False if False in parts else None if None in parts else True


def _all(each: Sequence[Truth]) -> Truth:
    """What holds at each of several instants within the age that evidence may have; None where it changed."""
    return each[0] if all(one is each[0] for one in each) else None


def _throughout(each: Sequence[Truth]) -> Truth:
    """Whether it held at every tenth of a second; what failed for less than three of them is too short to be seen."""
    if sum(one is False for one in each) >= 3:
        return False
    return True if all(one is True for one in each) else None
