"""Shapes what the harness remembers beyond one mission, by role, each record with its source."""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.views.measures import Measure, fields
from app.views.shell import Shell
from harness.contracts.memory import MemoryEntry, MemoryRecord

TONES = {"disputed": "bad", "verified": "good"}
ROLES: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("spatial", N_("where things are"), ("map", "place", "region", "relation", "pose", "sighting", "dispute")),
    ("episodic", N_("what was tried"), ("episode",)),
    ("operational", N_("how providers did"), ("outcome",)),
    ("semantic", N_("contracts and rules"), ("card", "rules")),
)


@dataclass(frozen=True)
class RoleTab:
    """One role of memory."""

    value: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class MemoryPage:
    """Records of one role, newest first; at most `limit` are shown."""

    shell: Shell
    tabs: tuple[RoleTab, ...]
    rows: tuple[MemoryEntry, ...]
    subject: str
    everything: bool
    limit: int
    role: str


def kinds_of(role: str) -> tuple[str, ...]:
    """The kinds of records that a role keeps; empty for an unknown role."""
    return next((kinds for name, _, kinds in ROLES if name == role), ())


def memory_page(
    shell: Shell, role: str, found: Sequence[MemoryEntry], *, subject: str, everything: bool, limit: int
) -> MemoryPage:
    """`everything`: superseded records and sides of open conflicts too."""
    return MemoryPage(
        shell=shell,
        tabs=tuple(
            RoleTab(value=name, title=lazy_gettext("{role}: {title}", role=name, title=title), chosen=name == role)
            for name, title, _ in ROLES
        ),
        rows=tuple(found),
        subject=subject,
        everything=everything,
        limit=limit,
        role=role,
    )


def stated(record: MemoryRecord) -> tuple[Measure, ...]:
    """What a record says, field by field."""
    return tuple(fields(msgspec.to_builtins(record.knowledge)))
