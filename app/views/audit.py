"""Shapes the audit log: who decided what, when and by which channel; and who signed in."""

from dataclasses import dataclass
from typing import Any

import msgspec

from app.i18n.messages import listed, reasoned
from app.views.shell import Shell
from harness.contracts.anchors import AnchorFinding
from harness.contracts.ports import LogHead, StoredEvent
from harness.contracts.reasons import Reason
from harness.contracts.upcasting import name_of
from harness.contracts.values import Count, Value


class AuditEvent(Value):
    """One event of the log. `actor` is empty where nobody asked for it: the harness or a robot brought it about.

    `mission_id` and `robot_id` are empty where the event names none.
    """

    position: Count
    at_s: float
    kind: str
    stream: str
    mission_id: str
    robot_id: str
    actor: str
    role: str
    channel: str
    reason: str
    digest: str


@dataclass(frozen=True)
class AuditFilter:
    """The filter of the audit log: actor and kind of event; `everything` includes events without an actor."""

    actor: str = ""
    kind: str = ""
    everything: bool = False

    def fits(self, entry: AuditEvent) -> bool:
        if self.actor and self.actor.lower() not in entry.actor.lower():
            return False
        if self.kind and self.kind.lower() not in entry.kind.lower():
            return False
        return bool(entry.actor) or self.everything or bool(self.kind)


@dataclass(frozen=True)
class Sum:
    """The result of recomputing the hash chain: one of the two is empty. `note` is a remark for the auditor."""

    verified: str = ""
    damage: str = ""
    note: str = ""


@dataclass(frozen=True)
class GivenAnchor:
    """Anchors that a person pasted or gave as a `file`, the key that must have signed them, and how the log compares.

    `found` are those of the `total` that are shown; `problem` is set where the text is no anchor.
    """

    text: str = ""
    key: str = ""
    found: tuple[AnchorFinding, ...] = ()
    problem: str = ""
    total: int = 0
    file: bool = False


def entry(stored: StoredEvent) -> AuditEvent:
    """One event with whoever asked for it."""
    body: dict[str, Any] = msgspec.json.decode(stored.body)
    actor = body.get("actor") or body.get("requested_by") or {}
    family, _, name = stored.stream.partition("/")
    return AuditEvent(
        position=stored.position,
        at_s=stored.recorded_s,
        kind=name_of(stored.kind),
        stream=stored.stream,
        mission_id=name if family == "mission" else str(body.get("mission_id", "")),
        robot_id=str(body.get("robot_id") or ""),
        actor=str(actor.get("name", "")),
        role=listed(str(actor.get("role", "")).split("+")),
        channel=str(actor.get("channel", "human")) if actor else "",
        reason=_reason(body.get("reason", "")),
        digest=stored.digest,
    )


def _reason(stored: Any) -> str:
    """What the event was stored with: a person's words, or a code with its facts."""
    return reasoned(msgspec.convert(stored, Reason)) if isinstance(stored, dict) else str(stored)


@dataclass(frozen=True)
class AuditPage:
    """Newest first, down to `scanned_from`, the lowest position that was looked at; older events may hold more."""

    shell: Shell
    head: LogHead
    decisions: tuple[AuditEvent, ...]
    wanted: AuditFilter
    scanned_from: int
    found: Sum
    anchor: GivenAnchor
    keeps_trail: bool


@dataclass(frozen=True)
class AuditRow:
    """One line of the access log."""

    number: int
    at_s: float
    kind: str
    actor: str
    role: str
    subject: str
    detail: str
    source: str


@dataclass(frozen=True)
class AccessPage:
    """The access log: who signed in from where and what they commanded, newest first."""

    shell: Shell
    rows: tuple[AuditRow, ...]
    wanted: AuditFilter
    older: int
    found: Sum
