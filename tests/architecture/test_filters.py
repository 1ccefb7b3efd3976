"""Checks that every template filter on items is used by a template."""

import re

from app.web.filters import ITEMS, VALUES
from tests.architecture.markup import template_texts


def test_every_filter_on_an_item_is_used_by_a_template() -> None:
    used = {name for text in template_texts().values() for name in re.findall(r"\|\s*(\w+)", text)}
    assert sorted(set(ITEMS) - used) == []


def test_no_filter_has_two_meanings() -> None:
    assert set(ITEMS) & set(VALUES) == set()
