"""Cases of passage_checked: things drawn into the passage, lidar sweeps of them, and reports that tell of them or not.

A part of the scenes is rendered and analysed by the shipped analyser. For the others a report is drawn from the truth
with an analyser's errors; their sweeps come from the simulated lidar all the same.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

import cv2
import numpy as np
from msgspec.structs import replace

from experiments.verifier.cases import (
    VerifierCase,
    condition_id_of,
    fact,
    identity_of,
    packet_of,
    shown_packet,
    stage,
    with_packet,
)
from experiments.verifier.executions import SimulatedExecution, executed
from harness.adapters.pictures import looked_at
from harness.adapters.providers.lidar import PassageSweep
from harness.adapters.providers.models.analysis import CARD as ANALYST
from harness.adapters.providers.models.passage import FloorObject, OrientedFrame, Report, analyse
from harness.contracts.effects import Relational
from harness.contracts.evidence import CommittedFact, EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest, NodeId, sha256
from harness.contracts.measurements import (
    EXAMINATION,
    LOOK_PX,
    LidarLook,
    Measurement,
    PictureExamination,
    PictureLook,
)
from harness.contracts.observations import Pose
from harness.contracts.protocol import Receipt
from harness.contracts.values import Point, encode
from simulator.bodies import LIDAR_REACH_M
from simulator.camera import CAMERA, render
from simulator.cards import OBSERVER
from simulator.floor_plan import FloorPlan
from simulator.picture_cache import COARSE, photograph_nearby
from simulator.site import BLUE, CARDBOARD, PASSAGE_M, TROLLEY, storage_site
from simulator.solids import SiteModel, Solid

STANDS = (11.0, 8.557)
PANORAMA = NodeId("panorama")
AHEAD_RAD = (math.pi / 4, math.pi / 2, 3 * math.pi / 4)
AGREES, DISAGREES = 0.10, 0.18
LEAST_M = 0.07
RAYS = 1440
Truth = bool | None


@dataclass(frozen=True)
class PassageScene:
    """What truly stands in the passage, a look at it, its frames, and an analysis of them."""

    model: SiteModel
    things: tuple[Solid, ...]
    look: SimulatedExecution
    frames: tuple[Digest, ...]
    looks: tuple[PictureLook, ...]
    headings: tuple[float, ...]
    report: Report
    rendered: bool
    hidden: bool

    def share(self) -> float:
        """The share of the passage's width that truly is taken, as it is seen from where the body stands."""
        return true_share(self.things, self.look.true_at(self.look.until_s)[:2])

    def visible_share(self) -> float:
        """The share of it that is taken by what truly can be seen: one thing may stand in the shadow of another."""
        x, y, _ = self.look.true_at(self.look.until_s)
        turns = np.linspace(-math.pi, math.pi, RAYS, endpoint=False)
        ranges = FloorPlan(self.model).rays(x, y, turns, reach_m=LIDAR_REACH_M)
        hits = np.stack([x + ranges * np.cos(turns), y + ranges * np.sin(turns)], axis=1)
        low, high = np.array(PASSAGE_M).min(axis=0), np.array(PASSAGE_M).max(axis=0)
        hits = hits[((hits >= low) & (hits <= high)).all(axis=1)]
        across, width_m = _across((x, y))
        seen = [hits[_beside(hits, one)] @ across for one in self.things]
        return _union([(float(part.min()), float(part.max())) for part in seen if len(part)]) / width_m


def scenes(seed: int, *, rendered: int, drawn: int) -> tuple[PassageScene, ...]:
    """So many scenes whose pictures are rendered and analysed, and so many whose report is drawn from the truth."""
    chance = Random(seed)
    return tuple(_scene(chance, seed + index, rendered=index < rendered) for index in range(rendered + drawn))


def passages(chance: Random, count: int, pool: Sequence[PassageScene]) -> Iterator[VerifierCase]:
    """passage_checked with honest and with wrong reports, on sweeps that are right, wrong, old or missing."""
    effect = Relational(
        predicate="passage_checked",
        relation="analysis_of",
        subject="stage",
        object="panorama",
        frame="map",
        map_version="site-1",
        region_m=PASSAGE_M,
    )
    for _ in range(count):
        scene = chance.choice(pool)
        name = chance.choice(tuple(REPORTS) + tuple(SWEEPS) + ("none", "none", BOTH, BIASED))
        other = chance.choice([one for one in pool if one is not scene])
        report, look, blobs = scene.report, _look(scene.look), dict[Digest, bytes]()
        if name in REPORTS:
            report = REPORTS[name](report, other, chance)
        if name == BOTH:
            report, look = _renamed(other.report, scene), _moved_to(_look(other.look), look)
        if name == BIASED:
            report, look = _biased(scene, look, chance)
        source, blobs = _swept(name, look, scene, other, chance)
        answer = _distorted_report(name, report, scene, other)
        digest = sha256(encode(answer))
        blobs[digest] = encode(answer)
        node = stage(effect, mandatory=("receipts",))
        from_s = scene.look.from_s
        receipt = Receipt(
            receipt_id="analysis-1",
            kind="analysis",
            at_s=scene.look.until_s,
            source="opencv-analysis",
            request_id=identity_of(ANALYST).request_id,
            blob=digest,
        )
        packet = packet_of(
            node,
            ANALYST,
            from_s=from_s,
            until_s=scene.look.until_s,
            after=source,
            receipts=() if name == "report missing" else (receipt,),
        )
        inputs = shown_packet(node, packet, ANALYST, blobs, facts=(_panorama(scene, look, name),))
        inputs = with_packet(inputs, stage(node_id=PANORAMA), _photographed(scene, blobs))
        truth = _true(answer, scene)
        yield VerifierCase(
            "passage_checked", name, truth, inputs, condition_id_of(effect), epistemic=name in (BOTH, BIASED)
        )


def true_share(things: Sequence[Solid], position: Point) -> float:
    """The share of the passage's width that these things truly take, seen from a position."""
    across, width_m = _across(position)
    taken = [_clipped(one) @ across for one in things if _stands_in(one)]
    return _union([(float(part.min()), float(part.max())) for part in taken]) / width_m


def _true(report: Report, scene: PassageScene) -> Truth:
    """Whether the report says of the passage what is so: clear or not, and how much of its width is taken."""
    inside = [one for one in scene.things if _stands_in(one)]
    border = any(_overlap(one) is None for one in scene.things)
    if report.frames != scene.frames or (report.passage and report.passage != PASSAGE_M):
        return False
    if report.blocked != bool(inside):
        return None if border else False
    if not inside:
        return None if border else True
    share = _share_at(report, scene.look.true_at(scene.look.until_s)[:2])
    apart = max(0.0, scene.visible_share() - share, share - scene.share())
    return False if apart > DISAGREES else None if apart > AGREES or border else True


def _share_at(report: Report, position: Point) -> float:
    """The share of the passage's width that a report says is taken."""
    across, width_m = _across(position)
    middles = [(float(np.array(one.floor_point_m) @ across), one.width_m / 2) for one in report.findings]
    return min(1.0, _union([(middle - half, middle + half) for middle, half in middles]) / width_m)


def _across(position: Point) -> tuple[Any, float]:
    """The unit vector across the passage as it is seen from a position, and how wide it is so, metres."""
    ring = np.array(PASSAGE_M)
    ahead = ring.mean(axis=0) - np.array(position)
    across = np.array([-ahead[1], ahead[0]]) / float(np.hypot(*ahead))
    return across, float(np.ptp(ring @ across))


def _union(intervals: Sequence[tuple[float, float]]) -> float:
    total, end = 0.0, -math.inf
    for low, high in sorted(intervals):
        total += max(0.0, high - max(low, end))
        end = max(end, high)
    return total


def _beside(points: Any, thing: Solid) -> Any:
    """Which points lie on a thing's footprint or within two centimetres of it."""
    cos, sin = math.cos(thing.yaw_rad), math.sin(thing.yaw_rad)
    off = (points - np.array(thing.centre_m[:2])) @ np.array([[cos, -sin], [sin, cos]])
    return (np.abs(off) <= np.array(thing.half_m[:2]) + 0.02).all(axis=1)


def _scene(chance: Random, seed: int, *, rendered: bool) -> PassageScene:
    base = storage_site()
    things = tuple(_thing(chance, index) for index in range(chance.choice((0, 0, 1, 1, 2))))
    hidden = chance.random() < 0.12
    solids = tuple(one for one in base.solids if not one.name.startswith("box-passage"))
    model = replace(base, solids=(*solids, *things, *((TROLLEY,) if hidden else ())))
    x, y = STANDS[0] + chance.uniform(-0.25, 0.25), STANDS[1] + chance.uniform(-0.2, 0.15)
    look = executed(
        OBSERVER, {"duration_s": 3.0}, at=(x, y, math.pi / 2), seed=seed, site=model, after_s=0.5, request=f"r-{seed}"
    )
    position = _measured(look)
    if rendered:
        bodies = [photograph_nearby(model, (x, y, heading), key="") for heading in AHEAD_RAD]
        frames = tuple(map(sha256, bodies))
        looks = tuple(looked_at(digest, body) for digest, body in zip(frames, bodies, strict=True))
        pictures = [
            OrientedFrame(digest=digest, heading_rad=heading, pixels=_pixels(body))
            for digest, heading, body in zip(frames, AHEAD_RAD, bodies, strict=True)
        ]
        report = analyse(pictures, camera=CAMERA, position=position, passage=PASSAGE_M)
    else:
        frames = tuple(sha256(f"{seed} {index}".encode()) for index in range(len(AHEAD_RAD)))
        looks = tuple(_glance(model, (x, y, turn), name) for turn, name in zip(AHEAD_RAD, frames, strict=True))
        report = _drawn(chance, things, frames, position, hidden=hidden)
    return PassageScene(model, things, look, frames, looks, AHEAD_RAD, report, rendered, hidden)


def _glance(model: SiteModel, pose: tuple[float, float, float], name: Digest) -> PictureLook:
    """What is compared of a picture that is not stored, of few rays."""
    grey = cv2.cvtColor(render(model, pose, COARSE, grain=False), cv2.COLOR_RGB2GRAY)
    small = cv2.resize(grey, LOOK_PX, interpolation=cv2.INTER_AREA)
    return PictureLook(image=name, width_px=CAMERA.width_px, height_px=CAMERA.height_px, grey=small.tobytes())


def _thing(chance: Random, index: int) -> Solid:
    width, depth_m, height = chance.uniform(0.12, 0.9), chance.uniform(0.2, 0.6), chance.uniform(0.35, 1.0)
    centre = (chance.uniform(10.2, 11.8), chance.uniform(10.0, 12.0), height / 2)
    return Solid(
        name=f"thing-{index}",
        kind="box",
        centre_m=centre,
        half_m=(width / 2, depth_m / 2, height / 2),
        rgb=chance.choice((CARDBOARD, BLUE)),
        yaw_rad=chance.choice((0.0, 0.0, chance.uniform(-0.5, 0.5))),
    )


def _drawn(
    chance: Random, things: Sequence[Solid], frames: tuple[Digest, ...], position: Point, *, hidden: bool
) -> Report:
    """A report drawn from the truth as an analyser makes it: widths off by 3 cm, now and then a thing missed."""
    found = []
    for one in things:
        if not _stands_in(one) or chance.random() < 0.05:
            continue
        corners = _clipped(one)
        width = float(np.ptp(corners[:, 0])) + chance.gauss(0.0, 0.03)
        middle = (float(corners[:, 0].mean()) + chance.gauss(0.0, 0.03), float(corners[:, 1].min()))
        found.append(_object(frames[1], middle, max(0.08, width)))
    return _report(frames, found)


def _object(frame: Digest, at: Point, width_m: float) -> FloorObject:
    return FloorObject(
        frame=frame,
        kind="obstruction",
        box_px=(400, 300, 200, 150),
        floor_point_m=(round(at[0], 3), round(at[1], 3)),
        width_m=round(width_m, 3),
        height_m=0.5,
        share_of_passage=round(min(1.0, width_m / 1.4), 3),
    )


def _report(frames: tuple[Digest, ...], found: Sequence[FloorObject]) -> Report:
    return Report(
        method="drawn",
        frames=frames,
        cited=tuple(dict.fromkeys(one.frame for one in found)),
        findings=tuple(found),
        blocked=bool(found),
        in_view=1.0,
        frames_with_passage=len(frames),
        text="",
        passage=PASSAGE_M,
    )


def _inverted(report: Report, other: PassageScene, chance: Random) -> Report:
    """The contrary of what was found."""
    if report.blocked:
        return replace(report, findings=(), cited=(), blocked=False)
    return _imagined(report, other, chance)


def _imagined(report: Report, other: PassageScene, chance: Random) -> Report:
    """One thing more than was found."""
    at = (chance.uniform(10.4, 11.6), chance.uniform(10.4, 11.8))
    found = (*report.findings, _object(report.frames[1], at, chance.uniform(0.3, 0.9)))
    return replace(report, findings=found, cited=(report.frames[1],), blocked=True)


def _resized(report: Report, other: PassageScene, chance: Random) -> Report:
    """Things of other sizes."""
    times = chance.choice((0.3, 0.5, 1.6, 2.5))
    found = tuple(replace(one, width_m=one.width_m * times) for one in report.findings)
    return replace(report, findings=found)


def _of_other_floor(report: Report, other: PassageScene, chance: Random) -> Report:
    """Another polygon was analysed."""
    shift = chance.uniform(0.3, 2.0)
    return replace(report, passage=tuple((x + shift, y) for x, y in PASSAGE_M))


def _forgetting(report: Report, other: PassageScene, chance: Random) -> Report:
    """A frame was left out."""
    return replace(report, frames=report.frames[:-1])


def _citing(report: Report, other: PassageScene, chance: Random) -> Report:
    """A frame of elsewhere is cited."""
    return replace(report, cited=(*report.cited, other.frames[0]))


def _missing_one(report: Report, other: PassageScene, chance: Random) -> Report:
    """One of the things is left out."""
    found = report.findings[1:]
    return replace(report, findings=found, cited=tuple({one.frame for one in found}), blocked=bool(found))


REPORTS: dict[str, Callable[[Report, PassageScene, Random], Report]] = {
    "report says the contrary": _inverted,
    "report adds a thing": _imagined,
    "report of other sizes": _resized,
    "report of another floor": _of_other_floor,
    "report leaves out a frame": _forgetting,
    "report cites a foreign frame": _citing,
    "report leaves out a thing": _missing_one,
}
SWEEPS = (
    "report of another scene",
    "report missing",
    "no sweep",
    "sweep of another time",
    "sweep of another map",
    "sweep altered",
    "sweep cut short",
    "sweep of another scene, freshly stamped",
    "frames of other headings",
)
BOTH = "report and sweep of another scene, freshly stamped"
BIASED = "localiser biased: sweep and analysis are off by the same"


def _distorted_report(name: str, report: Report, scene: PassageScene, other: PassageScene) -> Report:
    return _renamed(other.report, scene) if name == "report of another scene" else report


def _renamed(report: Report, scene: PassageScene) -> Report:
    """A report whose frames carry the names of this scene's."""
    named = dict(zip(report.frames, scene.frames, strict=True))
    found = tuple(replace(one, frame=named[one.frame]) for one in report.findings)
    return replace(report, frames=scene.frames, cited=tuple(named[one] for one in report.cited), findings=found)


def _look(run: SimulatedExecution) -> LidarLook:
    return LidarLook(trajectory=run.between(run.until_s - 4.0, run.until_s), camera=run.status.camera)


def _moved_to(other: LidarLook, look: LidarLook) -> LidarLook:
    """Another scene's sweeps with this one's stamps."""
    shift = look.trajectory.odometry[-1].at_s - other.trajectory.odometry[-1].at_s
    track = other.trajectory
    return replace(
        other,
        trajectory=replace(
            track,
            poses=tuple(replace(one, at_s=one.at_s + shift) for one in track.poses),
            odometry=tuple(replace(one, at_s=one.at_s + shift) for one in track.odometry),
            scans=tuple(replace(one, at_s=one.at_s + shift) for one in track.scans),
        ),
    )


def _biased(scene: PassageScene, look: LidarLook, chance: Random) -> tuple[Report, LidarLook]:
    """What both see is taken to stand elsewhere by the same vector."""
    angle, off_m = chance.uniform(-math.pi, math.pi), chance.uniform(0.3, 1.0)
    dx, dy = off_m * math.cos(angle), off_m * math.sin(angle)
    shifted = tuple(
        replace(one, centre_m=(one.centre_m[0] + dx, one.centre_m[1] + dy, one.centre_m[2])) for one in scene.things
    )
    poses = tuple(_shifted(one, dx, dy) for one in look.trajectory.poses)
    x, y = _measured(scene.look)
    report = _drawn(chance, shifted, scene.frames, (x + dx, y + dy), hidden=scene.hidden)
    return report, replace(look, trajectory=replace(look.trajectory, poses=poses))


def _shifted(pose: Pose, dx: float, dy: float) -> Pose:
    return replace(pose, x_m=pose.x_m + dx, y_m=pose.y_m + dy)


def _swept(
    name: str, look: LidarLook, scene: PassageScene, other: PassageScene, chance: Random
) -> tuple[tuple[EvidenceReference, ...], dict[Digest, bytes]]:
    """The lidar's part of the packet, taken by the shipped source from the robot's samples."""
    blobs = {**scene.look.blobs, **other.look.blobs}
    if name == "sweep of another scene, freshly stamped":
        look = _moved_to(_look(other.look), look)
    if name == "sweep of another time":
        back_s = chance.uniform(20.0, 400.0)
        track = look.trajectory
        look = replace(
            look,
            trajectory=replace(track, scans=tuple(replace(one, at_s=one.at_s - back_s) for one in track.scans)),
        )

    def keep(body: bytes) -> Digest:
        digest = sha256(body)
        blobs[digest] = body
        return digest

    track = look.trajectory
    measurement = Measurement(
        requests=(),
        text="",
        from_s=scene.look.from_s,
        until_s=scene.look.until_s,
        samples=(*track.poses, *track.odometry, *track.scans),
        status=scene.look.status,
    )
    found = PassageSweep(keep=keep).measure(measurement)
    if name == "sweep of another time":
        found = tuple(replace(one, blob=keep(encode(look))) for one in found or _stale(scene, look, keep))
    if name == "no sweep":
        found = ()
    if name == "sweep of another map":
        found = tuple(replace(one, map_version="site-0") for one in found)
    if name in ("sweep altered", "sweep cut short"):
        newest = track.scans[-1].blob
        short = blobs[newest][:-12]
        blobs[newest] = short if name == "sweep altered" else blobs[newest]
        if name == "sweep cut short":
            cut = replace(track, scans=tuple(replace(one, blob=keep(blobs[one.blob][:-24])) for one in track.scans))
            found = tuple(replace(one, blob=keep(encode(replace(look, trajectory=cut)))) for one in found)
    return found, blobs


def _stale(scene: PassageScene, look: LidarLook, keep: Callable[[bytes], Digest]) -> tuple[EvidenceReference, ...]:
    """A source that gives out sweeps of another time as its newest."""
    return (
        EvidenceReference(
            kind="sweep",
            origin="sensor",
            source="lidar",
            from_s=scene.look.until_s - 1.0,
            until_s=scene.look.until_s,
            confidence=1.0,
            blob=keep(encode(look)),
            frame="map",
            map_version="site-1",
        ),
    )


def _photographed(scene: PassageScene, blobs: dict[Digest, bytes]) -> EvidencePacket:
    """The packet of the accepted frames, whose bytes the harness examined when it recorded them."""
    examination = encode(PictureExamination(looks=scene.looks, camera=CAMERA))
    name = sha256(examination)
    blobs[name] = examination
    at_s = scene.look.from_s
    images = tuple(
        EvidenceReference(
            kind="image", origin="sensor", source="camera", from_s=at_s, until_s=at_s, confidence=1.0, blob=frame,
            values={EXAMINATION: name},
        )
        for frame in scene.frames
    )  # fmt: skip
    return packet_of(stage(node_id=PANORAMA), OBSERVER, from_s=at_s, until_s=at_s, after=images)


def _panorama(scene: PassageScene, look: LidarLook, name: str) -> CommittedFact:
    poses = look.trajectory.poses
    position = [float(np.median([one.x_m for one in poses])), float(np.median([one.y_m for one in poses]))]
    turn = math.pi if name == "frames of other headings" else 0.0
    arguments: dict[str, Any] = {
        "frames": list(scene.frames),
        "yaws_rad": [[float(index), heading + turn] for index, heading in enumerate(scene.headings)],
        "position": position,
        "heading_rad": scene.headings[-1],
    }
    return fact("panorama", PANORAMA, arguments)


def _measured(look: SimulatedExecution) -> Point:
    poses = look.between(look.from_s, look.until_s).poses
    return float(np.median([one.x_m for one in poses])), float(np.median([one.y_m for one in poses]))


def _pixels(body: bytes) -> Any:
    return np.asarray(cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_COLOR_RGB), dtype=np.uint8)


def _clipped(thing: Solid) -> Any:
    """The corners of the part of a thing that stands in the passage: its bounds, cut at the passage's."""
    low, high = np.array(PASSAGE_M).min(axis=0), np.array(PASSAGE_M).max(axis=0)
    dense = _outline(thing)
    inside = dense[((dense >= low) & (dense <= high)).all(axis=1)]
    return inside if len(inside) else np.zeros((1, 2))


def _outline(thing: Solid) -> Any:
    """Points on and within a thing's footprint, every few centimetres."""
    steps = np.linspace(-1.0, 1.0, 25)
    grid = np.stack(np.meshgrid(steps * thing.half_m[0], steps * thing.half_m[1]), axis=-1).reshape(-1, 2)
    cos, sin = math.cos(thing.yaw_rad), math.sin(thing.yaw_rad)
    turned = grid @ np.array([[cos, sin], [-sin, cos]])
    return turned + np.array(thing.centre_m[:2])


def _overlap(thing: Solid) -> bool | None:
    """Whether a thing stands in the passage; None where it only borders on it."""
    part = _clipped(thing)
    if len(part) < 2:
        return False
    return None if min(float(np.ptp(part[:, 0])), float(np.ptp(part[:, 1]))) < 2 * LEAST_M else True


def _stands_in(thing: Solid) -> bool:
    return _overlap(thing) is not False
