"""Pure: handoffs as a list: those that wait and those that are over, searched, filtered, page by page."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.views.listing import Filter, Paging, Sought, address, facet_filter, order_filter, paging
from app.views.missions import Counted, Group, tabs
from app.views.shell import Shell
from harness.contracts.read_models import HandoffItem, ListQuery

PATH = "/handoffs"
GROUPS: tuple[tuple[str, str, dict[str, str]], ...] = (
    ("", "all", {}),
    ("waiting", "waiting for a person", {"open": "yes"}),
    ("ended", "answered or over", {"open": "no"}),
    ("expired", "nobody answered", {"status": "expired"}),
)
"""Tabs of the list: the word in the address, its title, and the facets it stands for."""


@dataclass(frozen=True)
class HandoffsPage:
    """One page of the list; search, filters, order and place stand in the address. `live`: it follows what happens."""

    shell: Shell
    rows: tuple[HandoffItem, ...]
    groups: tuple[Group, ...]
    filters: tuple[Filter, ...]
    paging: Paging
    words: str
    group: str
    live: bool
    query: str
    total: int


def handoffs_page(
    shell: Shell, sought: Sought, items: Sequence[HandoffItem], following: ListQuery | None, counted: Counted
) -> HandoffsPage:
    """The rows of one page, in the order they come in."""
    chosen = sought.given.get("status", "")
    return HandoffsPage(
        shell=shell,
        rows=tuple(items),
        groups=tabs(PATH, GROUPS, sought, counted),
        filters=(
            facet_filter("robot", "robot", counted.tallies, sought),
            facet_filter("failure", "why", counted.tallies, sought),
            order_filter(sought, by_length=False),
        ),
        paging=paging(PATH, sought, following, shown=len(items), found=counted.groups[chosen]),
        words=sought.words,
        group=chosen,
        live=not sought.deep,
        query=address("", sought.params),
        total=next((one.count for one in counted.tallies if not one.facet), 0),
    )
