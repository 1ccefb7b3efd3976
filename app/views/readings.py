"""Pure: what a goal was read as, beside its text, for pages, programs and terminals."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from app.i18n.catalogues import ENGLISH
from app.i18n.messages import reasoned
from app.i18n.reasons.rendering import sentence
from harness.contracts.readings import PROFILE, Reading, ReadingQuestion, Span, Unread
from harness.contracts.reasons import because
from harness.projections.readings import clause_in_words, reading_in_words


@dataclass(frozen=True)
class TextPart:
    """A piece of the goal text: what was read, a filler, or what was not (`unread`, with the reason)."""

    text: str
    kind: str
    why: str = ""


@dataclass(frozen=True)
class ReadClause:
    """One line of a reading: what is done, and the words that said so; a default has none."""

    number: str
    told: str
    words: str


@dataclass(frozen=True)
class ReadingView:
    """A reading beside its text. `digest` is what a person confirms; empty where there is nothing to confirm."""

    text: str
    parts: tuple[TextPart, ...]
    clauses: tuple[ReadClause, ...]
    digest: str
    whole: bool
    template: str = ""


def reading_view(text: str, reading: Reading) -> ReadingView:
    """A reading that may start, beside the text it is of."""
    return ReadingView(
        text=text,
        parts=text_parts(text, reading.unread),
        clauses=tuple(_clauses(text, reading)),
        digest=reading.digest,
        whole=not reading.unread,
    )


def question_view(question: ReadingQuestion) -> ReadingView:
    """What a person is asked: the text with its unread words, and the nearest reading."""
    nearest = question.nearest
    return ReadingView(
        text=question.text,
        parts=text_parts(question.text, question.unread),
        clauses=tuple(_clauses(question.text, nearest)) if nearest else (),
        digest=nearest.digest if nearest else "",
        whole=False,
        template=question.template,
    )


def text_parts(text: str, unread: tuple[Unread, ...]) -> tuple[TextPart, ...]:
    """The text cut where unread words begin and end."""
    parts: list[TextPart] = []
    at = 0
    for one in unread:
        start, end = max(at, one.span.start), one.span.end
        if end <= at:
            continue
        parts += [TextPart(text[at:start], "read")] if start > at else []
        parts.append(TextPart(text[start:end], "unread", reasoned(because(f"unread_{one.why}"))))
        at = end
    return tuple([*parts, TextPart(text[at:], "read")] if at < len(text) else parts)


def question_json(question: ReadingQuestion) -> dict[str, Any]:
    """The question for programs: the text, each unread span with its words, and the nearest reading with its digest."""
    nearest = question.nearest
    return {
        "text": question.text,
        "unread": [_unread_json(question.text, one) for one in question.unread],
        "nearest": reading_json(question.text, nearest) if nearest else None,
        "template": question.template,
        "question": msgspec.to_builtins(question),
    }


def reading_json(text: str, reading: Reading) -> dict[str, Any]:
    """A reading for programs: typed clauses with their words, the defaults, and the digest that confirms it."""
    return {
        "digest": reading.digest,
        "told": sentence(reading_in_words(reading)),
        "reader": f"{reading.reader} {reading.version}",
        "site": reading.site,
        "clauses": [
            {**msgspec.to_builtins(clause), "number": number, "words": _words(text, clause.spans)}
            for number, clause in enumerate(reading.clauses, start=1)
        ],
        "defaults": list(reading.defaults),
        "unread": [_unread_json(text, one) for one in reading.unread],
    }


def question_lines(question: ReadingQuestion, language: str = ENGLISH) -> list[str]:
    """The question for a terminal: the text with its unread words in brackets, and how to confirm the reading."""
    shown = "".join(f"[{part.text}]" if part.kind == "unread" else part.text for part in question_view(question).parts)
    lines = [f"  {shown}"]
    for one in question.unread:
        why = sentence(because(f"unread_{one.why}"), language)
        lines.append(f"    {question.text[one.span.start : one.span.end]!r}: {why}")
    if question.nearest is not None:
        lines.append(f"  nearest reading: {sentence(reading_in_words(question.nearest), language)}")
        lines.append(f"  to start that: --confirm-reading {question.nearest.digest}")
    return lines


def _clauses(text: str, reading: Reading) -> Iterator[ReadClause]:
    for number, clause in enumerate(reading.clauses, start=1):
        yield ReadClause(str(number), reasoned(clause_in_words(clause)), _words(text, clause.spans))
    for default in reading.defaults:
        yield ReadClause(f"{PROFILE}.{default}", reasoned(because(f"default_{default}")), "")


def _words(text: str, spans: tuple[Span, ...]) -> str:
    return " … ".join(text[span.start : span.end] for span in spans)


def _unread_json(text: str, one: Unread) -> dict[str, Any]:
    return {
        "start": one.span.start,
        "end": one.span.end,
        "words": text[one.span.start : one.span.end],
        "why": one.why,
    }
