"""Shapes a mission's history: its events as lanes on one time axis, and those around the reader's place."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.views import sentences
from harness.contracts.events import MissionEvent

LANES: tuple[tuple[sentences.Family, str], ...] = (
    ("person", "people"),
    ("plan", N_("plan C1")),
    ("dispatch", N_("dispatch C2")),
    ("evidence", "evidence"),
    ("verify", N_("verify C3")),
    ("recovery", N_("recovery C4")),
    ("gate", "gate"),
)

NARROWEST = 0.4
"""Two ticks of a lane that are closer than this, in percent of the axis, are shown as the louder one."""
LOUDEST: tuple[sentences.Tone, ...] = ("plain", "good", "warn", "bad")
AROUND = 60


@dataclass(frozen=True)
class TimelineEntry:
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
    tone: sentences.Tone
    text: str
    href: str


@dataclass(frozen=True)
class Lane:
    """One family of events, in order of time."""

    title: str
    ticks: tuple[Tick, ...]


@dataclass(frozen=True)
class Axis:
    """Where an instant of mission time stands on the page's axis, in percent."""

    left_of: Callable[[float], float]


@dataclass(frozen=True)
class Timeline:
    """Lanes, where the reader stands on them, and every event's position and second, for stepping."""

    lanes: tuple[Lane, ...]
    cursor: float
    marks: str


def timeline(mission_id: str, entries: Sequence[TimelineEntry], *, axis: Axis, at_s: float, node: str) -> Timeline:
    """Entries must not be empty: a mission begins with one. Ticks that would cover each other are one tick."""
    begin_s = entries[0].mission_s
    chosen = f"&node={node}" if node else ""
    ticks: dict[sentences.Family, list[Tick]] = {family: [] for family, _ in LANES}
    for entry in entries:
        lane, left = ticks[sentences.FAMILY[entry.kind]], axis.left_of(entry.mission_s)
        tick = Tick(
            position=entry.position,
            left=left,
            tone=sentences.tone(entry.event),
            text=lazy_gettext("{position}: {text}", position=entry.position, text=sentences.sentence(entry.event)),
            href=f"/missions/{mission_id}?at={entry.position}{chosen}#timeline",
        )
        if lane and left - lane[-1].left < NARROWEST and LOUDEST.index(lane[-1].tone) >= LOUDEST.index(tick.tone):
            continue
        if lane and left - lane[-1].left < NARROWEST:
            lane[-1] = tick
        else:
            lane.append(tick)
    return Timeline(
        lanes=tuple(Lane(title=title, ticks=tuple(ticks[family])) for family, title in LANES),
        cursor=axis.left_of(at_s),
        marks=" ".join(f"{entry.position}@{entry.mission_s - begin_s:.3f}" for entry in entries),
    )


def around(entries: Sequence[TimelineEntry], *, place: int) -> tuple[TimelineEntry, ...]:
    """At most 2 * AROUND events with the reader's place (counted from 1) among them, oldest first."""
    first = max(min(place - AROUND, len(entries) - 2 * AROUND), 0)
    return tuple(entries[first : first + 2 * AROUND])


def until(entries: Sequence[TimelineEntry], at: int | None) -> tuple[TimelineEntry, ...]:
    """The history as it was at a position; all of it for None. At least the first entry remains."""
    if at is None:
        return tuple(entries)
    return tuple(entry for entry in entries if entry.position <= at) or tuple(entries[:1])


def family(kind: str) -> str:
    """The title of the lane that an event of this kind belongs to."""
    return dict(LANES)[sentences.FAMILY[kind]]
