"""symbolic delivered: text and analysed images have acknowledged receipts. Does not prove that anyone read them."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import Reason, because, several
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence


def delivered(effect: AnyEffect, evidence: Evidence) -> Finding:
    """At least `arguments.images` images, each an analysed frame of the accepted panorama, and one text.

    Every item has its own receipt with an acknowledgement. `evidence` = the images, then the text.
    """
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="delivered"))
    required = _count(effect)
    analysed = set(evidence.newest_fact(("analysis_of", "passage_checked")).arguments["frames"])
    panorama = set(evidence.fact("panorama").arguments["frames"])
    receipts = [one for one in evidence.receipts if one.kind == "delivery" and one.blob]
    if not receipts:
        return ambiguous(because("no_delivery_receipt"))
    images = tuple(dict.fromkeys(one.blob for one in receipts if one.blob in analysed and one.blob))
    others = tuple(dict.fromkeys(one.blob for one in receipts if one.blob not in analysed and one.blob))
    texts = [blob for blob in others if _is_text(evidence.bytes_of(blob))]
    problems = (
        [because("too_few_images_delivered", images=len(images), wanted=required)] if len(images) < required else []
    )
    problems += [] if set(images) <= panorama else [because("image_not_of_panorama")]
    problems += [] if len(texts) == 1 else [because("not_one_text_delivered", texts=len(texts))]
    problems += [because("items_of_elsewhere", items=len(others) - len(texts))] if len(others) > len(texts) else []
    problems += _unacknowledged(receipts)
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("channel_acknowledged", images=len(images)),
        measured={"images": float(len(images)), "texts": float(len(texts)), "receipts": float(len(receipts))},
        bounds={"images": float(required), "texts": 1.0},
        sources=(RECEIPTS,),
        evidence=(*images, *texts),
    )


def _count(effect: Symbolic) -> int:
    try:
        return int(effect.arguments["images"])
    except (KeyError, ValueError) as error:
        raise Undecidable(because("condition_without_image_count", error=str(error))) from error


def _unacknowledged(receipts: list[Receipt]) -> list[Reason]:
    silent = sum(not one.text for one in receipts)
    repeated = len(receipts) - len({one.receipt_id for one in receipts})
    problems = [because("items_unacknowledged", items=silent)] if silent else []
    return problems + ([because("receipts_repeated", receipts=repeated)] if repeated else [])


def _is_text(body: bytes) -> bool:
    try:
        return bool(body.decode().strip())
    except UnicodeDecodeError:
        return False
