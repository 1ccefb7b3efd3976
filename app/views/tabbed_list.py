"""Shapes one page of a list with tabs and filters, whatever its rows are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.i18n.messages import lazy_gettext
from app.views import list_params
from app.views.shell import Shell
from harness.contracts.read_models import MANY, FacetCount, ListQuery
from harness.contracts.values import Value

Row = TypeVar("Row", bound=Value)
Group = tuple[str, str, dict[str, str]]
"""A tab: its value in the address, its title, and the facets it selects."""


@dataclass(frozen=True)
class ListShape:
    """What a list looks like: its address, its tabs, its filters (facet and title), and whether rows have a length."""

    path: str
    groups: tuple[Group, ...]
    filters: tuple[tuple[str, str], ...]
    by_length: bool


@dataclass(frozen=True)
class TabCounts:
    """How many rows each tab holds under the other filters, up to MANY + 1, and the values that filters offer."""

    groups: Mapping[str, int]
    tallies: Sequence[FacetCount]


@dataclass(frozen=True)
class ListTab:
    """One tab of the list: which filters it stands for, and how many rows it would show."""

    title: str
    href: str
    count: str
    chosen: bool


@dataclass(frozen=True)
class TabbedList(Generic[Row]):
    """One page of a list; search, filters, order and position are in the address. `live`: it refreshes itself."""

    shell: Shell
    rows: tuple[Row, ...]
    groups: tuple[ListTab, ...]
    filters: tuple[list_params.Filter, ...]
    paging: list_params.Paging
    words: str
    group: str
    live: bool
    query: str
    total: int


def tabbed_list(
    shell: Shell,
    shape: ListShape,
    params: list_params.ListParams,
    rows: Sequence[Row],
    following: ListQuery | None,
    counted: TabCounts,
) -> TabbedList[Row]:
    """The rows of one page, in the order they come in."""
    chosen = params.given.get("status", "")
    filters = [list_params.facet_filter(name, title, counted.tallies, params) for name, title in shape.filters]
    return TabbedList(
        shell=shell,
        rows=tuple(rows),
        groups=_tabs(shape, params, counted),
        filters=(*filters, list_params.order_filter(params, by_length=shape.by_length)),
        paging=list_params.paging(shape.path, params, following, count=len(rows), found=counted.groups[chosen]),
        words=params.words,
        group=chosen,
        live=not params.deep,
        query=list_params.address("", params.params),
        total=next((one.count for one in counted.tallies if not one.facet), 0),
    )


def _tabs(shape: ListShape, params: list_params.ListParams, counted: TabCounts) -> tuple[ListTab, ...]:
    return tuple(
        ListTab(
            title=title,
            href=list_params.address(shape.path, params.params, status=value),
            count=str(counted.groups[value])
            if counted.groups[value] <= MANY
            else lazy_gettext("over {many}", many=MANY),
            chosen=value == params.given.get("status", ""),
        )
        for value, title, _ in shape.groups
    )
