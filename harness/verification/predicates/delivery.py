"""symbolic delivered: acknowledged receipts for the text and for images that were analysed. No proof of a reader."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.protocol import Receipt
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence


def delivered(effect: AnyEffect, evidence: Evidence) -> Finding:
    """At least `arguments.images` images, each an analysed frame of the accepted panorama, and one text.

    Every item has its own receipt with an acknowledgement. `evidence` = the images, then the text.
    """
    if not isinstance(effect, Symbolic):
        raise Undecidable("delivered is a symbolic effect")
    wanted = _count(effect)
    analysed = set(evidence.fact("analysis_of").arguments["frames"])
    panorama = set(evidence.fact("panorama").arguments["frames"])
    receipts = [one for one in evidence.receipts if one.kind == "delivery" and one.blob]
    if not receipts:
        return ambiguous("no delivery receipt is among the evidence")
    images = tuple(dict.fromkeys(one.blob for one in receipts if one.blob in analysed and one.blob))
    others = tuple(dict.fromkeys(one.blob for one in receipts if one.blob not in analysed and one.blob))
    texts = [blob for blob in others if _is_text(evidence.bytes_of(blob))]
    problems = [f"{len(images)} of {wanted} analysed images were delivered"] if len(images) < wanted else []
    problems += [] if set(images) <= panorama else ["an image is not of the accepted panorama"]
    problems += [] if len(texts) == 1 else [f"{len(texts)} texts were delivered, not one"]
    problems += [f"{len(others) - len(texts)} items are of elsewhere"] if len(others) > len(texts) else []
    problems += _unacknowledged(receipts)
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason="; ".join(problems) or f"the channel acknowledged {len(images)} images and the text",
        measured={"images": float(len(images)), "texts": float(len(texts)), "receipts": float(len(receipts))},
        bounds={"images": float(wanted), "texts": 1.0},
        sources=(RECEIPTS,),
        evidence=(*images, *texts),
    )


def _count(effect: Symbolic) -> int:
    try:
        return int(effect.arguments["images"])
    except (KeyError, ValueError) as error:
        raise Undecidable(f"the condition does not say how many images: {error}") from error


def _unacknowledged(receipts: list[Receipt]) -> list[str]:
    silent = sum(not one.text for one in receipts)
    repeated = len(receipts) - len({one.receipt_id for one in receipts})
    problems = [f"{silent} items have no acknowledgement"] if silent else []
    return problems + ([f"{repeated} receipts came twice"] if repeated else [])


def _is_text(body: bytes) -> bool:
    try:
        return bool(body.decode().strip())
    except UnicodeDecodeError:
        return False
