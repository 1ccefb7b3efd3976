"""Turns the address of a list page into a query. Has no page of its own."""

from collections.abc import Callable
from typing import get_args

from fastapi import Request
from msgspec.structs import replace

from app.background.lists import Lists, Slice
from app.views.list_params import ListParams
from app.views.shell import Shell
from app.views.tabbed_list import ListShape, Row, TabbedList, TabCounts, tabbed_list
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.read_models import Bookmark, Listing, ListOrder, ListQuery
from harness.contracts.reasons import because

SHOWN = 50
LONGEST = 200


def list_params(listing: Listing, *facets: str) -> Callable[[Request], ListParams]:
    """Reads q, order, after and these filters from the address; raises ContractInvalid for an invalid position."""

    def params(request: Request) -> ListParams:
        params = request.query_params
        given = {name: params[name][:LONGEST] for name in facets if params.get(name)}
        words = params.get("q", "")[:LONGEST].strip()
        after = params.get("after", "")
        query = ListQuery(
            listing=listing,
            facets=given,
            words=tuple(words.split()),
            order=order_of(params.get("order") or "newest"),
            after=bookmark(after) if after else None,
            limit=SHOWN,
        )
        return ListParams(query=query, words=words, given=given, deep=bool(after))

    return params


def listed_page(
    lists: Lists,
    shape: ListShape,
    shell: Shell,
    params: ListParams,
    read: Callable[[ListQuery], Slice[Row]],
) -> TabbedList[Row]:
    """One page of a list, with what its tabs would show. Raises UnknownName for an unknown tab."""
    group = params.given.get("status", "")
    facets = {name: value for name, value in params.query.facets.items() if name != "status"}
    queries = {value: replace(params.query, facets=facets | selected) for value, _, selected in shape.groups}
    if group not in queries:
        raise UnknownName(because("unknown_tab", group=group))
    found = read(queries[group])
    tallies = lists.tallies(params.query.listing)
    counted = TabCounts(groups={value: lists.count(one) for value, one in queries.items()}, tallies=tallies)
    return tabbed_list(shell, shape, params, found.items, found.following, counted)


def order_of(text: str) -> ListOrder:
    """The order of a list. Raises ContractInvalid for an unknown one."""
    for order in get_args(ListOrder):
        if order == text:
            known: ListOrder = order
            return known
    raise ContractInvalid(because("list_order_invalid", text=text[:40]), where="order")


def bookmark(text: str) -> Bookmark:
    """The position in a list. Raises ContractInvalid for one that no page gave."""
    amount, _, seq = text.partition("~")
    try:
        return Bookmark(amount=float(amount), seq=int(seq))
    except ValueError as error:
        raise ContractInvalid(because("list_cursor_invalid", text=text[:40]), where="after") from error
