"""Compiled contexts C1 to C4: the only state a role is shown (R67), stored with each decision (R77)."""

from collections.abc import Callable
from functools import cached_property
from typing import Any, Literal, TypeVar

import msgspec

from harness.contracts import values
from harness.contracts.ids import Digest, MissionId, NodeId, sha256
from harness.contracts.observations import Origin
from harness.contracts.reasons import Explanation

Role = Literal["planner", "skill", "verifier", "recovery"]
Blobs = Callable[[Digest], bytes]
"""Content-addressed bytes cited by a context: immutable, so not state."""

T = TypeVar("T")


class ContextRecord(values.Value):
    """One item. `value` is a contract value as JSON (see `raw`); `blob` cites bulk bytes (trajectory, image, scan)."""

    kind: values.Name
    origin: Origin
    source: values.Name
    at_s: float
    value: msgspec.Raw
    confidence: values.Share = 1.0
    mandatory: bool = False
    blob: Digest | None = None

    def read(self, kind: type[T]) -> T:
        """The value as its contract type; raises msgspec.ValidationError if it is another."""
        return msgspec.json.decode(self.value, type=kind)

    @property
    def content(self) -> Any:
        """The value as JSON builtins."""
        return msgspec.json.decode(self.value)


class Withheld(values.Value):
    """What the compiler left out, and why: stale, low_confidence, conflict, origin, budget, superseded."""

    kind: values.Name
    source: values.Name
    reason: Literal["stale", "low_confidence", "conflict", "origin", "budget", "superseded", "scope"]
    detail: Explanation = ""


class Context(values.Value, dict=True, gc=True):
    """A role's view of one state version. `at_s` is the mission time it describes."""

    role: Role
    mission_id: MissionId
    node_id: NodeId | None
    k: values.Count
    at_s: float
    configuration: Digest
    records: tuple[ContextRecord, ...]
    withheld: tuple[Withheld, ...] = ()

    @cached_property
    def body(self) -> bytes:
        """The context as it is stored; encoded once."""
        return values.encode(self)

    @cached_property
    def digest(self) -> Digest:
        """The digest that identifies the context by its content; computed once."""
        return sha256(self.body)

    def all(self, kind: str) -> tuple[ContextRecord, ...]:
        return tuple(record for record in self.records if record.kind == kind)

    def one(self, kind: str) -> ContextRecord | None:
        return next((record for record in self.records if record.kind == kind), None)
