"""Read models: lists that follow the log, so that a page costs the same with ten missions as with a hundred thousand.

A row is made by a projection from events alone and may be dropped at any time: the log rebuilds it byte for byte.
"""

from typing import Annotated, Literal

import msgspec

from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, Name, Value

Listing = Literal["mission", "evidence", "handoff"]
ListOrder = Literal["newest", "oldest", "largest"]
LISTINGS: tuple[Listing, ...] = ("mission", "evidence", "handoff")
MANY = 1000
"""A search with more results than this is not counted to its end."""


class MissionItem(Value):
    """One mission in a list. `seq` is the position of its first event; wall times in seconds since the Unix epoch."""

    seq: Count
    mission_id: str
    goal: str
    template: str
    robot_id: str
    status: str
    stage: Explanation
    verdict: str
    began_s: float
    ended_s: float | None
    spent: Count
    budget: Count
    handoff_id: str
    k: Count
    reading: Reason | msgspec.UnsetType = msgspec.UNSET
    """What the goal was read as; missing for a mission without a reading."""
    disputed: bool | msgspec.UnsetType = msgspec.UNSET
    """True where an accepted fact of it is disputed, else missing."""


class EvidenceItem(Value):
    """One piece of evidence of one packet, with the verifier's and the gate's decisions about that packet.

    `part` is before, after, estimates or receipt; a receipt's blob may be empty. Times are mission time.
    """

    seq: Count
    mission_id: str
    robot_id: str
    node_id: str
    packet_id: str
    part: str
    kind: str
    origin: str
    source: str
    from_s: float
    until_s: float
    blob: str
    verdict: str
    decision: str
    rule: str


class HandoffItem(Value):
    """One handoff in a list. `seq` is the position of its first event; wall times.

    `answered` is who decided and why, or how it ended; `holder` who has claimed it or controls the robot; `stage` the
    sentence of its stage in the contract, empty where the mission has none, bound with `names` by one of `templates`.
    """

    seq: Count
    handoff_id: str
    mission_id: str
    robot_id: str
    reason: Explanation
    answered: Explanation
    holder: str
    node_id: str
    stage: str
    templates: tuple[str, ...]
    names: dict[str, str]
    status: str
    failure: str
    opened_at_s: float
    deadline_at_s: float


class ListRow(Value):
    """What is stored of one item. `key` names the item from outside; `body` is its canonical JSON.

    It is filtered by `facets`, searched by the prefixes of `words` and by whole `ids`; `largest` sorts by `amount`.
    """

    listing: Listing
    seq: Count
    key: Name
    facets: dict[str, str]
    words: str
    amount: float
    body: bytes
    ids: tuple[str, ...] = ()


class Bookmark(Value):
    """Where a page of a list ended: the row's amount and its number."""

    amount: float
    seq: Count


class ListQuery(Value):
    """A query of a list: rows with every facet and, for each of `words`, that id or a word with that prefix."""

    listing: Listing
    facets: dict[str, str] = msgspec.field(default_factory=dict)
    words: tuple[str, ...] = ()
    order: ListOrder = "newest"
    after: Bookmark | None = None
    limit: Annotated[int, msgspec.Meta(ge=1, le=500)] = 50


class ListPage(Value):
    """Bodies of one page, and where the next one begins; None if this is the last."""

    bodies: tuple[bytes, ...]
    following: Bookmark | None


class FacetCount(Value):
    """How many rows of a list carry one value of one facet."""

    facet: str
    value: str
    count: Count
