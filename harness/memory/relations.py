"""Relates a new record to known ones: it supersedes, confirms or contradicts, and overwrites nothing (R142). Pure.

A newer record takes the place of an older one about the same thing, except where different sources can contradict
each other (sightings): there two sides of a contradiction are both disputed, and stay so until another source
looks again and confirms one of them (R69). A repeat by the same source settles nothing.
"""

from collections.abc import Sequence

from harness.contracts.memory import MemoryEntry, MemoryRecord, Sighting, Verification
from harness.memory.draft import MemoryDraft, recorded, same
from harness.memory.spatial import contradiction


def relate(
    draft: MemoryDraft, current: Sequence[MemoryEntry], *, disputed: Sequence[MemoryEntry] = ()
) -> MemoryRecord | None:
    """The record with its relations; None for configured knowledge that is already known.

    `current`: records of the same kind and subject that nothing has superseded. `disputed`: current records of the
    subjects that the draft disputes.
    """
    if draft.verification == "configured" and any(_known(draft, one) for one in current):
        return None
    if not draft.compared:
        return recorded(
            draft,
            supersedes=_names(current),
            conflicts=_names(disputed),
            verification=draft.verification,
        )
    return _compared(draft, current)


def _compared(draft: MemoryDraft, current: Sequence[MemoryEntry]) -> MemoryRecord:
    sources = draft.provenance.sources
    live = [one for one in current if not _expired(one, draft.valid_from_s)]
    others = [one for one in live if one.record.provenance.sources != sources]
    confirmed = [one for one in others if not _differs(draft, one)]
    if confirmed:
        return recorded(draft, supersedes=_names(current), conflicts=(), verification="verified")
    conflicts = _names(others)
    replaced = [name for name in _names(current) if name not in conflicts]
    verification: Verification = "disputed" if conflicts else draft.verification
    return recorded(draft, supersedes=replaced, conflicts=conflicts, verification=verification)


def _known(draft: MemoryDraft, one: MemoryEntry) -> bool:
    return one.standing == "configured" and same(one.record.knowledge, draft.knowledge)


def _expired(one: MemoryEntry, at_s: float) -> bool:
    return one.until_s is not None and one.until_s <= at_s


def _differs(draft: MemoryDraft, one: MemoryEntry) -> bool:
    mine, theirs = draft.knowledge, one.record.knowledge
    if isinstance(mine, Sighting) and isinstance(theirs, Sighting):
        return bool(contradiction(mine, theirs))
    return not same(mine, theirs)


def _names(records: Sequence[MemoryEntry]) -> tuple[str, ...]:
    return tuple(one.record.record_id for one in records)
