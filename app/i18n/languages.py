"""Chooses the language of a request, in a middleware, and translates messages and instants into it.

A catalogue is a gettext file under locale/, read once when its language is first asked for. What it lacks is shown in
English. The choice: ?lang= of the address, which also sets the cookie; else the cookie; else what the browser prefers.
"""

from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, urlencode

from babel.core import negotiate_locale
from babel.dates import format_datetime
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.types import Message as ASGIMessage

from app.i18n import catalogues
from app.i18n.messages import Message
from app.i18n.reasons import rendering as reasons
from harness.contracts.errors import HarnessError
from harness.contracts.reasons import Explanation, Reason

LANGUAGES: Mapping[str, str] = {"en": "English", "zh-Hans": "简体中文"}
"""By the tag that pages carry; each named in itself."""
ASKED_AS: Mapping[str, str] = {"zh": "zh-Hans", "zh-cn": "zh-Hans", "zh-sg": "zh-Hans", "zh-hans-cn": "zh-Hans"}
"""Other tags that mean one of ours."""
COOKIE, PARAMETER, YEAR_S = "regen_language", "lang", 365 * 86400


@dataclass(frozen=True)
class LanguageChoice:
    """A reader's language, and the query of the page they are on, from which the switch is made."""

    language: str = catalogues.ENGLISH
    query: str = ""


UNCHOSEN = LanguageChoice()
CHOICE: ContextVar[LanguageChoice] = ContextVar("choice", default=UNCHOSEN)
"""Of the present request. Set by Languages alone."""


@dataclass(frozen=True)
class LanguageLink:
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
        choice = dict(parse_qsl(query)).get(PARAMETER, "")
        chosen = choice if choice in LANGUAGES else ""
        mark = CHOICE.set(LanguageChoice(chosen or preferred(Headers(scope=scope)), query))
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
        cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        cookie = None
    if cookie is not None and cookie.value in LANGUAGES:
        return cookie.value
    wishes = [_wish(one) for one in headers.get("accept-language", "").split(",")]
    tags = [tag for weight, tag in sorted(wishes, key=lambda wish: -wish[0]) if weight > 0]
    found = negotiate_locale([ASKED_AS.get(tag.lower(), tag) for tag in tags], list(LANGUAGES), sep="-")
    return found or catalogues.ENGLISH


def _wish(text: str) -> tuple[float, str]:
    tag, _, weight = text.strip().partition(";q=")
    try:
        return (float(weight) if weight else 1.0), tag
    except ValueError:
        return 0.0, tag


def language_links() -> tuple[LanguageLink, ...]:
    """Links to the present page in the other languages, with the rest of its address unchanged."""
    choice = CHOICE.get()
    query = [(name, value) for name, value in parse_qsl(choice.query) if name != PARAMETER]
    return tuple(
        LanguageLink(language=tag, title=title, href=f"?{urlencode([*query, (PARAMETER, tag)])}")
        for tag, title in LANGUAGES.items()
        if tag != choice.language
    )


def localise(value: Any, language: str) -> Any:
    """A value as its reader should see it: a reason, a Message, a text of the catalogue; anything else untouched."""
    if isinstance(value, Reason):
        return reasons.sentence(value, language)
    if language == catalogues.ENGLISH or not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    if isinstance(value, Message) and value.fields:
        fields = {name: _field(one, language) for name, one in value.fields.items()}
        return catalogues.translated(value.message, language).format(**fields).strip()
    return catalogues.translated(str(value), language)


def in_words(reason: Explanation) -> str:
    """A reason as a sentence, in the language of the present request."""
    return reasons.sentence(reason, CHOICE.get().language)


def explained(error: HarnessError) -> str:
    """An error in one line, in the language of the present request: what happened, where, and what to do."""
    return reasons.explained(error, CHOICE.get().language)


def remedy(error: HarnessError) -> str:
    """What to do about an error, in the language of the present request."""
    return reasons.remedy(error, CHOICE.get().language)


def _field(value: Any, language: str) -> Any:
    if isinstance(value, datetime):
        return format_datetime(value, "medium", locale=catalogues.LOCALES[language])
    return localise(value, language)
