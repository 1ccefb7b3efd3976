"""Languages: which one a reader gets, the catalogues, and what every message and instant is in it.

A catalogue is a gettext file under locale/, read once when its language is first asked for. What it lacks is shown in
English. The choice: ?lang= of the address, which also sets the cookie; else the cookie; else what the browser prefers.
"""

from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from gettext import NullTranslations
from http.cookies import CookieError, SimpleCookie
from io import BytesIO
from typing import Any
from urllib.parse import parse_qsl, urlencode

from babel.core import negotiate_locale
from babel.dates import format_datetime
from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po
from babel.support import Translations
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.types import Message as ASGIMessage

from app.messages import Message
from app.retelling import Retelling
from app.settings import ROOT

ENGLISH = "en"
LANGUAGES: Mapping[str, str] = {"en": "English", "zh-Hans": "简体中文"}
"""By the tag that pages carry; each named in itself."""
LOCALES: Mapping[str, str] = {"en": "en", "zh-Hans": "zh_Hans_CN"}
ASKED_AS: Mapping[str, str] = {"zh": "zh-Hans", "zh-cn": "zh-Hans", "zh-sg": "zh-Hans", "zh-hans-cn": "zh-Hans"}
"""Other tags that mean one of ours."""
COOKIE, PARAMETER, YEAR_S = "regen_language", "lang", 365 * 86400
FOLDER = ROOT / "locale"
CONSOLE, MACHINE = "messages", "machine"
"""What the console itself says, and what the machinery behind it said: one catalogue each."""
SCRIPTS = "static/js/"


@dataclass(frozen=True)
class Choice:
    """A reader's language, and the query of the page they are on, from which the switch is made."""

    language: str = ENGLISH
    query: str = ""


UNCHOSEN = Choice()
CHOICE: ContextVar[Choice] = ContextVar("choice", default=UNCHOSEN)
"""Of the present request. Set by Languages alone."""


@dataclass(frozen=True)
class Way:
    """A link to the same page in another language."""

    language: str
    title: str
    href: str


class Languages:
    """ASGI middleware: chooses the language of every answer, and keeps it in a cookie when a reader chose it."""

    def __init__(self, app: ASGIApp, *, secure: bool) -> None:
        self._app, self._secure = app, secure

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        query = scope["query_string"].decode("latin-1")
        asked = dict(parse_qsl(query)).get(PARAMETER, "")
        chosen = asked if asked in LANGUAGES else ""
        mark = CHOICE.set(Choice(chosen or preferred(Headers(scope=scope)), query))
        try:
            await self._app(scope, receive, self._keeping(send, chosen))
        finally:
            CHOICE.reset(mark)

    def _keeping(self, send: Send, chosen: str) -> Send:
        language = CHOICE.get().language
        line = (
            f"{COOKIE}={chosen}; Path=/; Max-Age={YEAR_S}; SameSite=Lax; HttpOnly{'; Secure' if self._secure else ''}"
        )

        async def keeping(message: ASGIMessage) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                if headers.get("content-type", "").startswith("text/html"):
                    headers["content-language"] = language
                if chosen:
                    headers.append("set-cookie", line)
            await send(message)

        return keeping


def preferred(headers: Headers) -> str:
    """The cookie's language, else the best of the browser's wishes, else English."""
    try:
        kept = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        kept = None
    if kept is not None and kept.value in LANGUAGES:
        return kept.value
    wishes = [_wish(one) for one in headers.get("accept-language", "").split(",")]
    tags = [tag for weight, tag in sorted(wishes, key=lambda wish: -wish[0]) if weight > 0]
    found = negotiate_locale([ASKED_AS.get(tag.lower(), tag) for tag in tags], list(LANGUAGES), sep="-")
    return found or ENGLISH


def _wish(text: str) -> tuple[float, str]:
    tag, _, weight = text.strip().partition(";q=")
    try:
        return (float(weight) if weight else 1.0), tag
    except ValueError:
        return 0.0, tag


def ways() -> tuple[Way, ...]:
    """The present page in the other languages; everything else of its address is kept."""
    choice = CHOICE.get()
    kept = [(name, value) for name, value in parse_qsl(choice.query) if name != PARAMETER]
    return tuple(
        Way(language=tag, title=title, href=f"?{urlencode([*kept, (PARAMETER, tag)])}")
        for tag, title in LANGUAGES.items()
        if tag != choice.language
    )


@cache
def book(language: str, domain: str = CONSOLE) -> Catalog:
    """A catalogue as it stands in its file; empty for English."""
    if language == ENGLISH:
        return Catalog()
    with (FOLDER / LOCALES[language] / "LC_MESSAGES" / f"{domain}.po").open("rb") as file:
        return read_po(file, locale=LOCALES[language])


@cache
def catalogue(language: str, domain: str = CONSOLE) -> Mapping[str, str]:
    """Message -> translation, of every message without a plural."""
    return {str(one.id): str(one.string) for one in book(language, domain) if one.id and one.string and not one.fuzzy}


@cache
def translations(language: str) -> NullTranslations:
    """gettext and ngettext of one language, with its own rule of plurals."""
    if language == ENGLISH:
        return NullTranslations()
    compiled = BytesIO()
    write_mo(compiled, book(language))
    compiled.seek(0)
    return Translations(compiled)


@cache
def script_messages(language: str) -> Mapping[str, str]:
    """Message -> translation, of every message that a script of the console shows."""
    texts = catalogue(language)
    used = (str(one.id) for one in book(language) if any(path.startswith(SCRIPTS) for path, _ in one.locations))
    return {message: texts[message] for message in used if message in texts}


@cache
def retelling(language: str) -> Retelling:
    """What the machinery said, in a language."""
    return Retelling(catalogue(language), catalogue(language, MACHINE))


def localise(value: Any, language: str) -> Any:
    """A value as its reader should see it: a Message, and what the catalogues know; anything else untouched."""
    if language == ENGLISH or not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    if isinstance(value, Message):
        if not value.fields:
            return retelling(language).told(str(value))
        fields = {name: _field(one, language) for name, one in value.fields.items()}
        return translations(language).gettext(value.message).format(**fields).strip()
    return retelling(language).told(value)


def _field(value: Any, language: str) -> Any:
    if isinstance(value, datetime):
        return format_datetime(value, "medium", locale=LOCALES[language])
    return localise(value, language)
