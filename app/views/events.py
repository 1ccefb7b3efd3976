"""Pure: one event as it is stored, with its place in the hash chain."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from app.views.sentences import sentence
from app.views.shell import Shell
from app.views.timeline import Entry
from harness.contracts.errors import UnknownName


@dataclass(frozen=True)
class EventPage:
    """One event as it is stored, with its links in the hash chain."""

    shell: Shell
    mission_id: str
    entry: Entry
    text: str
    body: str
    earlier: int | None
    later: int | None


def event_page(shell: Shell, mission_id: str, entries: Sequence[Entry], *, position: int) -> EventPage:
    """Raises UnknownName if the mission has no event at that position."""
    place = next((index for index, entry in enumerate(entries) if entry.position == position), None)
    if place is None:
        raise UnknownName(f"Mission {mission_id} has no event {position}", do="choose one from its timeline")
    entry = entries[place]
    return EventPage(
        shell=shell,
        mission_id=mission_id,
        entry=entry,
        text=sentence(entry.event),
        body=json.dumps(msgspec.to_builtins(entry.event), indent=2, ensure_ascii=False),
        earlier=entries[place - 1].position if place else None,
        later=entries[place + 1].position if place + 1 < len(entries) else None,
    )
