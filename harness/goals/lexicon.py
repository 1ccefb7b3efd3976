"""The phrases of the grammar in English and Chinese, read from this package's own files once."""

from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files

import msgspec
import yaml

from harness.contracts.readings import Act
from harness.contracts.values import Value
from harness.goals.words import Meaning

LANGUAGES = ("en", "zh")
LOOKING_AROUND = 2
"""The `number` of a verb that explores where nothing is named, and inspects a place that is."""
TELLING_SIGHT = 3
"""The `number` of a report that tells what is seen: of a picture, or at a place, that is a description."""
STATING = 4
"""The `number` of a tail that asks nothing by itself, in a language with verbs that ask: "the passage is clear"."""
FINDING = 6
"""The `number` of a report of what was found."""
ARRIVING, HOMECOMING = 7, 8
"""The `number` of a report of having come somewhere, and of having come back."""
LIMITING = 5
"""The `number` of a filler that limits what is said: "only"."""


class Lexicon(Value):
    """One language: phrases by what they mean to the grammar. `numbers` stand before a unit of `times`, `laps` or
    `durations`, which are in seconds.
    """

    verbs: dict[Act, str]
    tails: str
    words: dict[str, str]
    numbers: dict[str, int]
    times: str
    laps: str
    durations: dict[str, int] = msgspec.field(default_factory=dict)
    counts: dict[str, int] = msgspec.field(default_factory=dict)
    passes: str = ""
    looks: str = ""
    sights: str = ""
    findings: str = ""
    arrivals: str = ""
    homecomings: str = ""
    appearances: str = ""
    done: dict[Act, str] = msgspec.field(default_factory=dict)
    asks: str = ""
    only: str = ""
    attached: dict[Act, str] = msgspec.field(default_factory=dict)
    attached_findings: str = ""


@lru_cache(maxsize=1)
def lexicons() -> tuple[Lexicon, ...]:
    """English, then Chinese. Raises msgspec.ValidationError for a file of another shape."""
    folder = files("harness.goals").joinpath("phrases")
    texts = (folder.joinpath(f"{language}.yaml").read_text(encoding="utf-8") for language in LANGUAGES)
    return tuple(msgspec.convert(yaml.safe_load(text), Lexicon, strict=True) for text in texts)


def meanings() -> Iterator[tuple[str, Meaning]]:
    """Every phrase with its meaning; of equal phrases the first one counts."""
    for lexicon in lexicons():
        yield from _counting(lexicon)
        yield from _listed(lexicon.sights, Meaning("verb", act="report", number=TELLING_SIGHT))
        yield from _listed(lexicon.findings, Meaning("verb", act="report", number=FINDING))
        yield from _listed(lexicon.arrivals, Meaning("verb", act="report", number=ARRIVING))
        yield from _listed(lexicon.homecomings, Meaning("verb", act="report", number=HOMECOMING))
        for act, text in lexicon.verbs.items():
            yield from _listed(text, Meaning("verb", act=act))
        for act, text in lexicon.done.items():
            yield from _listed(text, Meaning("done", act=act))
        yield from _listed(lexicon.looks, Meaning("verb", act="explore", number=LOOKING_AROUND))
        yield from _listed(lexicon.passes, Meaning("passes", act="go"))
        yield from _listed(lexicon.asks, Meaning("asks"))
        tail = STATING if lexicon.asks else 1
        yield from _listed(lexicon.appearances, Meaning("tail", act="describe", number=tail))
        yield from _listed(lexicon.tails, Meaning("tail", number=tail))
        yield from _listed(lexicon.only, Meaning("filler", number=LIMITING))
        for act, text in lexicon.attached.items():
            yield from _listed(text, Meaning("attached", act=act))
        yield from _listed(lexicon.attached_findings, Meaning("attached", act="report", number=FINDING))
        for kind, text in lexicon.words.items():
            yield from _listed(text, Meaning(kind))
        for phrase, seconds in lexicon.durations.items():
            yield phrase, Meaning("duration", number=seconds)
        yield from _listed(lexicon.times, Meaning("times"))
        yield from _listed(lexicon.laps, Meaning("laps"))


def _counting(lexicon: Lexicon) -> Iterator[tuple[str, Meaning]]:
    """Numbers and counts; a number and its unit may be written as one, as Chinese does. Units alone come last."""
    for phrase, number in lexicon.counts.items():
        yield phrase, Meaning("count", number=number)
    times, laps = _listed(lexicon.times, Meaning("times")), _listed(lexicon.laps, Meaning("laps"))
    units = [("count", unit) for unit, _ in times] + [("laps", unit) for unit, _ in laps]
    for name, number in lexicon.numbers.items():
        yield name, Meaning("number", number=number)
        if not name.isascii():
            yield from ((f"{name}{unit}", Meaning(kind, number=number)) for kind, unit in units)


def _listed(text: str, word: Meaning) -> list[tuple[str, Meaning]]:
    return [(phrase.strip(), word) for phrase in text.split(";") if phrase.strip()]
