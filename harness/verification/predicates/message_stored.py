"""symbolic message_stored: the channel holds the message, read back by the harness's own client (D46).

It does not prove that anyone read it: sent and read stay apart.
"""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.evidence import CommittedFact, EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import ReadBack
from harness.contracts.reasons import Reason, because, several
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence


def message_stored(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The message as it was read back holds the text that was asked for, and at least `arguments.images` images, each
    a frame that the analysis covers.

    `arguments.channel` is the channel that it must have been read from. Of a goal, `arguments.delivery` names the
    stage: the message must be there still, with the same contents. `evidence` = the images, then the text.
    """
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="message_stored"))
    required = _count(effect)
    found = [(one, evidence.decoded(one.blob, ReadBack)) for one in evidence.measured("read_back")]
    found = _of_stage(found, evidence, effect.arguments["delivery"]) if "delivery" in effect.arguments else found
    if not found:
        return ambiguous(because("message_not_read_back"))
    reference, reading = found[-1]
    if reading.problem:
        return ambiguous(because("read_path_failed", problem=reading.problem))
    if "delivery" in effect.arguments:
        accepted = evidence.fact("message_stored", node_id=effect.arguments["delivery"])
        problems = _problems(reading, set(accepted.arguments["frames"]), required=required)
        problems += _changed(reading, accepted)
    else:
        problems = _problems(reading, _frames(evidence), required=required)
    asked = effect.arguments.get("channel", "").removeprefix("channel:")
    if asked and reading.channel != asked:
        problems.append(because("message_of_another_channel", channel=reading.channel or "-", asked=asked))
    own = {receipt.request_id for receipt in evidence.receipts}
    if own and reading.request_id not in own:
        problems.append(because("message_of_another_request"))
    text = (reading.text,) if reading.text else ()
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("message_read_back", images=len(reading.images)),
        measured={"images": float(len(reading.images)), "texts": float(len(text)), **_copies(reading)},
        bounds={"images": float(required), "texts": 1.0},
        sources=(reference.source,),
        evidence=(*reading.images, *text),
    )


def _copies(reading: ReadBack) -> dict[str, float]:
    """How many of the message are there, where there is more than one: it is delivered, and people see it twice."""
    return {"copies": float(reading.copies)} if isinstance(reading.copies, int) else {}


def _of_stage(
    found: list[tuple[EvidenceReference, ReadBack]], evidence: Evidence, stage: str
) -> list[tuple[EvidenceReference, ReadBack]]:
    """The readings of the message that this stage sent: a mission may send several."""
    sent = {request for node in evidence.nodes if node.node_id == stage for request in node.requests}
    return [one for one in found if one[1].request_id in sent]


def _frames(evidence: Evidence) -> set[Digest]:
    """The frames that the accepted analysis covers."""
    return set(evidence.newest_fact(("passage_checked", "analysis_of")).arguments["frames"])


def _problems(reading: ReadBack, analysed: set[Digest], *, required: int) -> list[Reason]:
    if not reading.found:
        return [because("message_not_found")]
    problems = [] if reading.text == reading.asked_text else [because("another_text_stored")]
    if len(set(reading.images)) < required:
        problems.append(because("too_few_images_stored", images=len(set(reading.images)), wanted=required))
    foreign = set(reading.images) - analysed
    return problems + ([because("stored_images_of_elsewhere", images=len(foreign))] if foreign else [])


def _changed(reading: ReadBack, fact: CommittedFact) -> list[Reason]:
    """What differs from the message that was accepted. A message that is gone is named already."""
    same = (list(reading.images), reading.text) == (fact.arguments["frames"], fact.arguments["text_digest"])
    return [] if same or not reading.found else [because("message_changed")]


def _count(effect: Symbolic) -> int:
    try:
        return int(effect.arguments["images"])
    except (KeyError, ValueError) as error:
        raise Undecidable(because("condition_without_image_count", error=str(error))) from error
