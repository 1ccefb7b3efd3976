"""Pure: a mission's history as lanes on one time axis and as a list of sentences, both addressed by position."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.views.sentences import FAMILY, Family, sentence, tone
from harness.contracts.events import MissionEvent

LANES: tuple[tuple[Family, str], ...] = (
    ("person", "people"),
    ("plan", "plan C1"),
    ("dispatch", "dispatch C2"),
    ("evidence", "evidence"),
    ("verify", "verify C3"),
    ("recovery", "recovery C4"),
    ("gate", "gate"),
)


@dataclass(frozen=True)
class Entry:
    """One stored event, decoded. Times are seconds since the Unix epoch: mission time, and wall time of recording."""

    position: int
    version: int
    kind: str
    mission_s: float
    recorded_s: float
    previous: str
    digest: str
    event: MissionEvent


@dataclass(frozen=True)
class Tick:
    """One event on a lane. `left` is its place on the axis in percent."""

    position: int
    left: float
    tone: str
    text: str
    href: str


@dataclass(frozen=True)
class Lane:
    """One family of events, in order of time."""

    title: str
    ticks: tuple[Tick, ...]


@dataclass(frozen=True)
class Line:
    """One event as a sentence."""

    position: int
    elapsed_s: float
    recorded_s: float
    lane: str
    kind: str
    tone: str
    text: str
    href: str
    current: bool


@dataclass(frozen=True)
class Timeline:
    """Lanes, and where the reader stands on them."""

    lanes: tuple[Lane, ...]
    cursor: float
    elapsed_s: float
    total_s: float
    first: int
    last: int
    place: int
    count: int
    earlier: str
    later: str


def timeline(mission_id: str, entries: Sequence[Entry], *, at: int | None, node: str) -> Timeline:
    """Entries must not be empty: a mission begins with one."""
    begin_s = entries[0].mission_s
    span_s = max(entries[-1].mission_s - begin_s, 0.001)
    place = next((index for index, entry in enumerate(entries) if entry.position == at), len(entries) - 1)
    here = entries[place]

    def href(position: int) -> str:
        chosen = f"&node={node}" if node else ""
        return f"/missions/{mission_id}?at={position}{chosen}#timeline"

    ticks: dict[Family, list[Tick]] = {family: [] for family, _ in LANES}
    for entry in entries:
        ticks[FAMILY[entry.kind]].append(
            Tick(
                position=entry.position,
                left=round(99.0 * (entry.mission_s - begin_s) / span_s, 3),
                tone=tone(entry.event),
                text=f"{entry.position}: {sentence(entry.event)}",
                href=href(entry.position),
            )
        )
    return Timeline(
        lanes=tuple(Lane(title=title, ticks=tuple(ticks[family])) for family, title in LANES),
        cursor=round(99.0 * (here.mission_s - begin_s) / span_s, 3),
        elapsed_s=here.mission_s - begin_s,
        total_s=span_s,
        first=entries[0].position,
        last=entries[-1].position,
        place=place + 1,
        count=len(entries),
        earlier=href(entries[place - 1].position) if place else "",
        later=href(entries[place + 1].position) if place + 1 < len(entries) else "",
    )


def lines(mission_id: str, entries: Sequence[Entry], *, at: int | None) -> tuple[Line, ...]:
    """Every event as a sentence, oldest first."""
    return tuple(_line(mission_id, entry, begin_s=entries[0].mission_s, at=at) for entry in entries)


def until(entries: Sequence[Entry], at: int | None) -> tuple[Entry, ...]:
    """The history as it was at a position; all of it for None. At least the first entry remains."""
    if at is None:
        return tuple(entries)
    return tuple(entry for entry in entries if entry.position <= at) or tuple(entries[:1])


def _line(mission_id: str, entry: Entry, *, begin_s: float, at: int | None) -> Line:
    return Line(
        position=entry.position,
        elapsed_s=entry.mission_s - begin_s,
        recorded_s=entry.recorded_s,
        lane=dict(LANES)[FAMILY[entry.kind]],
        kind=entry.kind,
        tone=tone(entry.event),
        text=sentence(entry.event),
        href=f"/missions/{mission_id}/events/{entry.position}",
        current=entry.position == at,
    )
