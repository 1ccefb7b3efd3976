"""symbolic shows: the accepted picture shows a sign with a text, or an object, by the harness's own reading of it."""

from collections.abc import Sequence

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.ids import NodeId
from harness.contracts.pictures import PictureInventory
from harness.contracts.reasons import because
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence

SOURCE = "picture reading"
LEAST_TEXT_SCORE = 0.8
LEAST_OBJECT_SCORE = 0.6
"""Above the threshold of a description: what is only likely there is no evidence that it is."""


def shows(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The picture of the stage `picture` holds the text or the object `name`, as detector or text reader find it.

    `kind` is text or object. The reading was made by the harness from the picture's own bytes, whatever the provider
    says of it. Below the least score it is ambiguous; a picture without it violates. `evidence` = picture, reading.
    measured: score of the best match, texts and objects found.
    """
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="shows"))
    kind, name = (str(effect.arguments.get(key, "")) for key in ("kind", "name"))
    if kind not in ("text", "object") or not name:
        raise Undecidable(because("effect_not_testable", predicate="shows"))
    found = evidence.measured("content")
    if not found:
        return ambiguous(because("picture_not_read"))
    content = evidence.decoded(found[-1].blob, PictureInventory)
    if content.image not in _pictures(NodeId(str(effect.arguments.get("picture", ""))), evidence):
        return ambiguous(because("reading_of_another_picture", image=content.image[:12]))
    scores = _text_scores(name, content) if kind == "text" else _object_scores(name, content)
    best, least = max(scores, default=0.0), LEAST_TEXT_SCORE if kind == "text" else LEAST_OBJECT_SCORE
    doubtful = because("picture_shows_it_doubtfully", name=name, score=best, least=least)
    return Finding(
        verdict="satisfied" if best >= least else "ambiguous" if scores else "violated",
        reason=because("picture_shows_it", name=name, score=best)
        if best >= least
        else doubtful
        if scores
        else because("picture_does_not_show_it", name=name),
        measured={"score": best, "texts": float(len(content.texts)), "objects": float(len(content.objects))},
        bounds={"score": least},
        sources=("camera", SOURCE),
        evidence=(content.image, found[-1].blob),
    )


def _pictures(node_id: NodeId, evidence: Evidence) -> frozenset[str]:
    """The captured images of this execution; of a goal, those of the accepted fact."""
    captured = {one.blob for one in evidence.receipts if one.kind == "capture"}
    own = {image.blob for image in evidence.images if image.blob in captured}
    facts = evidence.facts_of(node_id=node_id, names=("pictured",))
    accepted = {str(image) for fact in facts for image in fact.arguments["images"]}
    return frozenset(own | accepted)


def _text_scores(name: str, content: PictureInventory) -> list[float]:
    """Scores of the lines that hold the wanted words as whole words: B-12 is not in B-121."""
    wanted = _words(name)
    return [line.score for line in content.texts if _holds(_words(line.text), wanted)]


def _holds(words: Sequence[str], wanted: Sequence[str]) -> bool:
    if "".join(words) == "".join(wanted):
        return True
    return any(words[at : at + len(wanted)] == wanted for at in range(len(words) - len(wanted) + 1))


def _words(text: str) -> list[str]:
    """Letters and digits of each word, case ignored; a word without any is none."""
    words = ("".join(sign for sign in word.casefold() if sign.isalnum()) for word in text.split())
    return [word for word in words if word]


def _object_scores(name: str, content: PictureInventory) -> list[float]:
    return [one.score for one in content.objects if one.label == name]
