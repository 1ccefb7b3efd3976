"""Pure: what a goal was read as, beside its text, for pages, programs and terminals."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import msgspec
from msgspec import structs

from app.i18n.messages import reasoned
from app.i18n.reasons.rendering import sentence
from app.i18n.task_texts import task_text
from harness.contracts.read_models import MissionItem
from harness.contracts.readings import PROFILE, Reading, ReadingQuestion, TextSpan, Unread
from harness.contracts.reasons import Reason
from harness.contracts.spoken_goals import Transcription
from harness.projections.judged_goal import TestedCondition, tested_clauses
from harness.projections.mission import Mission
from harness.projections.readings import (
    clause_in_words,
    default_in_words,
    reading_in_words,
    unread_in_words,
)


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
class ClauseVerdict:
    """One clause, or default, of a mission's goal and the conditions it is judged by (D44).

    `verdict` is the strictest of theirs; empty before the goal was tested.
    """

    number: str
    told: str
    verdict: str
    tests: tuple[TestedCondition, ...]


@dataclass(frozen=True)
class ReadingView:
    """A reading beside its text. `digest` is what a person confirms; empty where there is nothing to confirm.

    `heard`: what the text was written down from, where it was spoken.
    """

    text: str
    parts: tuple[TextPart, ...]
    clauses: tuple[ReadClause, ...]
    digest: str
    whole: bool
    template: str = ""
    heard: Transcription | None = None


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
        heard=question.heard,
    )


def goal_words(text: Mission | MissionItem) -> str:
    """What a mission is for: what was read; the goal's own text for one without a reading."""
    if isinstance(text, MissionItem):
        return reasoned(text.reading) if isinstance(text.reading, Reason) else text.goal
    reading = mission_reading(text)
    return reasoned(reading_in_words(reading)) if reading else text.goal


def source_words(text: Mission | MissionItem) -> str:
    """The goal's own text, where what is shown above it is a reading; empty otherwise."""
    if isinstance(text, MissionItem):
        return text.goal if isinstance(text.reading, Reason) else ""
    return text.goal if mission_reading(text) else ""


def mission_reading(mission: Mission) -> Reading | None:
    """The reading of a mission; None for one that has none, or no contract yet."""
    reading = mission.contract.reading if mission.contract else None
    return reading if isinstance(reading, Reading) else None


def mission_view(mission: Mission) -> ReadingView | None:
    """A mission's reading beside its text."""
    reading = mission_reading(mission)
    return reading_view(mission.goal, reading) if reading else None


def clause_verdicts(mission: Mission) -> tuple[ClauseVerdict, ...]:
    """The goal verdict as a table: each clause with its conditions, and each default of the mission profile."""
    return tuple(
        ClauseVerdict(
            one.cited, reasoned(one.told), one.verdict or "", tuple(_in_words(test, mission) for test in one.tests)
        )
        for one in tested_clauses(mission)
    )


def _in_words(test: TestedCondition, mission: Mission) -> TestedCondition:
    """The condition with its text as a message of its template."""
    condition = structs.replace(test.condition, text=task_text(test.condition.text, mission.contract))
    return replace(test, condition=condition)


def clauses_json(mission: Mission) -> list[dict[str, Any]]:
    """The same table for programs: clause, condition, verdict, evidence, independence."""
    return [
        {
            "clause": row.number,
            "told": str(row.told),
            "verdict": row.verdict or None,
            "conditions": [_condition_json(one) for one in row.tests],
        }
        for row in clause_verdicts(mission)
    ]


def _condition_json(tested: TestedCondition) -> dict[str, Any]:
    condition, result = tested.condition, tested.result
    return {
        "condition_id": condition.condition_id,
        "text": str(condition.text),
        "verdict": result.verdict if result else None,
        "evidence": list(result.evidence) if result else [],
        "independence": result.independence if result else None,
        "required_independence": result.required_independence if result else None,
    }


def text_parts(text: str, unread: tuple[Unread, ...]) -> tuple[TextPart, ...]:
    """The text cut where unread words begin and end."""
    parts: list[TextPart] = []
    at = 0
    for one in unread:
        start, end = max(at, one.span.start), one.span.end
        if end <= at:
            continue
        parts += [TextPart(text[at:start], "read")] if start > at else []
        parts.append(TextPart(text[start:end], "unread", reasoned(unread_in_words(one.why))))
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


def _clauses(text: str, reading: Reading) -> Iterator[ReadClause]:
    for number, clause in enumerate(reading.clauses, start=1):
        yield ReadClause(str(number), reasoned(clause_in_words(clause)), _words(text, clause.spans))
    for default in reading.defaults:
        yield ReadClause(f"{PROFILE}.{default}", reasoned(default_in_words(default)), "")


def _words(text: str, spans: tuple[TextSpan, ...]) -> str:
    return " … ".join(text[span.start : span.end] for span in spans)


def _unread_json(text: str, one: Unread) -> dict[str, Any]:
    return {
        "start": one.span.start,
        "end": one.span.end,
        "words": text[one.span.start : one.span.end],
        "why": one.why,
    }
