"""What a person may say at a site: sentences of the English grammar with the site's own names. Pure."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import cycle

from harness.contracts.places import Site
from harness.contracts.spoken_goals import SpokenVocabulary, name_token
from harness.goals.lexicon import Lexicon, lexicons
from harness.goals.names import site_names
from harness.goals.words import Meaning

PLAIN, SELDOM = 4, 1
"""How often a whole order counts, beside one with a word more that a person may or may not say."""
COMMON = ("check", "inspect", "go to", "photograph", "walk", "describe", "explore", "take a picture of")
ENDINGS = ("come back", "return", "report what you find", "tell me what you see", "do not come back")
JOINTS = ("and", "and then", "twice and")
"""Orders that people say most, in which every name of the site is expected."""


def spoken_vocabulary(site: Site) -> SpokenVocabulary:
    """Sentences that the grammar knows, words that it refuses among them: "not", "if" and "tomorrow" are to be heard.

    Raises ContractInvalid for a site whose names are ambiguous.
    """
    phrases = {(name, _is_channel(meaning)) for name, meaning in site_names(site) if _sayable(name)}
    bare = sorted((name, channel) for name, channel in phrases if not name.startswith("the "))
    names, channels = (tuple(name for name, channel in bare if channel is kind) for kind in (False, True))
    return _vocabulary(names, channels, tuple(one.lower() for one in site.wake_phrases if _sayable(one)))


@lru_cache(maxsize=8)
def _vocabulary(names: tuple[str, ...], channels: tuple[str, ...], wake: tuple[str, ...]) -> SpokenVocabulary:
    tokens, recipients = [name_token(name) for name in names], [name_token(name) for name in channels]
    counted: dict[str, int] = {}
    for sentence, weight in (*_sentences(lexicons()[0], tokens), *_sending(tokens, recipients)):
        counted[sentence] = max(counted.get(sentence, 0), weight)
    for phrase in wake:
        for verb in _verbs(lexicons()[0]):
            counted.setdefault(f"{name_token(phrase)} {verb}", PLAIN)
    return SpokenVocabulary(
        sentences=tuple(counted.items()), names=tuple(sorted({*names, *channels})), wake_phrases=wake
    )


def _sending(names: Sequence[str], channels: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Where a finding is sent to: every channel of the site after every place that can be checked."""
    for channel in channels:
        for recipient in (channel, f"the {channel}"):
            yield f"send it to {recipient}", PLAIN
            yield f"send the report to {recipient}", PLAIN
            yield from ((f"check the {name} and send it to {recipient}", PLAIN) for name in names)


def _is_channel(meaning: Meaning) -> bool:
    return meaning.object is not None and meaning.object.kind == "channel"


def _sentences(english: Lexicon, names: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Every phrase where a person would say it; every name in the common orders, and by turns in all others."""
    verbs = _verbs(english)
    others = [f"the {name}" for name in names]
    turn = cycle(others)
    for verb in COMMON:
        yield from ((f"{verb} {name}", PLAIN) for name in (*names, *others))
        yield from ((f"do not {verb} {name}", PLAIN) for name in others)
        yield from (
            (f"{verb} {name} {joint} {ending}", PLAIN) for name in others for joint in JOINTS for ending in ENDINGS
        )
        yield from ((f"{verb} {name} and then {verb} {next(turn)}", PLAIN) for name in others)
    yield from ((f"walk {name} and then check {other}", PLAIN) for name in others for other in others)
    for verb in verbs:
        yield verb, PLAIN
        yield f"{verb} {next(turn)}", SELDOM
    for kind in ("and", "then", "but", "first", "last", "before", "after"):
        for joint in _listed(english.words[kind]):
            yield from ((f"check {next(turn)} {joint} {verb}", SELDOM) for verb in COMMON)
    for kind in ("neg", "filler", "condition", "time", "lead", "or", "avoid"):
        for phrase in (*_listed(english.words[kind]), *(_listed(english.only) if kind == "filler" else ())):
            yield from ((f"{phrase} {verb} {next(turn)}", SELDOM) for verb in COMMON)
            yield f"check {next(turn)} {phrase}", SELDOM
    for phrase in (*_listed(english.passes), *_listed(english.words["avoid"])):
        yield f"{phrase} {next(turn)}", SELDOM
    for kind in ("pronoun", "here", "site", "around"):
        yield from ((f"{verb} {word}", SELDOM) for word in _listed(english.words[kind]) for verb in COMMON)
    for text in english.attached.values():
        yield from ((f"check {next(turn)} {phrase}", SELDOM) for phrase in _listed(text))
    for unit in (*_listed(english.times), *_listed(english.laps)):
        yield from ((f"check {next(turn)} {number} {unit}", SELDOM) for number in english.numbers)
    yield from ((f"check {next(turn)} {count}", PLAIN) for count in english.counts)
    for asks in _listed(english.asks):
        yield from ((f"{asks} {next(turn)} {tail}", SELDOM) for tail in _listed(english.tails))


def _verbs(english: Lexicon) -> list[str]:
    reports = (english.looks, english.sights, english.findings)
    return [phrase for text in (*english.verbs.values(), *reports) for phrase in _listed(text)]


def _listed(text: str) -> list[str]:
    return [phrase for part in text.split(";") if (phrase := " ".join(part.split()))]


def _sayable(name: str) -> bool:
    return name.isascii() and any(letter.isalpha() for letter in name)
