"""Shapes the list of a mission's events, and the page of one event as it is stored in the hash chain."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from app.views.list_params import Paging, address
from app.views.sentences import FAMILY, sentence
from app.views.shell import Shell
from app.views.timeline import LANES, TimelineEntry
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because

SHOWN = 100


@dataclass(frozen=True)
class EventPage:
    """One event as it is stored, with its links in the hash chain."""

    shell: Shell
    mission_id: str
    entry: TimelineEntry
    body: str
    earlier: int | None
    later: int | None


def event_page(shell: Shell, mission_id: str, entries: Sequence[TimelineEntry], *, position: int) -> EventPage:
    """The page of one event. Raises UnknownName if the mission has no event at that position."""
    place = next((index for index, entry in enumerate(entries) if entry.position == position), None)
    if place is None:
        raise UnknownName(because("unknown_event", mission_id=mission_id, position=position))
    entry = entries[place]
    return EventPage(
        shell=shell,
        mission_id=mission_id,
        entry=entry,
        body=json.dumps(msgspec.to_builtins(entry.event), indent=2, ensure_ascii=False),
        earlier=entries[place - 1].position if place else None,
        later=entries[place + 1].position if place + 1 < len(entries) else None,
    )


@dataclass(frozen=True)
class EventQuery:
    """Which events are asked for: those with every word, of one family, after a position."""

    words: str = ""
    family: str = ""
    after: int = 0


@dataclass(frozen=True)
class FamilyTab:
    """One family of events as a filter."""

    title: str
    href: str
    chosen: bool


@dataclass(frozen=True)
class LogPage:
    """One page of a mission's events, oldest first; search, filter and position are in the address.

    `begin_s` is the mission time of the first event.
    """

    shell: Shell
    mission_id: str
    entries: tuple[TimelineEntry, ...]
    begin_s: float
    families: tuple[FamilyTab, ...]
    words: str
    family: str
    total: int
    paging: Paging


def log_page(shell: Shell, mission_id: str, entries: Sequence[TimelineEntry], query: EventQuery) -> LogPage:
    """The events whose kind, sentence or position contains every word of the query."""
    path = f"/missions/{mission_id}/log"
    words = query.words.lower().split()
    params = {"q": query.words, "family": query.family}
    chosen = [entry for entry in entries if query.family in ("", FAMILY[entry.kind])]
    found = [entry for entry in chosen if all(word in _text(entry) for word in words)] if words else chosen
    rest = [entry for entry in found if entry.position > query.after]
    part = rest[:SHOWN]
    return LogPage(
        shell=shell,
        mission_id=mission_id,
        entries=tuple(part),
        begin_s=entries[0].mission_s,
        families=tuple(
            FamilyTab(title=title, href=address(path, params, family=name), chosen=name == query.family)
            for name, title in (("", "all"), *LANES)
        ),
        words=query.words,
        family=query.family,
        total=len(entries),
        paging=Paging(
            shown=len(part),
            found=str(len(found)),
            following=address(path, params, after=str(part[-1].position)) if len(rest) > SHOWN else "",
            first=address(path, params) if query.after else "",
        ),
    )


def _text(entry: TimelineEntry) -> str:
    return f"e-{entry.position} {entry.kind} {sentence(entry.event)}".lower()
