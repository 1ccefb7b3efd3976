"""Templates: strict, escaped, and given exactly one page. The only place that knows Jinja."""

from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.responses import HTMLResponse

from app import filters
from app.settings import ROOT


def environment(folder: Path) -> Environment:
    """Undefined names are errors, everything is escaped, whitespace around blocks is dropped."""
    jinja = Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    jinja.filters.update(filters.FILTERS)
    jinja.globals["asset"] = asset
    return jinja


@cache
def asset(path: str) -> str:
    """Address of a static file with a stamp of its content, so that a new release is seen at once."""
    stamp = sha256((ROOT / "static" / path).read_bytes()).hexdigest()[:8]
    return f"/static/{path}?v={stamp}"


TEMPLATES = environment(ROOT / "templates")


def render(template: str, page: Any, *, status: int = 200) -> HTMLResponse:
    """One template with one page. Raises jinja2.UndefinedError if they disagree."""
    return HTMLResponse(TEMPLATES.get_template(template).render(page=page), status_code=status)
