"""Renders templates: strict, escaped, in the reader's language, each with exactly one page object."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from starlette.responses import HTMLResponse

from app.i18n.catalogues import ENGLISH, script_messages, translations
from app.i18n.languages import CHOICE, language_links, localise
from app.i18n.messages import Message
from app.i18n.visible_text import visible
from app.settings import ROOT
from app.views.canary import FINDINGS
from app.views.candidate_editor import UNNAMED
from app.views.forms import STOP_REASONS
from app.web import filters
from app.web.regions import REGIONS
from app.web.static_files import STAMP, stamp
from harness.contracts.reasons import Reason
from rsi_reviews.difference import NAMES


class TranslatedEnvironment(Environment):
    """A Jinja environment whose gettext takes the placeholders of a message by name."""

    newstyle_gettext = True


def environment(folder: Path, language: str = ENGLISH) -> Environment:
    """Undefined names are errors and everything is escaped.

    A space before a block tag stays: the formatter of the templates may break the line there, and the words on both
    sides of the tag must not grow together.
    """
    jinja = TranslatedEnvironment(
        loader=FileSystemLoader(folder),
        extensions=["jinja2.ext.i18n"],
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        finalize=None if language == ENGLISH else partial(_localised, language=language),
    )
    jinja.policies["ext.i18n.trimmed"] = True
    jinja.filters.update(filters.FILTERS)
    jinja.filters["localise"] = partial(localise, language=language)
    jinja.globals.update(gettext_functions(language))
    jinja.globals["asset"] = asset
    jinja.globals["language"] = language
    jinja.globals["regions"] = REGIONS
    jinja.globals["findings"] = FINDINGS
    jinja.globals["components"] = NAMES
    jinja.globals["unnamed_units"] = UNNAMED
    jinja.globals["languages"] = language_links
    jinja.globals["stop_reasons"] = STOP_REASONS
    jinja.globals["script_messages"] = script_messages(language)
    return jinja


def gettext_functions(language: str) -> dict[str, Callable[..., Markup]]:
    """What `{% trans %}` and `_()` call. Translations are markup; what fills their holes is localised and escaped."""
    texts = translations(language)

    @cache
    def whole(message: str) -> Markup:
        return Markup(texts.gettext(message)) % {}

    def filled(text: str, holes: dict[str, Any]) -> Markup:
        return Markup(text) % {name: localise(value, language) for name, value in holes.items()}

    def gettext(message: str, /, **holes: Any) -> Markup:
        return filled(texts.gettext(message), holes) if holes else whole(message)

    def ngettext(singular: str, plural: str, num: int, /, **holes: Any) -> Markup:
        return filled(texts.ngettext(singular, plural, num), {"num": num, **holes})

    return {"_": gettext, "gettext": gettext, "ngettext": ngettext}


def _localised(value: Any, language: str) -> Any:
    """A Message or a Reason in the reader's language; every other value unchanged."""
    return localise(value, language) if isinstance(value, Message | Reason) else value


@cache
def asset(path: str) -> str:
    """Address of a static file with a stamp of its content, so that a new release is seen at once."""
    return f"/static/{path}?{STAMP}={stamp(ROOT / 'static' / path)}"


TEMPLATES = environment(ROOT / "templates")


@cache
def templates(language: str) -> Environment:
    """The templates in one language."""
    return TEMPLATES if language == ENGLISH else environment(ROOT / "templates", language)


def render(template: str, page: Any, *, status: int = 200) -> HTMLResponse:
    """Render a template in the language of the request. Raises jinja2.UndefinedError if it reads what `page` lacks.

    What nobody would see of a goal, a robot's name or a file's is made visible, wherever on the page it stands.
    """
    chosen = templates(CHOICE.get().language)
    return HTMLResponse(visible(chosen.get_template(template).render(page=page)), status_code=status)
