"""The one place where a reason becomes a sentence, in the reader's language; what it rests on stays code and facts.

A message has named holes with Python's format specifications, and a few of our own: `{x:word}` is a term of the
vocabulary, `{x:words}` several of them, `{x:or}` the same with "or" before the last, `{x:capital}` begins a sentence.
"""

import warnings
from collections.abc import Mapping
from string import Formatter
from typing import Any

from app.catalogues import ENGLISH, translated
from app.reasons import verification
from harness.contracts.reasons import RECORDED, Reason

SENTENCES: Mapping[str, str] = {
    RECORDED: "{text}",
    **verification.SENTENCES,
}
"""Every code of the project and its message."""
BETWEEN: Mapping[str, tuple[str, str, str]] = {"en": (", ", "; ", " or "), "zh-Hans": ("、", "；", "或")}
"""What stands between names, between sentences, and before the last of several that are offered."""
WORDS = frozenset({"word", "words", "or", "capital"})
"""Format specifications that are ours."""


def sentence(reason: Reason, language: str = ENGLISH) -> str:
    """The reason in that language. A code without a sentence warns, and is shown as it is with its facts."""
    message = SENTENCES.get(reason.code)
    if message is None:
        warnings.warn(f"the reason {reason.code!r} has no sentence", stacklevel=2)
        return bare(reason)
    try:
        return _Formatter(language).vformat(translated(message, language), (), reason.facts).strip()
    except (KeyError, ValueError, TypeError) as wrong:
        warnings.warn(f"the facts of {reason!r} do not fill its sentence: {wrong!r}", stacklevel=2)
        return bare(reason)


def sentences(reasons: tuple[Reason | str, ...], language: str = ENGLISH) -> str:
    """Several reasons one after the other, as the language separates them."""
    return BETWEEN[language][1].join(one if isinstance(one, str) else sentence(one, language) for one in reasons)


def bare(reason: Reason) -> str:
    """`code (name value, name value)`: what is known of a reason whose sentence is not."""
    facts = ", ".join(f"{name} {_bare(value)}" for name, value in reason.facts.items())
    return f"{reason.code} ({facts})" if facts else reason.code


def word(slug: str, language: str = ENGLISH) -> str:
    """A term of the vocabulary, as contracts spell it, in a language: awaiting_human is said as awaiting human."""
    return translated(slug.replace("_", " "), language)


class _Formatter(Formatter):
    """Fills the holes of one message with facts."""

    def __init__(self, language: str) -> None:
        self._language = language

    def format_field(self, value: Any, format_spec: str) -> str:
        """A fact as its hole asks for it."""
        commas, semicolons, alternatives = BETWEEN[self._language]
        match value:
            case Reason():
                text = sentence(value, self._language)
                return f"{text[:1].upper()}{text[1:]}" if format_spec == "capital" else text
            case tuple() if any(isinstance(one, Reason) for one in value):
                return semicolons.join(self.format_field(one, "") for one in value)
            case tuple():
                listed = [self.format_field(one, "word" if format_spec else "") for one in value]
                if format_spec == "or" and len(listed) > 1:
                    return alternatives.join((commas.join(listed[:-1]), listed[-1]))
                return commas.join(listed)
            case str() if format_spec in WORDS:
                text = word(value, self._language)
                return f"{text[:1].upper()}{text[1:]}" if format_spec == "capital" else text
            case _:
                return str(super().format_field(value, format_spec))


def _bare(value: Any) -> str:
    match value:
        case Reason():
            return bare(value)
        case tuple():
            return ", ".join(map(_bare, value))
        case _:
            return str(value)
