"""Pure: what the harness remembers beyond one mission, by role, each record with where it came from."""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from app.messages import N_, lazy_gettext, listed, word
from app.views.measures import Measure, fields
from app.views.shell import Shell
from harness.contracts.memory import Remembered

ROLES: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("spatial", N_("where things are"), ("map", "place", "region", "relation", "pose", "sighting", "dispute")),
    ("episodic", N_("what was tried"), ("episode",)),
    ("operational", N_("how providers did"), ("outcome",)),
    ("semantic", N_("contracts and rules"), ("card", "rules")),
)
AT_ONCE = 8
"""How many fields of a record are shown before a person asks for the others."""


@dataclass(frozen=True)
class RoleTab:
    """One role of memory."""

    value: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class RecordRow:
    """One record. `position` is the event that caused it, 0 for a mission that the record does not name."""

    record_id: str
    kind: str
    subject: str
    standing: str
    tone: str
    fields: tuple[Measure, ...]
    others: tuple[Measure, ...]
    confidence: float
    from_s: float
    until_s: float | None
    mission_id: str
    position: int
    sources: str
    supersedes: int
    conflicts: int


@dataclass(frozen=True)
class MemoryPage:
    """Records of one role, newest first; at most `limit` are shown."""

    shell: Shell
    tabs: tuple[RoleTab, ...]
    rows: tuple[RecordRow, ...]
    subject: str
    everything: bool
    limit: int
    role: str


def kinds_of(role: str) -> tuple[str, ...]:
    """The kinds of records that a role keeps; empty for an unknown role."""
    return next((kinds for name, _, kinds in ROLES if name == role), ())


def memory_page(
    shell: Shell, role: str, found: Sequence[Remembered], *, subject: str, everything: bool, limit: int
) -> MemoryPage:
    """`everything`: superseded records and sides of open conflicts too."""
    return MemoryPage(
        shell=shell,
        tabs=tuple(
            RoleTab(value=name, title=lazy_gettext("{role}: {title}", role=name, title=title), chosen=name == role)
            for name, title, _ in ROLES
        ),
        rows=tuple(_row(one) for one in found),
        subject=subject,
        everything=everything,
        limit=limit,
        role=role,
    )


def _row(remembered: Remembered) -> RecordRow:
    record = remembered.record
    stated = tuple(fields(msgspec.to_builtins(record.knowledge)))
    return RecordRow(
        record_id=record.record_id,
        kind=record.kind,
        subject=record.subject,
        standing=remembered.standing,
        tone={"disputed": "bad", "superseded": "plain", "verified": "good"}.get(remembered.standing, "plain"),
        fields=stated[:AT_ONCE],
        others=stated[AT_ONCE:],
        confidence=record.confidence,
        from_s=record.valid_from_s,
        until_s=remembered.until_s,
        mission_id=record.provenance.mission_id,
        position=record.provenance.position,
        sources=listed(map(word, record.provenance.sources)),
        supersedes=len(record.supersedes),
        conflicts=len(record.conflicts),
    )
