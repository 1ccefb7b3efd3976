"""What every part of the API shares: how lists are paged, how failures and answers are described."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar
from urllib.parse import urlencode

import msgspec
from fastapi import APIRouter, Depends, Query, Request, Response, params
from starlette.responses import JSONResponse

from app.acts.base import ActModel
from app.background.lists import Slice
from app.i18n import languages
from app.routes.api_schemas import ProblemDocument
from app.routes.listing import bookmark
from app.web.errors import problem
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid
from harness.contracts.read_models import Bookmark, Listing, ListOrder, ListQuery
from harness.contracts.reasons import because
from harness.contracts.values import Value

Handler = Callable[..., Any]
Item = TypeVar("Item", bound=Value)
Row = TypeVar("Row")
Limit = Annotated[int, Query(ge=1, le=500)]
After = Annotated[str, Query(max_length=100, description="Where the page before ended: take it from its Link header.")]
Order = Annotated[ListOrder, Query()]
Words = Annotated[str, Query(max_length=200)]
Facet = Annotated[str, Query(max_length=200)]


@dataclass(frozen=True)
class ListRequest:
    """Which page of a list is asked for: its words, its order, where it begins, and at most how many rows."""

    q: str
    order: ListOrder
    after: str
    limit: int


def list_request(limit: int) -> Callable[..., ListRequest]:
    """The parameters that every list has. `limit` is how many rows are given where nobody says."""

    def request(q: Words = "", order: Order = "newest", after: After = "", limit: Limit = limit) -> ListRequest:
        return ListRequest(q=q, order=order, after=after, limit=limit)

    return request


ListRequestDep = Annotated[ListRequest, Depends(list_request(50))]
PROBLEM = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
MEANINGS = {
    400: "The request cannot be read.",
    401: "Nobody is known to ask.",
    403: "Whoever asks may not.",
    404: "There is nothing of that name.",
    409: "Refused by the gate, or decided already, or the idempotency key belongs to another request.",
    413: "More than one mebibyte.",
    422: "The request is not well formed, or what it asks for breaks a contract.",
    429: "Too many requests; Retry-After says when to go on.",
    503: "The store cannot be used.",
}
PROBLEMS: dict[int | str, dict[str, Any]] = {
    status: {"description": meaning, "content": PROBLEM} for status, meaning in MEANINGS.items()
}


def known_parameters(request: Request) -> None:
    """Refuse a parameter that the address does not have: a misspelt filter must not show everything."""
    route = request.scope["route"]
    parts = (route.dependant, *route.dependant.dependencies)
    known = {one.alias for part in parts for one in part.query_params}
    unknown = sorted(set(request.query_params) - known)
    if unknown:
        name = unknown[0][:40]
        reason = because("unknown_parameter", name=name, known=tuple(sorted(known)))
        raise ContractInvalid(reason if known else because("no_parameters_here", name=name), where=request.url.path)


CHECKED = [Depends(known_parameters)]


def router(tag: str, *, under: str = "", checks: Sequence[params.Depends] = ()) -> APIRouter:
    """The routes of one subject below /api/v1: JSON in, JSON or a problem out, unknown parameters refused.

    `checks` come beside, for each request to the subject.
    """
    return APIRouter(
        prefix=f"/api/v1{under}",
        default_response_class=JSONResponse,
        responses=PROBLEMS,
        dependencies=[*CHECKED, *checks],
        tags=[tag],
    )


ANSWERED: set[type] = {ProblemDocument}
"""Every struct that an operation answers with, or fails with: the description is derived from them."""


def answers(kind: type, *, status: int = 200, many: bool = False) -> dict[int | str, dict[str, Any]]:
    """For `responses=`: the answer has the shape of this struct, or is a list of them."""
    ANSWERED.add(kind)
    one = {"$ref": f"#/components/schemas/{kind.__name__}"}
    schema = {"type": "array", "items": one} if many else one
    return {status: {"description": "Done.", "content": {"application/json": {"schema": schema}}}}


def post_acts(
    router: APIRouter, path: str, acts: Mapping[str, type[ActModel]], make: Callable[[], Handler], *, answered: type
) -> None:
    """One POST below `path` for each act, at its verb. `make` returns a handler whose `body` is the act."""
    for verb, kind in acts.items():
        handler = make()
        handler.__annotations__["body"] = kind
        responses = answers(answered)
        router.post(f"{path}/{verb}", name=verb, description=kind.__doc__, responses=responses)(handler)


def place(after: str) -> Bookmark | None:
    """The position of a page in a list. Raises ContractInvalid for one that no page gave."""
    return bookmark(after) if after else None


def listed(
    response: Response,
    read: Callable[[ListQuery], Slice[Item]],
    listing: Listing,
    path: str,
    facets: Mapping[str, str],
    request: ListRequest,
) -> tuple[Item, ...]:
    """One page of a list under the facets that are set; the Link header leads to the next one."""
    chosen = {name: value for name, value in facets.items() if value}
    query = ListQuery(
        listing=listing,
        facets=chosen,
        words=tuple(request.q.split()),
        order=request.order,
        after=place(request.after),
        limit=request.limit,
    )
    found = read(query)
    order = "" if request.order == "newest" else request.order
    linked(response, f"/api/v1{path}", found, q=request.q, order=order, limit=str(request.limit), **chosen)
    return tuple(found.items)


def linked(response: Response, path: str, found: Slice[Any], **request: str) -> None:
    """Put the next page's address into the Link header (RFC 8288), if there is one."""
    mark = found.following.after if found.following else None
    if mark is not None:
        pairs = {name: value for name, value in request.items() if value}
        query = urlencode({**pairs, "after": f"{mark.amount!r}~{mark.seq}"})
        response.headers["Link"] = f'<{path}?{query}>; rel="next"'


def plain(value: Any) -> Any:
    """A contract's value or an answer as JSON: a reason is its code and facts, a message that is translated English."""
    return msgspec.to_builtins(value, enc_hook=_text)


def each(shape: Callable[[Row], Any], items: Iterable[Row]) -> Any:
    """A list as JSON, every item in the shape in which the API answers it."""
    return plain([shape(one) for one in items])


def _text(value: Any) -> str:
    if isinstance(value, str):
        return str(value)
    raise TypeError(f"{type(value).__name__} is no part of an answer")


def refusal(decision: Refused, *, do: str = "look at it again, then decide") -> Response:
    """A problem whose `code` and `rule` are the gate's rule; `reason` is code and facts, `detail` says it in words."""
    detail = languages.in_words(decision.reason)
    more = {"rule": decision.rule, "reason": msgspec.to_builtins(decision.reason)}
    return problem(409, code=decision.rule, title="Refused", detail=detail, do=do, more=more)
