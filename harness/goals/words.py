"""What the words of a goal mean to the grammar, and how phrases are found among tokens. Pure."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from harness.contracts.readings import Act, ClauseObject, PictureSubject
from harness.goals.tokens import TextToken, folded


@dataclass(frozen=True)
class Meaning:
    """One meaning. `kind` says which rule of the grammar takes it; the other fields are that rule's."""

    kind: str
    act: Act | None = None
    object: ClauseObject | None = None
    number: int = 1
    subject: PictureSubject | None = None


@dataclass(frozen=True)
class Item:
    """A phrase of the text with its meaning, or a token that means nothing here (kind `unknown`)."""

    word: Meaning
    start: int
    end: int
    text: str

    @property
    def kind(self) -> str:
        return self.word.kind


@dataclass(frozen=True)
class Phrases:
    """Phrases by their first token, the longest first. A phrase of one Latin letter counts only as a capital."""

    by_first: Mapping[str, tuple[tuple[tuple[str, ...], Meaning], ...]] = field(default_factory=dict)

    def at(self, found: Sequence[TextToken], index: int) -> tuple[int, Meaning] | None:
        """How many tokens from here on are a phrase, and its meaning; None if none is."""
        written = found[index].written
        if _is_letter((written,)) and (written,) in (one[0] for one in self.by_first.get(written, ())):
            return 1, self.by_first[written][-1][1]
        for phrase, word in self.by_first.get(found[index].text, ()):
            here = found[index : index + len(phrase)]
            if tuple(token.text for token in here) != phrase:
                continue
            return len(phrase), word
        return None


def phrases(*tables: Iterable[tuple[str, Meaning]]) -> Phrases:
    """Phrases and their meanings; where two tables have the same phrase, the first table's meaning holds."""
    known: dict[tuple[str, ...], Meaning] = {}
    for table in tables:
        for text, word in table:
            if key := folded(text):
                letter = word.kind == "name" and _is_letter(key)
                known.setdefault((key[0].upper(),) if letter else key, word)
    by_first: dict[str, list[tuple[tuple[str, ...], Meaning]]] = {}
    for key, word in known.items():
        by_first.setdefault(key[0], []).append((key, word))
    ranked = {first: tuple(sorted(found, key=lambda one: -len(one[0]))) for first, found in by_first.items()}
    return Phrases(ranked)


def _is_letter(phrase: tuple[str, ...]) -> bool:
    return len(phrase) == 1 and len(phrase[0]) == 1 and phrase[0].isascii()
