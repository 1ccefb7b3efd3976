"""The phrases of the grammar in English and Chinese, read from this package's own files once."""

from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files

import msgspec
import yaml

from harness.contracts.readings import Act
from harness.contracts.values import Value
from harness.goals.words import Word

LANGUAGES = ("en", "zh")


class Lexicon(Value):
    """One language: phrases by what they mean to the grammar. `numbers` stand before a unit of `times` or `laps`."""

    verbs: dict[Act, str]
    tails: str
    words: dict[str, str]
    numbers: dict[str, int]
    times: str
    laps: str
    counts: dict[str, int] = msgspec.field(default_factory=dict)
    passes: str = ""
    asks: str = ""
    attached: dict[Act, str] = msgspec.field(default_factory=dict)


@lru_cache(maxsize=1)
def lexicons() -> tuple[Lexicon, ...]:
    """English, then Chinese. Raises msgspec.ValidationError for a file of another shape."""
    folder = files("harness.goals").joinpath("phrases")
    texts = (folder.joinpath(f"{language}.yaml").read_text(encoding="utf-8") for language in LANGUAGES)
    return tuple(msgspec.convert(yaml.safe_load(text), Lexicon, strict=True) for text in texts)


def meanings() -> Iterator[tuple[str, Word]]:
    """Every phrase with its meaning; of equal phrases the first one counts."""
    for lexicon in lexicons():
        yield from _counting(lexicon)
        for act, text in lexicon.verbs.items():
            yield from _listed(text, Word("verb", act=act))
        yield from _listed(lexicon.passes, Word("passes", act="go"))
        yield from _listed(lexicon.asks, Word("asks"))
        yield from _listed(lexicon.tails, Word("tail"))
        for act, text in lexicon.attached.items():
            yield from _listed(text, Word("attached", act=act))
        for kind, text in lexicon.words.items():
            yield from _listed(text, Word(kind))


def _counting(lexicon: Lexicon) -> Iterator[tuple[str, Word]]:
    """Numbers, counts and laps; a number and its unit may be written as one, as Chinese does."""
    for phrase, number in lexicon.counts.items():
        yield phrase, Word("count", number=number)
    times, laps = _listed(lexicon.times, Word("times")), _listed(lexicon.laps, Word("laps"))
    units = [("count", unit) for unit, _ in times] + [("laps", unit) for unit, _ in laps]
    for name, number in lexicon.numbers.items():
        yield name, Word("number", number=number)
        if not name.isascii():
            yield from ((f"{name}{unit}", Word(kind, number=number)) for kind, unit in units)
    yield from ((unit, Word("times" if kind == "count" else "laps")) for kind, unit in units)


def _listed(text: str, word: Word) -> list[tuple[str, Word]]:
    return [(phrase.strip(), word) for phrase in text.split(";") if phrase.strip()]
