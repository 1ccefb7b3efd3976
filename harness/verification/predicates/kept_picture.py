"""relational kept_picture: the archive holds the accepted picture, read back by the harness itself."""

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.reasons import because, several
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.media import image_size
from harness.verification.predicates.pictures import PictureReport
from harness.verification.reading import Evidence

SOURCE = "archive read path"


def kept_picture(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The certificate of `subject` names the accepted picture of `object`, whose bytes the archive gives back: their
    checksum and their size in pixels are computed anew. `evidence` = the picture, then the certificate.

    Of a goal the accepted fact of `subject` names the certificate, and the bytes are read once more.
    """
    if not isinstance(effect, Relational):
        raise Undecidable(because("effect_not_testable", predicate="kept_picture"))
    accepted = tuple(evidence.fact("pictured", node_id=effect.object).arguments["images"])
    digest = next((one.blob for one in reversed(evidence.receipts) if one.kind == "keeping" and one.blob), None)
    if digest is None:
        return ambiguous(because("no_picture_report"))
    certificate = evidence.decoded(digest, PictureReport)
    problems = (
        [] if (certificate.image,) == accepted else [because("report_of_another_picture", image=certificate.image[:12])]
    )
    width_px, height_px = image_size(evidence.bytes_of(accepted[0]))
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
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("picture_read_back", image=certificate.image[:12]),
        measured={"pictures": float(len(accepted)), "width_px": float(width_px), "height_px": float(height_px)},
        bounds={"pictures": 1.0},
        sources=(SOURCE,),
        evidence=(certificate.image, digest),
    )
