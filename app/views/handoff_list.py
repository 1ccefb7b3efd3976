"""Pure: handoffs as a list: those that wait and those that are over, searched, filtered, page by page."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.views import list_params
from app.views.missions import Counted, ListTab, tabs
from app.views.shell import Shell
from harness.contracts.read_models import HandoffItem, ListQuery

PATH = "/handoffs"
GROUPS: tuple[tuple[str, str, dict[str, str]], ...] = (
    ("", "all", {}),
    ("waiting", N_("waiting for a person"), {"open": "yes"}),
    ("ended", N_("answered or over"), {"open": "no"}),
    ("expired", N_("nobody answered"), {"status": "expired"}),
)
"""Tabs of the list: the word in the address, its title, and the facets it stands for."""


@dataclass(frozen=True)
class HandoffsPage:
    """One page of the list; search, filters, order and place stand in the address. `live`: it follows what happens."""

    shell: Shell
    rows: tuple[HandoffItem, ...]
    groups: tuple[ListTab, ...]
    filters: tuple[list_params.Filter, ...]
    paging: list_params.Paging
    words: str
    group: str
    live: bool
    query: str
    total: int


def handoffs_page(
    shell: Shell,
    params: list_params.ListParams,
    items: Sequence[HandoffItem],
    following: ListQuery | None,
    counted: Counted,
) -> HandoffsPage:
    """The rows of one page, in the order they come in."""
    chosen = params.given.get("status", "")
    return HandoffsPage(
        shell=shell,
        rows=tuple(items),
        groups=tabs(PATH, GROUPS, params, counted),
        filters=(
            list_params.facet_filter("robot", "robot", counted.tallies, params),
            list_params.facet_filter("failure", "why", counted.tallies, params),
            list_params.order_filter(params, by_length=False),
        ),
        paging=list_params.paging(PATH, params, following, shown=len(items), found=counted.groups[chosen]),
        words=params.words,
        group=chosen,
        live=not params.deep,
        query=list_params.address("", params.params),
        total=next((one.count for one in counted.tallies if not one.facet), 0),
    )
