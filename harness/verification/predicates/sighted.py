"""visual sighted: a provider's image analysis, with a checksummed result, measured something in the pictures.

No pixel is read here: the report names frames and boxes, and its frames' own headers bound them.
"""

import msgspec

from harness.contracts.effects import AnyEffect, Visual
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.media import image_size
from harness.verification.reading import Evidence


class _Box(msgspec.Struct, frozen=True):
    frame: Digest
    box_px: tuple[int, int, int, int]


class _Report(msgspec.Struct, frozen=True):
    frames: tuple[Digest, ...]
    findings: tuple[_Box, ...]


def sighted(effect: AnyEffect, evidence: Evidence) -> Finding:
    """At least `frames` accepted pictures of the wanted size hold a finding whose box lies within the picture."""
    if not isinstance(effect, Visual):
        raise Undecidable(because("effect_not_testable", predicate="sighted"))
    digest = next((one.blob for one in reversed(evidence.receipts) if one.kind == "analysis" and one.blob), None)
    if digest is None:
        return ambiguous(because("no_analysis_receipt"))
    report = evidence.decoded(digest, _Report)
    accepted = set(evidence.fact("panorama").arguments["frames"])
    strangers = {one.frame for one in report.findings} - (accepted & set(report.frames))
    if strangers:
        return ambiguous(because("findings_in_unaccepted_pictures", findings=len(strangers)))
    frames = {one.frame for one in report.findings if _within(one, effect, evidence)}
    beyond = {one.frame for one in report.findings} - frames
    if beyond:
        return ambiguous(because("pictures_do_not_hold_box", pictures=len(beyond)))
    return Finding(
        verdict="satisfied" if len(frames) >= effect.frames else "violated",
        reason=because(
            "findings_in_pictures", findings=len(report.findings), pictures=len(frames), wanted=effect.frames
        ),
        measured={"pictures": float(len(frames)), "findings": float(len(report.findings))},
        bounds={"pictures": float(effect.frames)},
        sources=(RECEIPTS,),
        evidence=(digest, *sorted(frames)),
    )


def _within(found: _Box, effect: Visual, evidence: Evidence) -> bool:
    width, height = image_size(evidence.bytes_of(found.frame))
    x, y, wide, high = found.box_px
    large = width >= effect.width_px and height >= effect.height_px
    return large and wide > 0 and high > 0 and x >= 0 and y >= 0 and x + wide <= width and y + high <= height
