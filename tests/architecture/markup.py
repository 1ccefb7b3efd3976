"""Reads templates as text: their tags, the addresses in them, and constructs they must not contain."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from tests.architecture.sources import ROOT

TEMPLATES = ROOT / "templates"
HOLE = "\x01"
HTMX_METHODS = {f"hx-{method.lower()}": method for method in ("GET", "POST", "PUT", "PATCH", "DELETE")}
FORBIDDEN = (
    (re.compile(r"<script(?![^>]*\bsrc=)[^>]*>", re.IGNORECASE), "an inline script"),
    (re.compile(r"<style\b", re.IGNORECASE), "an inline style sheet"),
    (re.compile(r"<[^<>]*\sstyle\s*=", re.IGNORECASE), "an inline style"),
    (re.compile(r"<[^<>]*\s(on[a-z]+|hx-on[\w:-]*)\s*=", re.IGNORECASE), "an inline handler"),
    (re.compile(r"javascript:", re.IGNORECASE), "a javascript: address"),
    (re.compile(r"\|\s*safe\b"), "an unescaped value (|safe)"),
    (re.compile(r"\{%-?\s*autoescape\s+false", re.IGNORECASE), "escaping switched off"),
)
_TAG = re.compile(r"<([a-zA-Z][\w-]*)\b([^<>]*)>", re.DOTALL)
_ATTRIBUTE = re.compile(r"""([\w:-]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""", re.DOTALL)


@dataclass(frozen=True)
class Address:
    """One address that a link, a form or htmx uses; HOLE stands for a value known only at run time."""

    method: str
    url: str

    @property
    def path(self) -> str:
        """Without query and fragment."""
        return re.split(r"[?#]", self.url)[0]


@cache
def template_texts() -> dict[str, str]:
    """Name relative to templates/ -> source text without Jinja comments."""
    found = sorted(TEMPLATES.rglob("*.html"))
    return {path.relative_to(TEMPLATES).as_posix(): uncommented(path.read_text(encoding="utf-8")) for path in found}


def uncommented(text: str) -> str:
    """The text without Jinja comments and HTML comments."""
    return re.sub(r"\{#.*?#\}|<!--.*?-->", "", text, flags=re.DOTALL)


def forbidden(text: str) -> Iterator[str]:
    """What a template must not contain under `default-src 'self'`."""
    bare = _holed(text)
    for pattern, name in FORBIDDEN:
        if pattern.search(bare) or pattern.search(text):
            yield name


def requests(text: str) -> Iterator[Address]:
    """Every address that htmx or a form sends to."""
    for tag, attributes in _tags(text):
        for name, method in HTMX_METHODS.items():
            if name in attributes:
                yield Address(method, attributes[name])
        if "hx-action" in attributes:
            yield Address(attributes.get("hx-method", "get").upper(), attributes["hx-action"])
        if tag == "form" and "action" in attributes:
            yield Address(attributes.get("method", "get").upper(), attributes["action"])
        if "formaction" in attributes:
            yield Address(attributes.get("formmethod", "post").upper(), attributes["formaction"])


def static_files(text: str) -> Iterator[str]:
    """Paths under /static/ that a template loads, by address or through `asset("css/base.css")`."""
    yield from (f"/static/{path}" for path in re.findall(r"""asset\(["']([^"']+)["']\)""", text))
    for _, attributes in _tags(text):
        for name in ("href", "src"):
            path = re.split(r"[?#]", attributes.get(name, ""))[0]
            if path.startswith("/static/") and HOLE not in path:
                yield path


def _tags(text: str) -> Iterator[tuple[str, dict[str, str]]]:
    for tag in _TAG.finditer(_holed(text)):
        attributes = {name.lower(): first or second for name, first, second in _ATTRIBUTE.findall(tag.group(2))}
        yield tag.group(1).lower(), attributes


def _holed(text: str) -> str:
    """The text with values replaced by holes and statements removed, so that quotes and angle brackets in them
    do no harm.
    """
    return re.sub(r"\{%.*?%\}", " ", re.sub(r"\{\{.*?\}\}", HOLE, text, flags=re.DOTALL), flags=re.DOTALL)
