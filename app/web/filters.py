"""The template filters: instants, durations and numbers with units; the words and colours of items."""

import json
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from math import degrees
from typing import Any

import msgspec
from markupsafe import escape

from app.i18n.messages import lazy_gettext, listed, word
from app.i18n.task_texts import task_text
from app.views import (
    actors,
    alerts,
    canary,
    candidates,
    communication,
    evidence,
    handoffs,
    measures,
    memory,
    missions,
    places,
    preview,
    providers,
    queue,
    readings,
    releases,
    review,
    robots,
    sentences,
    timeline,
    unverified,
)  # fmt: skip
from harness.contracts.actors import Actor
from harness.contracts.values import encode
from rsi_reviews.difference import NAMES


def clock(at_s: float) -> str:
    """Time of day in UTC."""
    return datetime.fromtimestamp(at_s, UTC).strftime("%H:%M:%S")


def instant(at_s: float) -> str:
    """Date and time in UTC, as a person reads it."""
    return lazy_gettext("{instant} UTC", instant=datetime.fromtimestamp(at_s, UTC))


def day(at_s: float) -> str:
    """The date in UTC."""
    return datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d")


def iso(at_s: float) -> str:
    """An instant as RFC 3339 in UTC with milliseconds, for <time datetime> attributes."""
    return datetime.fromtimestamp(at_s, UTC).isoformat(timespec="milliseconds")


def duration(seconds: float) -> str:
    """Seconds as "2 min 41 s"; below ten seconds with one decimal."""
    if seconds < 10:
        return lazy_gettext("{seconds} s", seconds=f"{max(seconds, 0.0):.1f}")
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return lazy_gettext("{hours} h {minutes} min", hours=hours, minutes=minutes)
    return (
        lazy_gettext("{minutes} min {seconds} s", minutes=minutes, seconds=rest)
        if minutes
        else lazy_gettext("{seconds} s", seconds=rest)
    )


def elapsed(seconds: float) -> str:
    """Seconds of mission time as "02:41.3"."""
    minutes, rest = divmod(max(seconds, 0.0), 60)
    return f"{int(minutes):02d}:{rest:04.1f}"


def short(digest: str) -> str:
    """The first eight characters of a digest or long identifier."""
    return digest[:8]


def words(slug: str) -> str:
    """A slug of the vocabulary as words: awaiting_human reads as "awaiting human", in the reader's language."""
    return word(slug)


def named(name: str) -> str:
    """A name that somebody gave; it is not translated."""
    return escape(name)


def acting(actor: Actor) -> str:
    """Who acted: a name that somebody gave is not translated, a rule of the harness is."""
    return actors.actor_name(actor) if actors.is_rule(actor) else named(actor.name)


def pretty(value: Any) -> str:
    """A value as indented JSON."""
    return json.dumps(value, indent=2, ensure_ascii=False, sort_keys=True)


def compact(value: Any) -> str:
    """A value as JSON on one line, cut at a readable length."""
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 320 else f"{text[:320]}… ({len(text)} signs)"


def percent(share: float) -> str:
    return f"{share * 100:.0f} %"


def listed_words(slugs: Iterable[str]) -> str:
    """Slugs of the vocabulary as a list of words."""
    return listed(map(word, slugs))


def roles(joined: str) -> str:
    """Roles, which the log stores joined by +, as a list of words."""
    return listed(joined.split("+"))


VALUES: dict[str, Callable[..., str]] = {
    "clock": clock,
    "day": day,
    "instant": instant,
    "iso": iso,
    "duration": duration,
    "elapsed": elapsed,
    "short": short,
    "words": words,
    "listed_words": listed_words,
    "roles": roles,
    "named": named,
    "pretty": pretty,
    "compact": compact,
    "percent": percent,
    "number": measures.number,
}
ITEMS: dict[str, Callable[..., Any]] = {
    "actor_name": acting,
    "is_rule": actors.is_rule,
    "alert_state": alerts.TITLES.__getitem__,
    "alert_text": alerts.text,
    "alert_title": alerts.title,
    "alert_tone": alerts.tone,
    "allowed": preview.allowed,
    "autonomy": robots.AUTONOMY.__getitem__,
    "begun": queue.has_started,
    "begun_s": lambda candidate: review.entry_at_s(candidate, "evaluation_begun"),
    "builtins": msgspec.to_builtins,
    "canonical": lambda value: encode(value).decode(),
    "card_fields": providers.card_fields,
    "cause": releases.CAUSES.__getitem__,
    "cause_tone": releases.cause_tone,
    "clause": review.CLAUSE_NAMES.__getitem__,
    "clause_verdict": review.VERDICTS.__getitem__,
    "component": NAMES.__getitem__,
    "condition_rows": measures.condition_rows,
    "goal_conditions": missions.goal_conditions,
    "task_text": task_text,
    "clause_reason": candidates.clause_sentence,
    "declared": evidence.declared,
    "degrees": degrees,
    "event_family": timeline.family,
    "event_sentence": sentences.sentence,
    "event_tone": sentences.tone,
    "fields": measures.fields,
    "finding": dict(canary.FINDINGS).__getitem__,
    "clause_verdicts": readings.clause_verdicts,
    "sent_messages": communication.sent_messages,
    "spoken_reports": communication.spoken_reports,
    "goal_reason": missions.goal_reason,
    "goal_words": readings.goal_words,
    "mission_reading": readings.mission_view,
    "source_words": readings.source_words,
    "labels": missions.labels,
    "leading": measures.leading,
    "length_m": places.length_m,
    "line_kind": review.line_kind,
    "memory_tone": lambda standing: memory.TONES.get(standing, "plain"),
    "metric": candidates.metric,
    "mission_sentence": missions.sentence,
    "mission_tone": missions.tone,
    "newest_uptakes": review.newest_uptakes,
    "no_answer_action": handoffs.NO_ANSWER_ACTIONS.__getitem__,
    "numbers": review.numbers,
    "part": review.PARTS.__getitem__,
    "place_meaning": places.MEANING.__getitem__,
    "place_tone": lambda verification: places.TONES.get(verification, "plain"),
    "entry_at_s": review.entry_at_s,
    "policy_sentence": review.policy_sentence,
    "provider": evidence.provider,
    "put_away": alerts.put_away,
    "question": handoffs.question,
    "review_tone": candidates.tone,
    "signed_reason": actors.signed_reason,
    "review_status": candidates.status_shown,
    "place_name": places.place_name,
    "safe_place": places.safe_place,
    "shelved_until_s": alerts.shelved_until_s,
    "stated": memory.stated,
    "stop_steps": robots.stop_steps,
    "supervision": providers.supervision,
    "targets": missions.targets,
    "title_of": candidates.title_of,
    "unverified": unverified.UNVERIFIED.__getitem__,
    "took_s": missions.took_s,
    "waits": handoffs.waits,
}
FILTERS: dict[str, Callable[..., Any]] = VALUES | ITEMS
