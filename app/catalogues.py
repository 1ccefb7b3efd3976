"""The gettext catalogues under locale/: every message of the console and its translation, read once per language."""

from collections.abc import Mapping
from functools import cache

from babel.messages.pofile import read_po

from app.settings import ROOT

ENGLISH = "en"
LOCALES: Mapping[str, str] = {"en": "en", "zh-Hans": "zh_Hans_CN"}
"""Babel's name of each language, by the tag that pages carry."""
FOLDER = ROOT / "locale"
CONSOLE, MACHINE = "messages", "machine"
"""What the console itself says, and what the machinery behind it said: one catalogue each."""


def N_(message: str) -> str:  # noqa: N802  (the marker that Babel and gettext look for)
    """Marks a text for Babel's extraction where it stands; the text itself is returned as it is."""
    return message


@cache
def catalogue(language: str, domain: str = CONSOLE) -> Mapping[str, str]:
    """Message -> translation; empty for English."""
    if language == ENGLISH:
        return {}
    with (FOLDER / LOCALES[language] / "LC_MESSAGES" / f"{domain}.po").open("rb") as file:
        read = read_po(file, locale=LOCALES[language])
    return {str(one.id): str(one.string) for one in read if one.id and one.string and not one.fuzzy}


def translated(message: str, language: str) -> str:
    """A message in a language, or as it is."""
    return catalogue(language).get(message, message)
