"""Templates: strict, escaped, in the reader's language, and given exactly one page. The only place that knows Jinja."""

from functools import cache, partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.responses import HTMLResponse

from app import filters
from app.catalogues import ENGLISH, catalogue, translated
from app.languages import CHOICE, told, ways
from app.phrases import script_messages, spoken
from app.reasons import rendering as reasons
from app.regions import REGIONS
from app.settings import ROOT
from app.static_files import STAMP, stamp
from app.views.canary import FINDINGS
from harness.contracts.reasons import Reason
from rsi_reviews.difference import NAMES


class SpokenLoader(FileSystemLoader):
    """Templates with their words in one language, translated once, when they are loaded."""

    def __init__(self, folder: Path, language: str) -> None:
        super().__init__(folder)
        self._language = language

    def get_source(self, environment: Environment, template: str) -> tuple[str, str, Any]:
        """The source that Jinja compiles; raises jinja2.TemplateNotFound."""
        source, filename, fresh = super().get_source(environment, template)
        if self._language == ENGLISH:
            return source, filename, fresh
        return spoken(source, partial(translated, language=self._language)), filename, fresh


def environment(folder: Path, language: str = ENGLISH) -> Environment:
    """Undefined names are errors, everything is escaped, whitespace around blocks is dropped."""
    jinja = Environment(
        loader=SpokenLoader(folder, language),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    jinja.filters.update(filters.FILTERS)
    jinja.finalize = partial(_finalized, language=language)
    jinja.filters["told"] = partial(told, language=language)
    jinja.globals["asset"] = asset
    jinja.globals["language"] = language
    jinja.globals["regions"] = REGIONS
    jinja.globals["findings"] = FINDINGS
    jinja.globals["components"] = NAMES
    jinja.globals["languages"] = ways
    jinja.globals["phrases"] = {one: catalogue(language)[one] for one in script_phrases() if one in catalogue(language)}
    return jinja


def _finalized(value: Any, language: str) -> Any:
    return reasons.sentence(value, language) if isinstance(value, Reason) else value


@cache
def asset(path: str) -> str:
    """Address of a static file with a stamp of its content, so that a new release is seen at once."""
    return f"/static/{path}?{STAMP}={stamp(ROOT / 'static' / path)}"


@cache
def script_phrases() -> tuple[str, ...]:
    """Every message that a script of the console says, once."""
    sources = sorted((ROOT / "static" / "js").glob("*.js"))
    return tuple(dict.fromkeys(one for path in sources for one in script_messages(path.read_text(encoding="utf-8"))))


TEMPLATES = environment(ROOT / "templates")


@cache
def templates(language: str) -> Environment:
    """The templates in one language."""
    return TEMPLATES if language == ENGLISH else environment(ROOT / "templates", language)


def render(template: str, page: Any, *, status: int = 200) -> HTMLResponse:
    """One template with one page, in the language of the request. Raises jinja2.UndefinedError if they disagree."""
    chosen = templates(CHOICE.get().language)
    return HTMLResponse(chosen.get_template(template).render(page=page), status_code=status)
