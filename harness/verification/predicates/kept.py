"""relational kept: the certificate and the picture are in the evidence store, read back by the harness itself."""

import msgspec

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.ids import Digest
from harness.contracts.reasons import because, several
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.media import image_size
from harness.verification.reading import Evidence

EVIDENCE_STORE = "evidence store"
"""The source: the store's own read path, with every checksum computed again."""


class Certificate(msgspec.Struct, frozen=True):
    """What the keeper states of the picture: its checksum, its size in pixels and in bytes."""

    image: Digest
    width_px: int
    height_px: int
    size_bytes: int


def kept(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The store gives back a certificate of `subject` about the accepted picture of `object`, and that picture.

    `evidence` = the picture, then the certificate. Undecidable where the store does not give them back.
    """
    if not isinstance(effect, Relational):
        raise Undecidable(because("effect_not_testable", predicate="kept"))
    accepted = tuple(evidence.fact("pictured", node_id=effect.object).arguments["images"])
    digest = next((one.blob for one in reversed(evidence.receipts) if one.kind == "keeping" and one.blob), None)
    if digest is None:
        return ambiguous(because("no_picture_report"))
    certificate = evidence.decoded(digest, Certificate)
    body = evidence.bytes_of(accepted[0])
    width_px, height_px = image_size(body)
    problems = (
        [] if (certificate.image,) == accepted else [because("report_of_another_picture", image=certificate.image[:12])]
    )
    if (certificate.width_px, certificate.height_px) != (width_px, height_px):
        problems.append(
            because(
                "report_of_another_size",
                width_px=certificate.width_px,
                height_px=certificate.height_px,
                picture_width_px=width_px,
                picture_height_px=height_px,
            )
        )
    if certificate.size_bytes != len(body):
        problems.append(because("kept_of_another_length", stated=certificate.size_bytes, found=len(body)))
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("kept_and_read_back", image=accepted[0][:12], size_bytes=len(body)),
        measured={"bytes": float(len(body)), "width_px": float(width_px), "height_px": float(height_px)},
        bounds={"bytes": float(certificate.size_bytes)},
        sources=(EVIDENCE_STORE, RECEIPTS),
        evidence=(accepted[0], digest),
    )
