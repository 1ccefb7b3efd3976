"""How values look on a page: instants, durations, digests, numbers with their units. Pure."""

import json
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from markupsafe import escape

from app.messages import lazy_gettext, word
from app.views.measures import number


def clock(at_s: float) -> str:
    """Time of day in UTC."""
    return datetime.fromtimestamp(at_s, UTC).strftime("%H:%M:%S")


def instant(at_s: float) -> str:
    """Date and time in UTC, as a person reads it."""
    return lazy_gettext("{instant} UTC", instant=datetime.fromtimestamp(at_s, UTC))


def iso(at_s: float) -> str:
    """The same for machines."""
    return datetime.fromtimestamp(at_s, UTC).isoformat(timespec="milliseconds")


def duration(seconds: float) -> str:
    """2 min 41 s; below ten seconds with one decimal."""
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
    """02:41.3: a place on the mission's own time."""
    minutes, rest = divmod(max(seconds, 0.0), 60)
    return f"{int(minutes):02d}:{rest:04.1f}"


def short(digest: str) -> str:
    """The first eight signs of a digest or long identifier."""
    return digest[:8]


def words(slug: str) -> str:
    """awaiting_human reads as awaiting human, in every language that knows the word."""
    return word(slug)


def named(name: str) -> str:
    """A name that somebody gave, as it was given: no word of any language."""
    return escape(name)


def pretty(value: Any) -> str:
    """JSON for reading."""
    return json.dumps(value, indent=2, ensure_ascii=False, sort_keys=True)


def compact(value: Any) -> str:
    """JSON on one line, cut where nobody reads on."""
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 320 else f"{text[:320]}… ({len(text)} signs)"


def percent(share: float) -> str:
    return f"{share * 100:.0f} %"


FILTERS: dict[str, Callable[..., str]] = {
    "clock": clock,
    "instant": instant,
    "iso": iso,
    "duration": duration,
    "elapsed": elapsed,
    "short": short,
    "words": words,
    "named": named,
    "pretty": pretty,
    "compact": compact,
    "percent": percent,
    "number": number,
}
