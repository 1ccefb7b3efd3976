"""Cases of covered: maps drawn from sweeps of the simulated lidar; the truth is what could be seen from there."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from random import Random

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy import ndimage

from experiments.verifier.cases import K, VerifierCase, condition_id_of, packet_of, shown_goal, stage
from experiments.verifier.executions import SimulatedExecution, executed
from experiments.verifier.polygons import depth
from harness.baseline.load import site
from harness.contracts.effects import Symbolic
from harness.contracts.evidence import EvidenceReference
from harness.contracts.exploration import GridMap
from harness.contracts.ids import Digest, NodeId, sha256
from harness.contracts.observations import Scan, Trajectory
from harness.contracts.values import encode
from harness.exploration.grid import merged, unexplored, usable
from harness.projections.exploration import MAP
from simulator.bodies import LIDAR_REACH_M
from simulator.cards import OBSERVER
from simulator.floor_plan import FloorPlan
from simulator.site import storage_site

Mask = NDArray[np.bool_]
EDGE = 0.05
RAYS = 1440
PLACES = (
    (0.0, 0.0), (1.0, 2.6), (1.0, 4.8), (5.5, 2.6), (5.5, -2.6), (1.3, -2.5), (6.4, 0.5), (-1.2, 2.8), (-1.2, -2.8),
    (-1.0, 4.8), (4.0, 4.8), (8.0, 4.8), (11.0, 4.8), (13.6, 4.8), (11.0, 6.6), (11.0, 8.4), (8.9, 7.0), (12.8, 8.4),
    (9.0, 11.2), (13.0, 11.0), (13.5, 12.6), (9.6, 12.7), (11.0, 12.9), (7.0, 3.3),
)  # fmt: skip


@dataclass(frozen=True)
class VisibleCells:
    """One stand of the body with its sweeps, and the cells of the map that truly can be seen from there."""

    run: SimulatedExecution
    seen: Mask


def views(seed: int, *, count: int) -> tuple[VisibleCells, ...]:
    """So many stands in the rooms of the site, each place in turn."""
    chance = Random(seed)
    return tuple(_view(chance, PLACES[index % len(PLACES)], seed + index) for index in range(count))


def coverages(chance: Random, count: int, pool: Sequence[VisibleCells]) -> Iterator[VerifierCase]:
    """covered: an exploration that stood at some of the places, and the share that was asked."""
    for _ in range(max(1, count // ASKED)):
        name = chance.choice(NAMES)
        stood = chance.sample(list(pool), min(len(pool), chance.choice((1, 3, 6, 10, 16, len(pool)))))
        grid, blobs = _drawn(name, stood, chance, pool)
        share = truly_seen([one.seen for one in stood])
        for _ in range(ASKED):
            yield _case(name, grid, blobs, share, stood[0].run.until_s, chance)


def _case(
    name: str, grid: GridMap, blobs: dict[Digest, bytes], share: float, at_s: float, chance: Random
) -> VerifierCase:
    target_share = _target_share(chance, share)
    body = encode(grid)
    digest = sha256(body)
    stored_blobs = {**blobs, digest: body + b" " if name == "map altered" else body}
    effect = Symbolic(predicate="covered", arguments={"share": f"{target_share:.3f}"})
    node = stage(effect, node_id=NodeId("view"))
    reference = EvidenceReference(
        kind=MAP, origin="sensor", source="lidar", from_s=at_s, until_s=at_s, confidence=1.0, blob=digest,
        frame="map", map_version="site-1", values={"after_stage": "view"},
    )  # fmt: skip
    observed = () if name == "map missing" else (reference,)
    packet = packet_of(node, OBSERVER, from_s=at_s - 5.0, until_s=at_s)
    inputs = shown_goal(
        (effect,),
        (node,),
        {node.node_id: (packet, K + 1)},
        stored_blobs,
        at_s=at_s + 5.0,
        mission={"observed": observed},
    )
    truth = True if share > target_share + EDGE else False if share < target_share - EDGE else None
    return VerifierCase("covered", name, truth, inputs, condition_id_of(effect, "goal"), epistemic=name in FORGED)


ASKED = 20
"""So many shares are asked of each map."""
FORGED = ("map of another exploration", "localiser biased: the map is drawn elsewhere", "sweeps mirrored")
"""The map comes from one lidar and one localiser: what these forge consistently is seen by nothing that is asked."""
NAMES = (
    "none", "none", "none", "lidar drops out", "half of each sweep", "sweeps while turning", "map altered",
    "map missing", "headings wrong", "localiser drops out", *FORGED,
)  # fmt: skip


def truly_seen(masks: Sequence[Mask]) -> float:
    """The share of the floor that truly can be reached which truly was in sight from somewhere."""
    seen = np.any(np.stack(masks), axis=0)
    floor = _floor()
    return float((seen & floor).sum() / floor.sum())


@lru_cache(maxsize=1)
def _grid() -> GridMap:
    return unexplored(site(), map_version="site-1")


@lru_cache(maxsize=1)
def _middles() -> NDArray[np.float64]:
    grid = _grid()
    xs = grid.origin_m[0] + (np.arange(grid.columns) + 0.5) * grid.cell_m
    ys = grid.origin_m[1] + (np.arange(grid.rows) + 0.5) * grid.cell_m
    return np.stack(np.meshgrid(xs, ys), axis=-1)


@lru_cache(maxsize=1)
def _floor() -> Mask:
    """Cells of the zones on which nothing stands, and which are joined with the body's home."""
    plan, middles = FloorPlan(storage_site()), _middles()
    flat = middles.reshape(-1, 2)
    zones = np.any([depth(flat, zone.region_m) > 0.0 for zone in site().zones], axis=0)
    free = np.array([plan.clearance(float(x), float(y)) > 0.0 for x, y in flat])
    parts, _ = ndimage.label((free & _near_zones(flat)).reshape(middles.shape[:2]))
    home = np.argmin(np.hypot(flat[:, 0], flat[:, 1]))
    return np.asarray((parts == parts.reshape(-1)[home]) & zones.reshape(middles.shape[:2]))


def _near_zones(flat: NDArray[np.float64]) -> Mask:
    return np.asarray(np.any([depth(flat, zone.region_m) > -0.3 for zone in site().zones], axis=0))


def _view(chance: Random, place: tuple[float, float], seed: int) -> VisibleCells:
    at = (place[0] + chance.uniform(-0.15, 0.15), place[1] + chance.uniform(-0.1, 0.1), chance.uniform(-3.1, 3.1))
    run = executed(OBSERVER, {"duration_s": 1.2}, at=at, seed=seed, after_s=0.3, request=f"r-{seed}")
    x, y, _ = run.true_at(run.until_s)
    turns = np.linspace(-math.pi, math.pi, RAYS, endpoint=False)
    ranges = FloorPlan(storage_site()).rays(x, y, turns, reach_m=LIDAR_REACH_M)
    off = _middles() - np.array([x, y])
    ray = np.floor((np.arctan2(off[..., 1], off[..., 0]) + math.pi) / math.tau * RAYS + 0.5).astype(int) % RAYS
    return VisibleCells(run, np.asarray(np.hypot(off[..., 0], off[..., 1]) <= ranges[ray]))


def _target_share(chance: Random, share: float) -> float:
    kinds = (chance.uniform(share + 0.06, 1.0) if share < 0.93 else 0.97, max(0.02, share - chance.uniform(0.06, 0.5)))
    return min(1.0, chance.choice((*kinds, 0.95)))


def _drawn(
    name: str, stood: Sequence[VisibleCells], chance: Random, pool: Sequence[VisibleCells]
) -> tuple[GridMap, dict[Digest, bytes]]:
    """The map that the shipped code draws of these stands' sweeps."""
    blobs: dict[Digest, bytes] = {}
    if name == "map of another exploration":
        stood = pool
    shift = (chance.uniform(0.3, 1.5), chance.uniform(-1.5, 1.5)) if name == FORGED[1] else (0.0, 0.0)
    tracks = []
    for one in stood:
        run = one.run
        blobs |= run.blobs
        track = run.between(run.from_s - 1.0, run.until_s)
        tracks.append(_faulty(name, track, blobs, chance, shift))
    grid = _grid()
    return merged(grid, usable(grid, tracks, stored=blobs.__contains__), blobs.__getitem__), blobs


def _faulty(
    name: str, track: Trajectory, blobs: dict[Digest, bytes], chance: Random, shift: tuple[float, float]
) -> Trajectory:
    match name:
        case "lidar drops out" if chance.random() < 0.5:
            return replace(track, scans=())
        case "localiser drops out" if chance.random() < 0.5:
            return replace(track, poses=())
        case "sweeps while turning" if chance.random() < 0.5:
            return replace(track, odometry=tuple(replace(one, w_radps=0.5) for one in track.odometry))
        case "headings wrong":
            off = chance.gauss(0.0, 0.15)
            return replace(track, poses=tuple(replace(one, yaw_rad=one.yaw_rad + off) for one in track.poses))
        case "half of each sweep" | "sweeps mirrored":
            return replace(track, scans=tuple(_changed(name, one, blobs) for one in track.scans))
        case _:
            moved = tuple(replace(one, x_m=one.x_m + shift[0], y_m=one.y_m + shift[1]) for one in track.poses)
            return replace(track, poses=moved)


def _changed(name: str, scan: Scan, blobs: dict[Digest, bytes]) -> Scan:
    points = np.frombuffer(blobs[scan.blob], dtype="<f4").reshape(-1, 3).copy()
    if name == "half of each sweep":
        points = points[::2][: len(points) // 4]
    else:
        points[:, 1] *= -1.0
    body = np.ascontiguousarray(points).tobytes()
    blobs[sha256(body)] = body
    return replace(scan, blob=sha256(body), points=len(points))
