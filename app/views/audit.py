"""Pure: who decided what, when, by which channel; and who came in."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from app.messages import listed
from app.views.shell import Shell
from harness.contracts.ports import Head, StoredEvent


@dataclass(frozen=True)
class Deed:
    """One event of the log. `actor` is empty where nobody asked for it: the harness or a robot brought it about.

    `mission_id` and `robot_id` are empty where the event names none.
    """

    position: int
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
class AuditPage:
    """Newest first, below `before`. `verified` is empty unless it was asked for; `damage` says what does not verify."""

    shell: Shell
    position: int
    digest: str
    deeds: tuple[Deed, ...]
    actor: str
    kind: str
    everything: bool
    scanned_from: int
    older: int
    verified: str
    damage: str
    keeps_trail: bool


@dataclass(frozen=True)
class TrailRow:
    """One line of the access trail."""

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
    """Who came in, from where, and what they commanded; newest first."""

    shell: Shell
    rows: tuple[TrailRow, ...]
    actor: str
    kind: str
    older: int
    verified: str
    damage: str


@dataclass(frozen=True)
class Wanted:
    """What an auditor looks for: an actor, a kind of event; `everything` shows events that nobody asked for too."""

    actor: str = ""
    kind: str = ""
    everything: bool = False

    def fits(self, deed: Deed) -> bool:
        if self.actor and self.actor.lower() not in deed.actor.lower():
            return False
        if self.kind and self.kind.lower() not in deed.kind.lower():
            return False
        return bool(deed.actor) or self.everything or bool(self.kind)


@dataclass(frozen=True)
class Sum:
    """What a recomputed chain said: one of the two is empty."""

    verified: str = ""
    damage: str = ""


def deed(stored: StoredEvent) -> Deed:
    """One event with whoever asked for it."""
    body: dict[str, Any] = msgspec.json.decode(stored.body)
    actor = body.get("actor") or body.get("requested_by") or {}
    family, _, name = stored.stream.partition("/")
    return Deed(
        position=stored.position,
        at_s=stored.recorded_s,
        kind=stored.kind,
        stream=stored.stream,
        mission_id=name if family == "mission" else str(body.get("mission_id", "")),
        robot_id=str(body.get("robot_id", "")),
        actor=str(actor.get("name", "")),
        role=listed(str(actor.get("role", "")).split("+")),
        channel=str(actor.get("channel", "human")) if actor else "",
        reason=str(body.get("reason", "")),
        digest=stored.digest,
    )


def audit_page(
    shell: Shell, head: Head, deeds: Sequence[Deed], wanted: Wanted, *, scanned_from: int, keeps_trail: bool, found: Sum
) -> AuditPage:
    """`scanned_from`: the lowest position that was looked at; older events may hold more."""
    return AuditPage(
        shell=shell,
        position=head.position,
        digest=head.digest,
        deeds=tuple(deeds),
        actor=wanted.actor,
        kind=wanted.kind,
        everything=wanted.everything,
        scanned_from=scanned_from,
        older=scanned_from if scanned_from > 1 else 0,
        verified=found.verified,
        damage=found.damage,
        keeps_trail=keeps_trail,
    )
