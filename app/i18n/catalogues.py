"""Reads the gettext catalogues under locale/ once per language, and translates their messages."""

from collections.abc import Mapping
from functools import cache
from gettext import NullTranslations
from io import BytesIO
from typing import TypeVar

from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po
from babel.support import Translations

from app.settings import ROOT

Text = TypeVar("Text", bound=str)

ENGLISH = "en"
LOCALES: Mapping[str, str] = {"en": "en", "zh-Hans": "zh_Hans_CN"}
"""Babel's name of each language, by the tag that pages carry."""
FOLDER = ROOT / "locale"
CATALOGUE = "messages.po"
SCRIPTS = "static/js/"


def N_(message: Text) -> Text:  # noqa: N802 - the name that gettext gives this mark
    """The text as it is, marked for the extraction: whoever shows it translates it."""
    return message


@cache
def book(language: str) -> Catalog:
    """A catalogue as it stands in its file; empty for English."""
    if language == ENGLISH:
        return Catalog()
    with (FOLDER / LOCALES[language] / "LC_MESSAGES" / CATALOGUE).open("rb") as file:
        return read_po(file, locale=LOCALES[language])


@cache
def catalogue(language: str) -> Mapping[str, str]:
    """Message -> translation, of every message without a plural."""
    return {str(one.id): str(one.string) for one in book(language) if one.id and one.string and not one.fuzzy}


@cache
def translations(language: str) -> NullTranslations:
    """gettext and ngettext of one language, with its own rule of plurals."""
    if language == ENGLISH:
        return NullTranslations()
    compiled = BytesIO()
    write_mo(compiled, book(language))
    compiled.seek(0)
    return Translations(compiled)


def translated(message: str, language: str) -> str:
    """A message in a language, or as it is."""
    return translations(language).gettext(message) if message else ""


@cache
def script_messages(language: str) -> Mapping[str, str]:
    """Message -> translation, of every message that a script of the console shows."""
    texts = catalogue(language)
    used = (str(one.id) for one in book(language) if any(path.startswith(SCRIPTS) for path, _ in one.locations))
    return {message: texts[message] for message in used if message in texts}
