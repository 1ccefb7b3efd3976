"""Builds what the recogniser may expect to hear: what was to be said, and with equal weight what would contradict it.

Pure text: no recogniser and no synthesis here.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product

from harness.contracts.spoken_goals import TENS, UNITS, spoken_number, spoken_words

STATES = ("clear", "free", "obstructed", "blocked")
STANDING = (
    "nothing stands on its floor", "something stands on its floor", "one thing stands on its floor",
    "two things stand on its floor", "three things stand on its floor",
)  # fmt: skip
OUTCOMES = (
    "i walked the circuit from {place} and came back", "i came to {place}", "i waited there for one minute",
    "i explored the site", "i explored {place}", "i took a picture and kept it", "i inspected {place}",
    "i did not walk the circuit", "i did not come to {place}", "i did not come back", "i did not wait there",
    "i did not explore the site", "i did not explore {place}", "i did not take a picture", "i could not do it",
    "i was stopped on the way", "i did nothing",
)  # fmt: skip
"""What may be said of any mission that inspects nothing, with every place: other outcomes, and none."""
AUXILIARY = frozenset({"am", "is", "are", "was", "were", "have", "has", "had", "can", "will"})
VERIFIED, UNVERIFIED = "verified", "unverified"
ELSEWHERE = ("somewhere_else", "another_place")
"""Names that every list of places has beside its own, so that not every name must be one of the site's."""
WEIGHT = 20
"""How often a whole sentence counts, beside each of its variants with another number."""
DISCOUNT = 0.5
MOST_PRONUNCIATIONS = 8
LEAST_PART = 3
"""Letters of the shortest known word that a name may be composed of."""


def spoken(text: str, names: Sequence[str] = ()) -> tuple[str, ...]:
    """The words that are heard when a text is read aloud; a name of a place is one word with underscores."""
    words = " ".join(spoken_words(text))
    for name in sorted({_plain(one) for one in names}, key=len, reverse=True):
        if name:
            words = re.sub(rf"\b{re.escape(name)}\b", name.replace(" ", "_"), words)
    return tuple(words.split())


def sentences(text: str, names: Sequence[str]) -> Iterator[tuple[tuple[str, ...], int]]:
    """Sentences that may be heard, with their weights: the text's own, its variants, and the contraries of findings."""
    known = tuple(dict.fromkeys([*(_plain(one).replace(" ", "_") for one in names if _plain(one)), *ELSEWHERE]))
    for sentence in (one for one in re.split(r"(?<=[.!?])\s+", text) if one.strip()):
        words = spoken(sentence, names)
        yield from ((variant, WEIGHT) for variant in _elsewhere(words, known))
        if UNVERIFIED in words:
            yield tuple(VERIFIED if word == UNVERIFIED else word for word in words), WEIGHT
        for clause in re.split(r"[,:;]", sentence):
            yield from ((variant, 1) for variant in _counted(spoken(clause, names)))
    yield spoken(text, names), 1
    if "passage" not in spoken(text):
        yield from ((variant, WEIGHT) for variant in _other_outcomes(text, names, known))
    for state, negated in product(STATES, ("", "not ")):
        yield tuple(f"the passage is {negated}{state}".split()), WEIGHT
        for standing in STANDING:
            yield tuple(f"the passage is {negated}{state} {standing}".split()), WEIGHT // 5


def pronunciations(words: Sequence[str], known: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """How each word may sound; a word of several parts as its parts in a row.

    A name that the dictionary lacks sounds as the known words that it is written from ("toolcrib": tool, crib); one
    that is not made of known words is left out.
    """
    found: dict[str, tuple[str, ...]] = {}
    for word in words:
        names = [name for part in word.split("_") for name in _known_parts(part, known)]
        parts = [known.get(name, ()) for name in names]
        if all(parts):
            found[word] = tuple(" ".join(one) for one in product(*parts))[:MOST_PRONUNCIATIONS]
    return found


def _known_parts(word: str, known: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """The word if it is known, else the fewest known words that it is written from; the word where there are none."""
    if word in known:
        return (word,)
    best: list[tuple[str, ...] | None] = [(), *([None] * len(word))]
    for end in range(LEAST_PART, len(word) + 1):
        for begin in range(end - LEAST_PART + 1):
            before = best[begin]
            if before is not None and word[begin:end] in known:
                made = (*before, word[begin:end])
                partial = best[end]
                best[end] = made if partial is None or len(made) < len(partial) else partial
    return best[len(word)] or (word,)


def bigrams(sentences_heard: Sequence[tuple[tuple[str, ...], int]]) -> str:
    """A bigram model in ARPA form, with absolute discounting."""
    single: Counter[str] = Counter()
    double: Counter[tuple[str, str]] = Counter()
    for sentence, weight in sentences_heard:
        words = ("<s>", *sentence, "</s>")
        for word in words:
            single[word] += weight
        for pair in pairwise(words):
            double[pair] += weight
    vocabulary = sorted(single)
    total = sum(single.values()) + len(vocabulary)
    alone = {word: (single[word] + 1) / total for word in vocabulary}
    following: dict[str, list[str]] = {word: [] for word in vocabulary}
    began: Counter[str] = Counter()
    for (first, second), count in double.items():
        following[first].append(second)
        began[first] += count
    lines = ["\\data\\", f"ngram 1={len(vocabulary)}", f"ngram 2={len(double)}", "", "\\1-grams:"]
    for word in vocabulary:
        left = DISCOUNT * len(following[word]) / began[word] if began[word] else 1.0
        rest = max(1.0 - sum(alone[other] for other in following[word]), 1e-9)
        lines.append(f"{math.log10(alone[word]):.4f}\t{word}\t{math.log10(left / rest):.4f}")
    lines += ["", "\\2-grams:"]
    lines += [
        f"{math.log10((count - DISCOUNT) / began[first]):.4f}\t{first} {second}"
        for (first, second), count in sorted(double.items())
    ]
    return "\n".join([*lines, "", "\\end\\", ""])


def _plain(name: str) -> str:
    """A name in spoken words, without underscores."""
    return " ".join(spoken(name))


def _elsewhere(words: tuple[str, ...], known: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """The sentence, and the same of every other place."""
    yield words
    for place in [word for word in words if word in known]:
        for other in known:
            if other != place:
                yield tuple(other if word == place else word for word in words)


def _other_outcomes(text: str, names: Sequence[str], known: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """What a report of a mission might say instead: outcomes of other missions, and that its own were not reached."""
    for outcome in OUTCOMES:
        places = known if "{place}" in outcome else ("",)
        yield from (tuple(outcome.format(place=place).split()) for place in places)
    for sentence in re.split(r"(?<=[.!?])\s+", text):
        words = spoken(sentence, names)
        for index, word in enumerate(words[:3]):
            if word in AUXILIARY:
                yield (*words[: index + 1], "not", *words[index + 1 :])
        if len(words) > 1 and words[0] == "i":
            yield ("i", "did", "not", *words[2:])


def _counted(words: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """The clause with every other number in place of its own; nothing for a clause without one."""
    numbers = [index for index, word in enumerate(words) if word in UNITS or word in TENS or word == "hundred"]
    if not numbers:
        return
    first, last = numbers[0], numbers[-1]
    if last - first != len(numbers) - 1:
        last = first
    for number in range(101):
        yield (*words[:first], *spoken_number(str(number)), *words[last + 1 :])
