"""Pure: a sentence that remembers its message and its fields, so that a template can say it in another language."""

from collections.abc import Iterable
from datetime import datetime
from typing import Any, Self

from app.reasons import rendering as reasons
from harness.contracts.reasons import Reason


class Said(str):
    """English text, made of a `message` with named holes and the `fields` that fill them; a str to everybody else.

    A field may be Said itself, a Reason, or an aware UTC datetime, which every language writes in its own way.
    """

    __slots__ = ("fields", "message")
    message: str
    fields: dict[str, Any]

    def __new__(cls, message: str, fields: dict[str, Any]) -> Self:
        made = super().__new__(cls, message.format(**{name: english(value) for name, value in fields.items()}).strip())
        made.message, made.fields = message, fields
        return made


def said(message: str, /, **fields: Any) -> str:
    """`said("{who} asked", who="ada")`. The message must be a literal: the catalogues are extracted from the source."""
    return Said(message, fields)


def reasoned(reason: Reason | str) -> str:
    """A reason as text that a template can say in another language; what a person wrote stays as it is."""
    return reason if isinstance(reason, str) else Said("{reason}", {"reason": reason})


def listed(items: Iterable[Any]) -> str:
    """One after the other, as each language separates them; empty for nothing."""
    first, *rest = [*items] or [""]
    return said("{first}, {rest}", first=first, rest=listed(rest)) if rest else first


def english(value: Any) -> Any:
    """A field as English text: instants to the second, reasons as sentences, everything else as it is."""
    if isinstance(value, Reason):
        return reasons.sentence(value)
    return value.strftime("%Y-%m-%d %H:%M:%S") if isinstance(value, datetime) else value


def word(slug: str) -> str:
    """One word of the vocabulary, as contracts spell it: awaiting_human is said as awaiting human."""
    return slug if isinstance(slug, Said) else Said(slug.replace("_", " ").replace("{", "{{").replace("}", "}}"), {})
