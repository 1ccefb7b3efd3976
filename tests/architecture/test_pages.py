"""Checks that page classes and templates agree: no template reads a missing field, and no field is unread."""

import inspect
import re
from dataclasses import dataclass
from typing import Generic, TypeVar

import jinja2

from tests.architecture.markup import TEMPLATES, template_texts
from tests.architecture.pages import Reading, fields_of, inside
from tests.architecture.renderings import renderings
from tests.architecture.sources import module, modules


@dataclass(frozen=True)
class Row:
    """A row of the page below."""

    name: str
    age_s: float


@dataclass(frozen=True)
class Page:
    """A page that the examples below read."""

    title: str
    rows: tuple[Row, ...]
    best: Row | None


Item = TypeVar("Item")


@dataclass(frozen=True)
class Listed(Generic[Item]):
    """A page of rows of any kind."""

    rows: tuple[Item, ...]


def read(**templates: str) -> Reading:
    """Follow `index` with a page."""
    loader = jinja2.DictLoader({name.replace("__", "/"): text for name, text in templates.items()})
    reading = Reading(jinja2.Environment(loader=loader, autoescape=True))
    reading.template("index", {"page": Page})
    return reading


def unread(reading: Reading, kinds: set[type], *, elsewhere: set[str]) -> list[str]:
    """Fields of these classes that no template and no code reads."""
    known = reading.names | elsewhere
    return sorted(
        f"{kind.__name__}.{name}"
        for kind in kinds
        for name in fields_of(kind)
        if (kind, name) not in reading.fields and name not in known | computed_from(kind)
    )


def computed_from(kind: type) -> set[str]:
    """Fields that the class's own properties read."""
    return set(re.findall(r"(?<=self\.)\w+", inspect.getsource(kind)))


def test_templates_and_page_classes_agree_both_ways() -> None:
    if not template_texts():
        return
    views = [source for source in modules("app/views") if not source.is_init]
    found = [rendering for source in modules("app") for rendering in renderings(source)]
    assert found, "templates exist, but nothing in app/ renders one"
    assert [f"{item.where}: the page's class cannot be seen" for item in found if item.page is None] == []
    reading = Reading(
        jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True, extensions=["jinja2.ext.i18n"])
    )
    pages = {kind for item in found if item.page for kind in inside(item.page) if kind.__module__.startswith("app.")}
    for item in found:
        reading.template(item.template, {"page": item.page})
    code = [source for source in modules("app") if source not in views]
    in_code = {name for source in code for name in re.findall(r"(?<=\.)[a-z]\w*", source.text)}
    assert sorted(reading.wrong) == []
    assert unread(reading, pages, elsewhere=in_code) == []


def test_a_class_that_is_given_its_rows_is_followed_to_them() -> None:
    reading = Reading(
        jinja2.Environment(
            loader=jinja2.DictLoader({"index": "{% for one in page.rows %}{{ one.colour }}{% endfor %}"})
        )
    )
    reading.template("index", {"page": Listed[Row]})
    assert reading.wrong == {"index reads colour, which Row does not offer"}


def test_a_rendering_is_seen_with_the_class_of_its_page() -> None:
    text = """
def show(desk: Desk):
    page = Page("t", (), None)
    render("a.html", page, status=2)
    render("_b.html", page=some_page(x))
    render("_c.html", desk.best())
    render("_d.html", something())
"""
    seen = list(renderings(module("tests/architecture/test_pages.py", text)))
    kinds = [(item.template, item.page.__name__ if item.page else "") for item in seen]
    assert kinds == [("a.html", "Page"), ("_b.html", "Page"), ("_c.html", "Row"), ("_d.html", "")]


class Desk:
    """The parameter of a handler in the example above."""

    def best(self) -> Row:
        """A row that the page exposes as a property."""
        return Row(name="", age_s=0.0)


def some_page(text: str) -> Page | None:
    """A view of the example above."""
    return Page(title=text, rows=(), best=None) if text else None


def test_a_name_that_the_page_does_not_offer_is_found() -> None:
    assert read(index="{{ page.titel }}").wrong == {"index reads titel, which Page does not offer"}


def test_a_wrong_name_is_found_in_a_loop_an_include_and_a_macro() -> None:
    assert read(index="{% for row in page.rows %}{{ row.nam }}{% endfor %}").wrong
    assert read(index="{% include '_part' %}", _part="{{ page.nope }}").wrong
    assert read(index="{% extends 'base' %}", base="{{ page.nope }}").wrong
    macro = "{% macro show(row) %}{{ row.nope }}{% endmacro %}"
    assert read(index="{% from 'm' import show %}{{ show(page.best) }}", m=macro).wrong
    assert read(index="{% import 'm' as m %}{{ m.show(page.rows[0]) }}", m=macro).wrong


def test_right_names_are_free() -> None:
    text = (
        "{{ page.title }}{% for row in page.rows|sort(attribute='age_s') %}{{ row.name }}{{ loop.index }}{% endfor %}"
    )
    reading = read(index=text + "{% if page.best %}{{ page.best.age_s|round }}{% endif %}")
    assert reading.wrong == set()
    assert unread(reading, {Page, Row}, elsewhere=set()) == []


def test_a_field_that_nobody_reads_is_found() -> None:
    reading = read(index="{{ page.title }}{% for row in page.rows %}{{ row.name }}{% endfor %}")
    assert unread(reading, {Page, Row}, elsewhere=set()) == ["Page.best", "Row.age_s"]
