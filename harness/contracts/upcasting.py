"""Brings events of earlier releases to today's shape when they are read; stored events are never rewritten. Pure.

A stored kind is an event's name, and from its second shape on `Name@2`, `Name@3`. Whoever changes an event's shape or
meaning adds an `Upcaster` from the old kind to the new one; from then on the new kind is written.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from harness.contracts.reasons import RECORDED

Body = dict[str, Any]
"""A stored event's JSON object; `kind` in it is the event's name."""


@dataclass(frozen=True)
class Upcaster:
    """`upcast` returns a body of the stored kind `new` made from one of `old`, and leaves its argument unchanged."""

    old: str
    new: str
    upcast: Callable[[Body], Body]


def _reason_recorded(body: Body) -> Body:
    """A reason that was one English sentence."""
    return body | {"reason": _recorded(body["reason"])}


def _rejection_recorded(body: Body) -> Body:
    """The sentence of a refusing rule was called its message."""
    fields = {name: value for name, value in body.items() if name != "message"}
    return fields | {"reason": _recorded(body["message"])}


def _recorded(text: str) -> Body:
    return {"code": RECORDED, "facts": {"text": text}}


UPCASTERS: tuple[Upcaster, ...] = (
    Upcaster("CommitRejected", "CommitRejected@2", _rejection_recorded),
    Upcaster("NoAnswerTaken", "NoAnswerTaken@2", _reason_recorded),
    Upcaster("RetreatEnded", "RetreatEnded@2", _reason_recorded),
)
"""Of every release so far, by the event's name: reasons were English sentences in the first shapes."""


class Upcasting:
    """The chain from every stored kind to the one written today. Raises ValueError for a chain that forks or cycles.

    A name's newest kind is the one that no upcaster leaves.
    """

    def __init__(self, upcasters: Iterable[Upcaster]) -> None:
        steps: dict[str, Upcaster] = {}
        for step in upcasters:
            if step.old in steps:
                raise ValueError(f"two upcasters leave {step.old}")
            steps[step.old] = step
        self._steps: Mapping[str, Upcaster] = MappingProxyType(steps)
        self._written = {name_of(kind): kind for kind in map(self._newest, steps)}

    def written(self, name: str) -> str:
        """The stored kind under which events of that name are written today."""
        return self._written.get(name, name)

    def is_old(self, kind: str) -> bool:
        """Whether events of that stored kind must be upcast before they are read."""
        return kind in self._steps

    def brought_up(self, kind: str, body: Body) -> Body:
        """The body of that stored kind, upcast to the newest one."""
        while step := self._steps.get(kind):
            kind, body = step.new, step.upcast(body) | {"kind": name_of(step.new)}
        return body

    def _newest(self, kind: str) -> str:
        seen = {kind}
        while step := self._steps.get(kind):
            kind = step.new
            if kind in seen:
                raise ValueError(f"the upcasters of {kind} turn in a circle")
            seen.add(kind)
        return kind


def name_of(kind: str) -> str:
    """The event's name in a stored kind: NodeCommitted in NodeCommitted@2."""
    return kind.partition("@")[0]
