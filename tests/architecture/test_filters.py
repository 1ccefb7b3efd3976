"""Checks that every template filter on items is used by a template, and that every filter in use is defined."""

import re

from jinja2 import nodes

from app.web.filters import ITEMS, VALUES
from app.web.rendering import TEMPLATES
from tests.architecture.markup import template_texts


def test_every_filter_on_an_item_is_used_by_a_template() -> None:
    used = {name for text in template_texts().values() for name in re.findall(r"\|\s*(\w+)", text)}
    assert sorted(set(ITEMS) - used) == []


def test_no_filter_has_two_meanings() -> None:
    assert set(ITEMS) & set(VALUES) == set()


def missing(text: str) -> set[str]:
    """Filters that a template uses and nobody defines: Jinja finds one inside a condition only when it is reached."""
    return {node.name for node in TEMPLATES.parse(text).find_all(nodes.Filter)} - set(TEMPLATES.filters)


def test_every_filter_that_a_template_uses_is_defined() -> None:
    found = {name: missing(text) for name, text in template_texts().items()}
    assert {name: filters for name, filters in found.items() if filters} == {}


def test_a_filter_that_nobody_defines_is_found() -> None:
    assert missing("{% if one %}{{ one | no_such_filter }}{% endif %}") == {"no_such_filter"}
