"""Defines lazy translations: texts that are translated when they are shown."""

from collections.abc import Iterable
from datetime import datetime
from typing import Any, Self

from app.i18n.reasons import rendering as reasons
from harness.contracts.reasons import Reason


class Message(str):
    """English text, made of a `message` with named holes and the `fields` that fill them; a str to everybody else.

    A field may be a Message itself, a Reason, or an aware UTC datetime, which every language writes in its own way.
    """

    __slots__ = ("fields", "message")
    message: str
    fields: dict[str, Any]

    def __new__(cls, message: str, fields: dict[str, Any]) -> Self:
        made = super().__new__(cls, message.format(**{name: english(value) for name, value in fields.items()}).strip())
        made.message, made.fields = message, fields
        return made


def lazy_gettext(message: str, /, **fields: Any) -> str:
    """`lazy_gettext("{who} asked", who="ada")`: translated when it is shown. The message is a literal, for Babel."""
    return Message(message, fields)


def reasoned(reason: Reason | str) -> str:
    """A reason as text that is translated when it is shown; what a person wrote stays as it is."""
    return reason if isinstance(reason, str) else Message("{reason}", {"reason": reason})


def listed(items: Iterable[Any]) -> str:
    """One after the other, as each language separates them; empty for nothing."""
    first, *rest = [*items] or [""]
    return lazy_gettext("{first}, {rest}", first=first, rest=listed(rest)) if rest else first


def english(value: Any) -> Any:
    """A field as English text: instants to the second, reasons as sentences, everything else as it is."""
    if isinstance(value, Reason):
        return reasons.sentence(value)
    return value.strftime("%Y-%m-%d %H:%M:%S") if isinstance(value, datetime) else value


def word(slug: str) -> str:
    """One word of the vocabulary, as contracts spell it: awaiting_human is shown as awaiting human."""
    return (
        slug if isinstance(slug, Message) else Message(slug.replace("_", " ").replace("{", "{{").replace("}", "}}"), {})
    )
