"""Cases of the predicates on headings and pictures: facing, panorama, pictured, sighted, shows.

Sweeps, frames and turns are those of the simulated robot; the truth is how it was turned, and what was taken when.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

import msgspec
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
)
from experiments.verifier.executions import SimulatedExecution, executed, receipts_for, reference_to
from harness.adapters.providers.models.analysis import CARD as ANALYST
from harness.adapters.providers.models.description import CARD as DESCRIBER
from harness.adapters.vision.content_check import SOURCE as PICTURE_READING
from harness.baseline.load import site
from harness.contracts.effects import Metric, Symbolic, Visual
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, RequestId, sha256
from harness.contracts.observations import Image, Scan, Trajectory
from harness.contracts.pictures import PictureInventory, ReadText
from harness.contracts.protocol import Receipt
from harness.contracts.values import encode
from harness.planning.binding import bind_place, bind_zone
from harness.supervisor.observations import image_reference
from simulator.cards import OBSERVER, PANORAMA_CAMERA
from simulator.site import CARDBOARD, storage_site
from simulator.solids import SiteModel, standing

WITHIN_RAD, HEADING_EDGE_RAD = 0.1745, math.radians(2.0)
FRAMES, SIZE = 8, (1280, 720)
STEP_RAD = math.tau / FRAMES
WIDEST, NARROWEST, GAP_EDGE_RAD = 1.5 * STEP_RAD, 0.5 * STEP_RAD, 0.06
TURNED_RAD = 0.05
HOME = bind_place("anchor_a", site=site())
WALLS = bind_zone(HOME, site=site()).region_m
Truth = bool | None


@dataclass(frozen=True)
class SimulatedLooks:
    """Simulated looks: stands near home, panoramas with as many turns as asked, and single pictures."""

    stands: tuple[SimulatedExecution, ...]
    panoramas: tuple[SimulatedExecution, ...]
    finer: tuple[SimulatedExecution, ...]
    pictures: tuple[SimulatedExecution, ...]

    @property
    def sweeps(self) -> int:
        return sum(len(one.scans) for one in self.stands)

    @property
    def images(self) -> int:
        return len({image.blob for run in (*self.panoramas, *self.finer, *self.pictures) for image in run.images})


def looks(seed: int, *, whole: bool) -> SimulatedLooks:
    """`whole`: the pool of the published campaign; else a few."""
    chance = Random(seed)
    stands = tuple(_stand(chance, seed + index) for index in range(160 if whole else 8))
    places = [(0.0, 0.0, 0.0), (11.0, 8.557, 1.57), (9.0, 4.8, 0.4)][: 3 if whole else 1]
    panoramas = tuple(
        executed(PANORAMA_CAMERA, {"frames": 8.0}, at=place, seed=seed + index) for index, place in enumerate(places)
    )
    finer = tuple(
        executed(PANORAMA_CAMERA, {"frames": 12.0}, at=place, seed=seed + index)
        for index, place in enumerate(places[: 2 if whole else 1])
    )
    spots = [(chance.uniform(8.6, 13.0), chance.uniform(6.6, 8.6), chance.uniform(-3.0, 3.0)) for _ in range(12)]
    pictures = tuple(
        executed(OBSERVER, {"duration_s": 2.0, "frames": 1.0}, at=spot, seed=seed + index)
        for index, spot in enumerate(spots[: 12 if whole else 3])
    )
    return SimulatedLooks(stands, panoramas, finer, pictures)


def headings(chance: Random, count: int, pool: SimulatedLooks) -> Iterator[VerifierCase]:
    """facing: twelve wanted headings for each sweep, so that most of a sweep's cost is shared."""
    each = 12
    for _ in range(max(1, count // each)):
        run = chance.choice(pool.stands)
        scan = chance.choice([one for one in run.scans if one.at_s >= run.from_s])
        until_s = scan.at_s + chance.uniform(0.0, 0.9)
        name = chance.choice(SWEEPS)
        if name == "body turns after the sweep":
            run = pool.panoramas[0]
            scan, until_s = _before_a_turn(run, chance)
        track = run.between(run.from_s, until_s)
        track, blobs = _swept(name, track, run, until_s, chance, pool)
        true_rad = run.true_at(until_s)[2]
        aims = [_aim(chance, true_rad) for _ in range(each)]
        effects = tuple(_facing(aim) for aim in aims)
        node = stage(*effects, mandatory=("trajectory",))
        node = replace(
            node,
            success_conditions=tuple(
                replace(one, condition_id=type(one.condition_id)(f"{one.condition_id}.{index}"))
                for index, one in enumerate(node.success_conditions)
            ),
        )
        trajectory = reference_to(track, blobs)
        packet = packet_of(node, OBSERVER, from_s=run.from_s, until_s=until_s, estimates=(trajectory,))
        inputs = shown_packet(node, packet, OBSERVER, blobs)
        for aim, one in zip(aims, node.success_conditions, strict=True):
            truth, forged = _faces(run.true_at(until_s)[2], aim), name in FORGED_SWEEPS
            yield VerifierCase("facing", name, truth, inputs, one.condition_id, epistemic=forged)


def _before_a_turn(run: SimulatedExecution, chance: Random) -> tuple[Scan, float]:
    """A sweep at rest, and an instant less than a second later at which the body turns."""
    turning = [
        float(at_s) for at_s in run.truth[:, 0] if run.from_s + 1.0 < at_s < run.terminal_s and _turn(run, at_s) > 0.3
    ]
    pairs = [(scan, at_s) for scan in run.scans for at_s in turning if 0.1 < at_s - scan.at_s < 0.95]
    return chance.choice([pair for pair in pairs if _turn(run, pair[0].at_s) < 0.02])


def circles(chance: Random, count: int, pool: SimulatedLooks) -> Iterator[VerifierCase]:
    """panorama: whole circles, and circles with frames or turns that are missing, repeated, blurred or of elsewhere."""
    effect = Visual(predicate="panorama", frames=FRAMES, width_px=SIZE[0], height_px=SIZE[1])
    for _ in range(count):
        name = chance.choice(tuple(CIRCLES))
        yield CIRCLES[name](name, effect, chance, pool)


def stills(chance: Random, count: int, pool: SimulatedLooks) -> Iterator[VerifierCase]:
    """pictured: one picture by a body at rest, or what passes for one."""
    for _ in range(count):
        run = chance.choice(pool.pictures)
        name = chance.choice(STILLS)
        needed = 2 if name == "fewer pictures than asked" else 1
        large = name == "larger picture asked than taken"
        effect = Visual(predicate="pictured", frames=needed, width_px=1920 if large else SIZE[0], height_px=SIZE[1])
        yield _still(name, effect, run, chance, pool)


def signs(chance: Random, count: int, pool: SimulatedLooks) -> Iterator[VerifierCase]:
    """shows: what a sign in the picture truly says, and what the harness's reading of the picture found."""
    for _ in range(count):
        yield _sign(chance.choice(SIGNS), chance, pool)


def findings(chance: Random, count: int, pool: SimulatedLooks) -> Iterator[VerifierCase]:
    """sighted: a provider's report names boxes in the frames; its word alone says that something is in them."""
    for _ in range(count):
        run = chance.choice(pool.panoramas)
        frames = [one.blob for one in run.images]
        blobs = dict(run.blobs)
        name = chance.choice(
            ("none", "nothing found", "box beyond the picture", "frames of elsewhere", "report altered", "invented box")
        )
        box = [chance.randint(0, 900), chance.randint(0, 500), chance.randint(40, 300), chance.randint(40, 200)]
        box = [box[0], box[1], 2000, 100] if name == "box beyond the picture" else box
        others = [one.blob for one in pool.pictures[0].images]
        shown_in = others if name == "frames of elsewhere" else frames[:1]
        answer = {
            "frames": frames,
            "findings": [] if name == "nothing found" else [{"frame": one, "box_px": box} for one in shown_in],
        }
        body = msgspec.json.encode(answer)
        digest = sha256(body)
        blobs[digest] = body + b" " if name == "report altered" else body
        effect = Visual(predicate="sighted", frames=1, width_px=SIZE[0], height_px=SIZE[1])
        node = stage(effect)
        receipt = _receipt("analysis", run.until_s, digest)
        packet = packet_of(node, ANALYST, from_s=run.until_s, until_s=run.until_s + 2.0, receipts=(receipt,))
        panorama = fact("panorama", "panorama", {"frames": frames})
        inputs = shown_packet(node, packet, ANALYST, blobs, facts=(panorama,))
        yield VerifierCase("sighted", name, name in ("none", "report altered"), inputs, condition_id_of(effect))


def _stand(chance: Random, seed: int) -> SimulatedExecution:
    """A body near home that stands, in an office with up to three things that stand around."""
    things = tuple(
        standing(
            f"thing-{index}",
            "box",
            (chance.uniform(0.9, 6.5), chance.uniform(-3.0, 3.0)),
            (chance.uniform(0.3, 1.2), chance.uniform(0.3, 1.2), 1.2),
            CARDBOARD,
        )
        for index in range(chance.randint(0, 3))
    )
    model: SiteModel = storage_site().with_solids(*things)
    at = (chance.uniform(-0.28, 0.28), chance.uniform(-0.28, 0.28), chance.uniform(-math.pi, math.pi))
    return executed(OBSERVER, {"duration_s": 2.0}, at=at, seed=seed, site=model, after_s=0.5)


def _swept(
    name: str, track: Trajectory, run: SimulatedExecution, until_s: float, chance: Random, pool: SimulatedLooks
) -> tuple[Trajectory, dict[Digest, bytes]]:
    blobs = dict(run.blobs)
    newest = track.scans[-1]
    points = np.frombuffer(blobs[newest.blob], dtype="<f4").reshape(-1, 3).copy()
    match name:
        case "older sweep":
            return replace(track, scans=(replace(newest, at_s=newest.at_s - chance.uniform(1.2, 4.0)),)), blobs
        case "mirrored sweep":
            points[:, 1] *= -1.0
        case "sweep of elsewhere":
            other = chance.choice(pool.panoramas)
            points = np.frombuffer(other.blobs[other.scans[0].blob], dtype="<f4").reshape(-1, 3)
        case "half of the sweep":
            points = points[: len(points) // 2]
        case "more range noise":
            points[:, :2] *= 1.0 + np.random.default_rng(chance.randrange(2**32)).normal(0, 0.02, (len(points), 1))
        case "sweep altered":
            blobs[newest.blob] = blobs[newest.blob][:-4] + b"\x00\x00\x80?"
            return replace(track, scans=(newest,)), blobs
        case "odometry missing":
            return replace(track, odometry=()), blobs
        case "sweep while turning":
            turning = tuple(replace(one, w_radps=0.4) for one in track.odometry)
            return replace(track, odometry=turning), blobs
        case _:
            return track, blobs
    body = np.ascontiguousarray(points, dtype="<f4").tobytes()
    digest = sha256(body)
    blobs[digest] = body
    return replace(track, scans=(replace(newest, blob=digest, points=len(points)),)), blobs


def _aim(chance: Random, true_rad: float) -> float:
    kinds = ((0.0, 0.135), (0.22, 0.6), (0.6, math.pi))
    off = chance.uniform(*chance.choices(kinds, weights=(5, 2, 3))[0]) * chance.choice((-1.0, 1.0))
    return math.remainder(true_rad + off, math.tau)


def _facing(aim: float) -> Metric:
    return Metric(
        predicate="facing",
        frame="map",
        map_version="site-1",
        target_m=HOME.approach_m,
        tolerance_m=0.4,
        route_m=WALLS,
        bounds={"heading_rad": aim, "within_rad": WITHIN_RAD},
    )


def _faces(true_rad: float, aim: float) -> Truth:
    off = abs(math.remainder(true_rad - aim, math.tau))
    return True if off < WITHIN_RAD - HEADING_EDGE_RAD else False if off > WITHIN_RAD + HEADING_EDGE_RAD else None


def _circle(
    name: str,
    effect: Visual,
    run: SimulatedExecution,
    *,
    keep: Sequence[int],
    truth: Truth,
    epistemic: bool = False,
    **changed: Any,
) -> VerifierCase:
    """A panorama's packet of these frames. `changed`: images, receipts, odometry, poses or blobs instead of its own."""
    card, node = PANORAMA_CAMERA, stage(effect, mandatory=("image", "receipts", "trajectory"))
    request = identity_of(card).request_id
    images: list[Image] = changed.get("images", [run.images[index] for index in keep])
    needed = {float(index) for index in keep}
    receipts = changed.get("receipts", [one for one in run.report.receipts if one.values.get("index") in needed])
    blobs = {**run.blobs, **changed.get("blobs", {})}
    track = replace(run.between(run.from_s - 0.5, run.until_s), **changed.get("track", {}))
    packet = packet_of(
        node,
        card,
        from_s=changed.get("from_s", run.from_s),
        until_s=run.until_s,
        estimates=(reference_to(track, blobs),),
        after=tuple(_image_reference(one, request) for one in images),
        receipts=receipts_for(receipts, request),
    )
    inputs = shown_packet(node, packet, card, blobs)
    return VerifierCase("panorama", name, truth, inputs, condition_id_of(effect), epistemic=epistemic)


def _image_reference(image: Image, request: RequestId) -> EvidenceReference:
    """A picture as that of the request that is judged, as its receipt is."""
    return image_reference(replace(image, request_id=request))


def _whole(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    return _circle(name, effect, chance.choice(pool.panoramas), keep=range(FRAMES), truth=True)


def _missing(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    keep = sorted(chance.sample(range(FRAMES), chance.randint(3, FRAMES - 1)))
    return _circle(name, effect, chance.choice(pool.panoramas), keep=keep, truth=False)


def _uneven(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """Eight of twelve headings, whose widest gap truly is two, three or more of those steps."""
    run = chance.choice(pool.finer)
    keep = sorted(chance.sample(range(12), FRAMES))
    return _circle(name, effect, run, keep=keep, truth=_round(run, keep))


def _turned_too_far(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """The feet slip in the turn: odometry counts half as much again, and the circle is not closed."""
    run = chance.choice(pool.finer)
    first = run.between(run.from_s - 0.5, run.until_s).odometry
    begin = first[0].yaw_rad
    unwound, last = [], begin
    for one in first:
        last += math.remainder(one.yaw_rad - last, math.tau)
        unwound.append(last)
    slipped = tuple(
        replace(one, yaw_rad=math.remainder(begin + 1.5 * (yaw - begin), math.tau))
        for one, yaw in zip(first, unwound, strict=True)
    )
    keep = range(FRAMES)
    return _circle(name, effect, run, keep=keep, truth=_round(run, keep), track={"odometry": slipped})


def _repeated(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """One frame's content stands for another: the camera hung."""
    run = chance.choice(pool.panoramas)
    images = list(run.images)
    at = chance.randrange(1, FRAMES)
    images[at] = replace(images[at], blob=images[at - 1].blob)
    receipts = [
        replace(one, blob=images[at - 1].blob) if one.kind == "capture" and one.values.get("index") == at else one
        for one in run.report.receipts
    ]
    return _circle(name, effect, run, keep=range(FRAMES), truth=False, images=images, receipts=receipts)


def _moving(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """The body crept while the frames were taken, as odometry and localiser say too."""
    run = chance.choice(pool.panoramas)
    speed = chance.choice((0.005, 0.05, 0.1, 0.3))
    track = run.between(run.from_s - 0.5, run.until_s)
    odometry = tuple(replace(one, x_m=one.x_m + speed * (one.at_s - run.from_s)) for one in track.odometry)
    poses = tuple(replace(one, x_m=one.x_m + speed * (one.at_s - run.from_s)) for one in track.poses)
    truth = speed < 0.012
    return _circle(name, effect, run, keep=range(FRAMES), truth=truth, track={"odometry": odometry, "poses": poses})


def _blurred(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """Frames that were taken earlier than they were, in the turn."""
    run = chance.choice(pool.panoramas)
    back_s = chance.uniform(1.6, 2.4)
    images = [replace(one, at_s=one.at_s - back_s) for one in run.images]
    receipts = [replace(one, at_s=one.at_s - back_s) if one.kind == "capture" else one for one in run.report.receipts]
    turned = min(_turn(run, one.at_s) for one in images)
    most = max(_turn(run, one.at_s) for one in images)
    truth: Truth = False if most > TURNED_RAD + 0.03 else True if turned < TURNED_RAD - 0.03 else None
    return _circle(name, effect, run, keep=range(FRAMES), truth=truth, images=images, receipts=receipts)


def _unsigned(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """A turn or a capture has no receipt."""
    run = chance.choice(pool.panoramas)
    gone = chance.randrange(len(run.report.receipts))
    receipts = [one for index, one in enumerate(run.report.receipts) if index != gone]
    return _circle(name, effect, run, keep=range(FRAMES), truth=True, receipts=receipts)


def _earlier(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """The frames are of an execution before the one that is judged."""
    run = chance.choice(pool.panoramas)
    return _circle(name, effect, run, keep=range(FRAMES), truth=False, from_s=run.terminal_s + 1.0)


def _cut_short(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """One frame's file ends in the middle."""
    run = chance.choice(pool.panoramas)
    at, images = chance.randrange(FRAMES), list(run.images)
    body = run.blobs[images[at].blob][: chance.randint(1000, 20000)]
    digest = sha256(body)
    old = images[at].blob
    images[at] = replace(images[at], blob=digest)
    receipts = [replace(one, blob=digest) if one.blob == old else one for one in run.report.receipts]
    return _circle(
        name, effect, run, keep=range(FRAMES), truth=False, images=images, receipts=receipts, blobs={digest: body}
    )


def _altered(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """One frame's bytes were changed after their checksum was recorded."""
    run = chance.choice(pool.panoramas)
    old = chance.choice(run.images).blob
    return _circle(name, effect, run, keep=range(FRAMES), truth=False, blobs={old: run.blobs[old] + b"\xff\xd9"})


def _unstamped(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """Odometry dropped out while frames were taken."""
    run = chance.choice(pool.panoramas)
    begin = chance.uniform(run.from_s, run.terminal_s)
    track = run.between(run.from_s - 0.5, run.until_s)
    odometry = tuple(one for one in track.odometry if not begin <= one.at_s <= begin + chance.uniform(2.0, 9.0))
    return _circle(name, effect, run, keep=range(FRAMES), truth=True, track={"odometry": odometry})


def _forged(name: str, effect: Visual, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """The camera gives out pictures of another place, with fresh stamps and receipts of its own."""
    run = chance.choice(pool.panoramas)
    others = [image.blob for other in (*pool.finer, *pool.pictures) for image in other.images]
    taken = chance.sample(list(dict.fromkeys(others)), FRAMES)
    images = [replace(one, blob=blob) for one, blob in zip(run.images, taken, strict=True)]
    new = {one.blob: blob for one, blob in zip(run.images, taken, strict=True)}
    receipts = [replace(one, blob=new.get(one.blob, one.blob)) if one.blob else one for one in run.report.receipts]
    blobs = {digest: body for other in (*pool.finer, *pool.pictures) for digest, body in other.blobs.items()}
    return _circle(
        name,
        effect,
        run,
        keep=range(FRAMES),
        truth=False,
        epistemic=True,
        images=images,
        receipts=receipts,
        blobs=blobs,
    )


MISREAD = "the reader finds a text that is not there"
SIGNS = (
    "none", "none", "sign says another text", "sign says a longer text", "no sign", "sign not read", "sign hardly read",
    "picture not read", "reading of another picture", "reading altered", "picture of another stage", MISREAD,
)  # fmt: skip
FORGED_SWEEPS = ("mirrored sweep", "sweep of elsewhere")
"""The lidar is the one source of a heading: what it forges consistently is seen by nothing that is asked."""
SWEEPS = (
    "none",
    "none",
    "older sweep",
    "mirrored sweep",
    "sweep of elsewhere",
    "half of the sweep",
    "sweep altered",
    "odometry missing",
    "more range noise",
    "sweep while turning",
    "body turns after the sweep",
)
CIRCLES = {
    "none": _whole,
    "frames missing": _missing,
    "headings uneven": _uneven,
    "feet slip in the turn: odometry counts half as much again": _turned_too_far,
    "one frame repeated": _repeated,
    "body creeps": _moving,
    "frames taken in the turn": _blurred,
    "a receipt missing": _unsigned,
    "frames of an earlier execution": _earlier,
    "a frame cut short": _cut_short,
    "a frame altered": _altered,
    "odometry drops out": _unstamped,
    "camera gives out other pictures, freshly stamped": _forged,
}
STILLS = (
    "none",
    "fewer pictures than asked",
    "larger picture asked than taken",
    "body moves during the look",
    "body turns during the look",
    "picture cut short",
    "picture altered",
    "no receipt",
    "no picture",
    "odometry missing",
    "camera gives out another picture, freshly stamped",
)


def _still(name: str, effect: Visual, run: SimulatedExecution, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    card, node = OBSERVER, stage(effect, mandatory=("image", "receipts", "trajectory"))
    request, blobs = identity_of(card).request_id, dict(run.blobs)
    image = run.images[0]
    receipts: Sequence[Receipt] = run.report.receipts
    track = run.between(run.from_s, run.until_s)
    truth, epistemic = name in ("none", "no receipt", "odometry missing", "no picture"), False
    start_s = run.from_s
    match name:
        case "body moves during the look":
            speed = chance.choice((0.002, 0.05, 0.2, 0.5))
            truth = speed < 0.004
            odometry = tuple(replace(one, x_m=one.x_m + speed * (one.at_s - start_s)) for one in track.odometry)
            track = replace(track, odometry=odometry)
        case "body turns during the look":
            rate = chance.choice((0.004, 0.05, 0.3))
            truth = rate < 0.01
            turned = tuple(replace(one, yaw_rad=one.yaw_rad + rate * (one.at_s - start_s)) for one in track.odometry)
            track = replace(track, odometry=turned)
        case "picture cut short" | "camera gives out another picture, freshly stamped":
            other = chance.choice([one for one in pool.pictures if one is not run])
            epistemic = name != "picture cut short"
            body = other.blobs[other.images[0].blob] if epistemic else blobs[image.blob][:4000]
            digest = sha256(body)
            blobs[digest] = body
            receipts = [replace(one, blob=digest) if one.blob == image.blob else one for one in receipts]
            image = replace(image, blob=digest)
        case "picture altered":
            blobs[image.blob] += b"\xff\xd9"
        case "no receipt":
            receipts = ()
        case "odometry missing":
            track = replace(track, odometry=())
        case _:
            pass
    packet = packet_of(
        node,
        card,
        from_s=run.from_s,
        until_s=run.until_s,
        estimates=(reference_to(track, blobs),),
        after=() if name == "no picture" else (_image_reference(image, request),),
        receipts=receipts_for(receipts, request),
    )
    truth = truth and name != "no picture"
    inputs = shown_packet(node, packet, card, blobs)
    return VerifierCase("pictured", name, truth, inputs, condition_id_of(effect), epistemic=epistemic)


def _sign(name: str, chance: Random, pool: SimulatedLooks) -> VerifierCase:
    """A picture with a sign as it truly is, and the record of its reading."""
    run, other = chance.sample(pool.pictures, 2)
    image, blobs = run.images[0].blob, {**run.blobs, **other.blobs}
    asked_text = f"{chance.choice('ABCD')}-{chance.randint(10, 99)}"
    written = {"sign says another text": f"E-{chance.randint(10, 99)}", "sign says a longer text": f"{asked_text}1"}
    written |= dict.fromkeys(("no sign", MISREAD), "")
    truly = written.get(name, asked_text)
    read = "" if name == "sign not read" else asked_text if name == MISREAD else truly
    score = chance.uniform(0.3, 0.75) if name == "sign hardly read" else chance.uniform(0.85, 1.0)
    lines = (ReadText(text=read, score=score, box_px=(40, 40, 120, 60)),) if read else ()
    about = other.images[0].blob if name == "reading of another picture" else image
    inventory = PictureInventory(image=about, width_px=SIZE[0], height_px=SIZE[1], objects=(), texts=lines, models=())
    body = encode(inventory)
    digest = sha256(body)
    blobs[digest] = body + b" " if name == "reading altered" else body
    reading = EvidenceReference(
        kind="content",
        origin="sensor",
        source=PICTURE_READING,
        from_s=run.until_s,
        until_s=run.until_s,
        confidence=1.0,
        blob=digest,
    )
    effect = Symbolic(predicate="shows", arguments={"picture": "capture", "kind": "text", "name": asked_text})
    node = stage(effect)
    receipt = _receipt("analysis", run.until_s, digest)
    after = () if name == "picture not read" else (reading,)
    packet = packet_of(node, DESCRIBER, from_s=run.until_s, until_s=run.until_s, receipts=(receipt,), after=after)
    taken = other.images[0].blob if name == "picture of another stage" else image
    pictured = fact("pictured", "capture", {"images": [taken]})
    inputs = shown_packet(node, packet, DESCRIBER, blobs, facts=(pictured,))
    truth = truly == asked_text and taken == image
    return VerifierCase("shows", name, truth, inputs, condition_id_of(effect), epistemic=name == MISREAD)


def _round(run: SimulatedExecution, keep: Sequence[int]) -> Truth:
    """Whether the true headings of these frames go around the circle."""
    yaws = sorted(run.true_at(run.images[index].at_s)[2] % math.tau for index in keep)
    gaps = [b - a for a, b in zip(yaws, [*yaws[1:], yaws[0] + math.tau], strict=True)]
    if max(gaps) > WIDEST + GAP_EDGE_RAD or min(gaps) < NARROWEST - GAP_EDGE_RAD:
        return False
    return True if max(gaps) < WIDEST - GAP_EDGE_RAD and min(gaps) > NARROWEST + GAP_EDGE_RAD else None


def _turn(run: SimulatedExecution, at_s: float) -> float:
    """How much the body truly turned in the second before an instant, radians."""
    now = run.true_at(at_s)[2]
    return max(abs(math.remainder(run.true_at(at_s - back)[2] - now, math.tau)) for back in (0.25, 0.5, 0.75, 1.0))


def _receipt(kind: Any, at_s: float, blob: Digest, **values: float) -> Receipt:
    return Receipt(
        receipt_id=f"{kind}-1",
        kind=kind,
        at_s=at_s,
        source="opencv-analysis",
        request_id=identity_of(ANALYST).request_id,
        blob=blob,
        values=values,
    )
