"""Predicates on one picture and its reports: visual pictured, relational same_image, relational one_image (R225)."""

import math
from collections.abc import Sequence

import msgspec

from harness.contracts.effects import AnyEffect, Relational, Visual
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.observations import Odometry
from harness.contracts.reasons import Reason, because, several
from harness.contracts.rules import LINEAGE
from harness.verification.body import LIMIT_M
from harness.verification.finding import FACTS, RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.media import image_size
from harness.verification.predicates.panorama import TURN_LIMIT_RAD
from harness.verification.reading import AdmittedTrack, Evidence, scope_of

KINDS = ("keeping", "analysis")
"""Receipts that may name a report about one picture."""


class PictureReport(msgspec.Struct, frozen=True):
    """What any report about one picture must hold: its checksum, and its size in pixels as the reporter read it."""

    image: Digest
    width_px: int
    height_px: int


def pictured(effect: AnyEffect, evidence: Evidence) -> Finding:
    """`frames` whole images of the wanted size with a capture receipt each, the body at rest through the look.

    Where a stage was looked at again, the images are those of the newest look, whose rest is tested: an earlier one may
    have been taken in motion. Rules 1 took all of them. `evidence` = the images in order of capture. measured: x_m, y_m
    where poses give them.
    """
    if not isinstance(effect, Visual):
        raise Undecidable(because("effect_not_testable", predicate="pictured"))
    receipts = {one.blob for one in evidence.receipts if one.kind == "capture"}
    images = [image for image in evidence.images if image.blob in receipts]
    if not images:
        return ambiguous(because("no_captured_image"), images=float(len(evidence.images)))
    track = next((one for one in reversed(evidence.tracks) if one.current), None)
    if track is None or not track.odometry:
        return ambiguous(because("no_odometry_during_look"), images=float(len(images)))
    images = list(_of_look(images, track, evidence))
    moved_m, turned_rad = _moved(track.odometry)
    problems = _small(images, effect, evidence)
    if len(images) < effect.frames:
        problems.append(because("too_few_images", images=len(images), wanted=effect.frames))
    if moved_m >= LIMIT_M or turned_rad >= TURN_LIMIT_RAD:
        problems.append(because("body_moved_during_look", moved_m=moved_m, turned_rad=turned_rad))
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("images_whole", images=len(images)),
        measured={"images": float(len(images)), "displacement_m": moved_m, "turn_rad": turned_rad, **_place(track)},
        bounds={"images": float(effect.frames), "displacement_m": LIMIT_M, "turn_rad": TURN_LIMIT_RAD},
        sources=("camera", "odometry", RECEIPTS),
        evidence=tuple(image.blob for image in images),
    )


def _of_look(
    images: Sequence[EvidenceReference], track: AdmittedTrack, evidence: Evidence
) -> Sequence[EvidenceReference]:
    """The images of the execution whose track this is; all of them where it took none itself."""
    if evidence.policy.rules < LINEAGE:
        return images
    return [image for image in images if image.from_s >= track.dispatched_s] or images


def same_image(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The report of `subject` is about the accepted picture of `object`: one checksum, and the size of its header.

    `evidence` = the picture, then the report.
    """
    if not isinstance(effect, Relational):
        raise Undecidable(because("effect_not_testable", predicate="same_image"))
    accepted = tuple(evidence.fact("pictured", node_id=effect.object).arguments["images"])
    digest = next((one.blob for one in reversed(evidence.receipts) if one.kind in KINDS and one.blob), None)
    if digest is None:
        return ambiguous(because("no_picture_report"))
    report = evidence.decoded(digest, PictureReport)
    problems = [] if (report.image,) == accepted else [because("report_of_another_picture", image=report.image[:12])]
    size = image_size(evidence.bytes_of(accepted[0]))
    if (report.width_px, report.height_px) != size:
        problems.append(
            because(
                "report_of_another_size",
                width_px=report.width_px,
                height_px=report.height_px,
                picture_width_px=size[0],
                picture_height_px=size[1],
            )
        )
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("report_of_accepted_picture", image=accepted[0][:12]),
        measured={"pictures": float(len(accepted)), "width_px": float(size[0]), "height_px": float(size[1])},
        bounds={"pictures": 1.0},
        sources=(RECEIPTS,),
        evidence=(accepted[0], digest),
    )


def one_image(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Every accepted stage names an image, and all of them the same one, whose bytes have that checksum still."""
    if not isinstance(effect, Relational):
        raise Undecidable(because("effect_not_testable", predicate="one_image"))
    named = {fact.node_id: tuple(fact.arguments["images"]) for fact in evidence.facts if "images" in fact.arguments}
    accepted = [node.node_id for node in evidence.nodes if scope_of(node.node_id) == evidence.scope]
    absent = [name for name in (effect.subject, effect.object) if name not in accepted]
    if absent:
        return ambiguous(because("not_accepted_yet", stages=tuple(absent)))
    silent = [name for name in accepted if name not in named]
    images = sorted({image for found in named.values() for image in found})
    problems = [because("names_no_image", stages=tuple(silent))] if silent else []
    problems += [because("not_one_image", images=len(images))] if len(images) != 1 else []
    for image in images:
        evidence.bytes_of(image)
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("stages_share_image", stages=len(named), image=images[0][:12]),
        measured={"stages": float(len(named)), "images": float(len(images))},
        bounds={"stages": float(len(accepted)), "images": 1.0},
        sources=(FACTS, RECEIPTS),
        evidence=tuple(images),
    )


def _small(images: Sequence[EvidenceReference], effect: Visual, evidence: Evidence) -> list[Reason]:
    sizes = [image_size(evidence.bytes_of(image.blob)) for image in images]
    small = sum(width < effect.width_px or height < effect.height_px for width, height in sizes)
    return (
        [because("images_too_small", images=small, width_px=effect.width_px, height_px=effect.height_px)]
        if small
        else []
    )


def _moved(odometry: Sequence[Odometry]) -> tuple[float, float]:
    """The farthest that odometry was from where the look began: metres, radians."""
    first = odometry[0]
    moved_m = max(math.hypot(one.x_m - first.x_m, one.y_m - first.y_m) for one in odometry)
    return moved_m, max(abs(math.remainder(one.yaw_rad - first.yaw_rad, math.tau)) for one in odometry)


def _place(track: AdmittedTrack) -> dict[str, float]:
    return {"x_m": track.poses[-1].x_m, "y_m": track.poses[-1].y_m} if track.poses else {}
