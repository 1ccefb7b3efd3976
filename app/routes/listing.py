"""Turns the address of a list page into a query. Has no page of its own."""

from collections.abc import Callable
from typing import get_args

from fastapi import Request

from app.views.list_params import ListParams
from harness.contracts.errors import ContractInvalid
from harness.contracts.read_models import Bookmark, Listing, ListOrder, ListQuery
from harness.contracts.reasons import because

SHOWN = 50
LONGEST = 200


def searching(listing: Listing, *facets: str) -> Callable[[Request], ListParams]:
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
