"""What every list page shares: search, filters and order in the address, and the link to the next page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, word
from harness.contracts.read_models import MANY, FacetCount, ListQuery

ORDERS: tuple[tuple[str, str], ...] = (("newest", N_("newest first")), ("oldest", N_("oldest first")))
BY_LENGTH = ("largest", N_("longest first"))
PLAIN = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._~")


@dataclass(frozen=True)
class Option:
    """One value of a filter; `count` is how many rows of the whole list carry it, 0 where that is not said."""

    value: str
    title: str
    count: int
    chosen: bool


@dataclass(frozen=True)
class Filter:
    """One filter: a select in the form above the list."""

    name: str
    title: str
    options: tuple[Option, ...]


@dataclass(frozen=True)
class ListParams:
    """What the address asks for. `given` are the filters that are set; `deep` is false on the first page."""

    query: ListQuery
    words: str
    given: Mapping[str, str]
    deep: bool

    @property
    def params(self) -> dict[str, str]:
        """The parameters of the address, without the position in the list."""
        pairs = {"q": self.words, **self.given}
        if self.query.order != "newest":
            pairs["order"] = self.query.order
        return {name: value for name, value in pairs.items() if value}


@dataclass(frozen=True)
class Paging:
    """The addresses of the next page and of the first; empty where there is none."""

    shown: int
    found: str
    following: str
    first: str


def address(path: str, params: Mapping[str, str], **changes: str) -> str:
    """The path with these parameters, changed; empty ones are left out."""
    query = {name: value for name, value in {**params, **changes}.items() if value}
    return f"{path}?{'&'.join(f'{name}={_quoted(value)}' for name, value in query.items())}" if query else path


def paging(path: str, params: ListParams, following: ListQuery | None, *, count: int, found: int) -> Paging:
    """`found` counts up to MANY + 1."""
    after = following.after if following is not None else None
    return Paging(
        shown=count,
        found=lazy_gettext("more than {many}", many=f"{MANY:,}".replace(",", " ")) if found > MANY else str(found),
        following=address(path, params.params, after=f"{after.amount!r}~{after.seq}") if after is not None else "",
        first=address(path, params.params) if params.deep else "",
    )


def facet_filter(name: str, title: str, tallies: Sequence[FacetCount], params: ListParams) -> Filter:
    """A filter over the values that the list has, and the one that was asked for."""
    chosen = params.given.get(name, "")
    known = [(one.value, one.count) for one in tallies if one.facet == name]
    if chosen and chosen not in dict(known):
        known.append((chosen, 0))
    options = [Option(value="", title="any", count=0, chosen=not chosen)]
    options += [Option(value=value, title=word(value), count=count, chosen=value == chosen) for value, count in known]
    return Filter(name=name, title=title, options=tuple(options))


def order_filter(params: ListParams, *, by_length: bool) -> Filter:
    """A filter that chooses the order of the rows."""
    orders = (*ORDERS, BY_LENGTH) if by_length else ORDERS
    options = tuple(
        Option(value="" if value == "newest" else value, title=title, count=0, chosen=value == params.query.order)
        for value, title in orders
    )
    return Filter(name="order", title="order", options=options)


def _quoted(text: str) -> str:
    """A text percent-encoded for an address."""
    return "".join(chr(one) if chr(one) in PLAIN else f"%{one:02X}" for one in text.encode())
