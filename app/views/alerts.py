"""Pure: the alert inbox and one alert with everything that people did about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import assert_never

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned, word
from app.views.list_params import Filter, Option, address
from app.views.missions import ListTab
from app.views.shell import Shell
from harness.contracts import alert_events
from harness.projections.alerts import Alert, status

PATH = "/alerts"
SHOWN = 50
GROUPS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("", N_("Needs attention"), ("unacknowledged", "returned")),
    ("active", N_("Active"), ("unacknowledged", "acknowledged")),
    ("shelved", "shelved", ("shelved",)),
    ("suppressed", "suppressed", ("suppressed",)),
    ("all", "history", ()),
)
"""Tabs: the word in the address, its title, and the states it shows; none: every one."""
TITLES = {
    "unacknowledged": "unacknowledged",
    "acknowledged": "acknowledged",
    "returned": N_("Cleared, unacknowledged"),
    "normal": "normal",
    "shelved": "shelved",
    "suppressed": "suppressed",
}
TONES = {"critical": "bad", "high": "warn", "medium": "warn", "low": "plain"}
SHELF = ((900, N_("15 minutes")), (3600, N_("1 hour")), (8 * 3600, N_("8 hours")))


@dataclass(frozen=True)
class AlertRow:
    """One alert in the list. `total` is what an acknowledgement from this row has seen."""

    alert_id: str
    title: str
    text: str
    kind: str
    state: str
    state_title: str
    priority: str
    tone: str
    count: int
    total: int
    first_s: float
    last_s: float
    assignee: str
    put_away: str
    until_s: float
    link: str


@dataclass(frozen=True)
class ShelfDuration:
    """How long an alert may be put on the shelf for."""

    seconds: int
    title: str


@dataclass(frozen=True)
class AlertListParams:
    """What the address asks for."""

    group: str = ""
    words: str = ""
    priority: str = ""
    robot: str = ""
    before_s: float | None = None

    @property
    def params(self) -> dict[str, str]:
        """The address's own parameters, without the place in the list."""
        return {"status": self.group, "q": self.words, "priority": self.priority, "robot": self.robot}


@dataclass(frozen=True)
class AlertsPage:
    """The inbox; search, filters and place stand in the address. `live`: it follows what happens."""

    shell: Shell
    rows: tuple[AlertRow, ...]
    groups: tuple[ListTab, ...]
    filters: tuple[Filter, ...]
    words: str
    group: str
    live: bool
    query: str
    following: str
    found: int
    total: int
    shelves: tuple[ShelfDuration, ...]
    notifies: str


@dataclass(frozen=True)
class AlertHistoryRow:
    """One line of an alert's history."""

    at_s: float
    text: str
    position: int


@dataclass(frozen=True)
class AlertPage:
    """One alert, its history, and what can be done about it."""

    shell: Shell
    row: AlertRow
    conditions: tuple[str, ...]
    history: tuple[AlertHistoryRow, ...]
    shelves: tuple[ShelfDuration, ...]
    errors: tuple[str, ...]


def row(alert_id: str, alert: Alert, *, now_s: float) -> AlertRow:
    """An alert as it stands at an instant; `alert` has happened at least once."""
    state, newest = status(alert, now_s), alert.newest
    by = alert.suppressed_by or alert.shelved_by
    away = (
        lazy_gettext("{who}: {reason}", who=by.name, reason=alert.reason)
        if by is not None and state in ("shelved", "suppressed")
        else ""
    )
    return AlertRow(
        alert_id=alert_id,
        title=reasoned(newest.title) if newest else alert_id,
        text=reasoned(newest.text) if newest else "",
        kind=newest.kind if newest else "",
        state=state,
        state_title=TITLES[state],
        priority=alert.priority,
        tone=TONES[alert.priority] if state in ("unacknowledged", "returned") else "plain",
        count=alert.count,
        total=alert.total,
        first_s=alert.first_s,
        last_s=alert.last_s,
        assignee=alert.assignee,
        put_away=away,
        until_s=alert.shelved_until_s if state == "shelved" else 0.0,
        link=newest.link if newest else "",
    )


def chosen(alerts: Sequence[tuple[str, Alert]], asked: AlertListParams, *, now_s: float) -> list[AlertRow]:
    """The rows that answer, newest first; of those to look at, the most pressing first."""
    states = next((states for value, _, states in GROUPS if value == asked.group), ())
    wanted = asked.words.lower().split()
    found = []
    for name, alert in alerts:
        one = row(name, alert, now_s=now_s)
        told = f"{one.title} {one.text} {one.kind} {name} {one.assignee}".lower()
        fits = (not states or one.state in states) and all(word in told for word in wanted)
        fits = fits and asked.priority in ("", one.priority)
        if fits and (not asked.robot or (alert.newest is not None and alert.newest.robot_id == asked.robot)):
            found.append(one)
    return found


def alerts_page(
    shell: Shell, alerts: Sequence[tuple[str, Alert]], asked: AlertListParams, *, now_s: float, services: Sequence[str]
) -> AlertsPage:
    """One page of the inbox, what happened last first."""
    found = chosen(alerts, asked, now_s=now_s)
    later = [one for one in found if asked.before_s is None or one.last_s < asked.before_s]
    shown = later[:SHOWN]
    counts = {value: _count(alerts, states, now_s) for value, _, states in GROUPS}
    robots = sorted({alert.newest.robot_id for _, alert in alerts if alert.newest and alert.newest.robot_id})
    return AlertsPage(
        shell=shell,
        rows=tuple(shown),
        groups=tuple(
            ListTab(
                title=title,
                href=address(PATH, asked.params, status=value),
                count=str(counts[value]),
                chosen=value == asked.group,
            )
            for value, title, _ in GROUPS
        ),
        filters=(
            _filter("priority", tuple(reversed(alert_events.PRIORITIES)), asked.priority),
            _filter("robot", robots, asked.robot),
        ),
        words=asked.words,
        group=asked.group,
        live=asked.before_s is None,
        query=address("", asked.params),
        following=address(PATH, asked.params, before=repr(shown[-1].last_s)) if len(later) > SHOWN else "",
        found=len(found),
        total=len(alerts),
        shelves=shelves(),
        notifies=", ".join(services),
    )


def lasting(condition: str) -> str:
    """What lasts, as its event names it: a kind, and what it is about."""
    kind, _, about = condition.partition(" ")
    return lazy_gettext("{kind} {about}", kind=word(kind), about=about)


def shelves() -> tuple[ShelfDuration, ...]:
    return tuple(ShelfDuration(seconds, title) for seconds, title in SHELF)


def sentence(event: alert_events.AlertEvent) -> str:
    """What happened to the alert, as a person would say it."""
    match event:
        case alert_events.AlertRaised(occurrence=one):
            return lazy_gettext("{title}. {text}", title=one.title, text=one.text)
        case alert_events.AlertCleared():
            return lazy_gettext(
                "Cleared: {condition}. {reason}", condition=lasting(event.condition), reason=event.reason
            )
        case alert_events.AlertAcknowledged():
            return lazy_gettext("{actor} acknowledged it. {note}", actor=event.actor.name, note=event.note)
        case alert_events.AlertShelved():
            return lazy_gettext(
                "{actor} shelved it for {minutes} min: {reason}",
                actor=event.actor.name,
                minutes=f"{(event.until_s - event.at_s) / 60:.0f}",
                reason=event.reason,
            )
        case alert_events.AlertSuppressed():
            return lazy_gettext("{actor} suppressed it: {reason}", actor=event.actor.name, reason=event.reason)
        case alert_events.AlertRestored():
            return lazy_gettext("{actor} restored it. {reason}", actor=event.actor.name, reason=event.reason)
        case alert_events.AlertAssigned():
            return lazy_gettext(
                "{actor} gave it to {assignee}", actor=event.actor.name, assignee=event.assignee or "nobody"
            )
        case alert_events.AlertNotified():
            if event.outcome == "sent":
                return lazy_gettext(
                    "{service} reports that it took the message (tries: {tries})",
                    service=event.service,
                    tries=event.tries,
                )
            return lazy_gettext(
                "{service} was not notified: {reason} (tries: {tries})",
                service=event.service,
                reason=event.reason,
                tries=event.tries,
            )
        case _:
            assert_never(event)


def _count(alerts: Sequence[tuple[str, Alert]], states: Sequence[str], now_s: float) -> int:
    return sum(not states or status(alert, now_s) in states for _, alert in alerts)


def _filter(name: str, values: Sequence[str], given: str) -> Filter:
    options = [Option(value="", title="any", count=0, chosen=not given)]
    options += [Option(value=one, title=one, count=0, chosen=one == given) for one in values]
    return Filter(name=name, title=name, options=tuple(options))
