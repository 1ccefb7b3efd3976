"""Shapes the list of alerts, and the page of one alert with everything that people did about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, assert_never

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned, word
from app.views.history import HistoryLine
from app.views.list_params import Filter, Option, Paging, address
from app.views.shell import Shell
from app.views.tabbed_list import ListTab
from harness.contracts import alert_events
from harness.projections.alerts import Alert, AlertStatus, status

PATH = "/alerts"
SHOWN = 50
GROUPS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("", N_("Needs attention"), ("unacknowledged", "returned")),
    ("active", N_("Active"), ("unacknowledged", "acknowledged")),
    ("shelved", "shelved", ("shelved",)),
    ("suppressed", "suppressed", ("suppressed",)),
    ("all", "history", ()),
)
"""Tabs: value in the address, title, and the states it shows; an empty tuple shows all."""
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
class AlertItem:
    """One alert with its status at the instant of the page. `alert.total` is what an acknowledgement has seen."""

    alert_id: str
    alert: Alert
    state: AlertStatus


@dataclass(frozen=True)
class ShelfDuration:
    """A time that an alert can be shelved for."""

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
        """The parameters of the address, without the position in the list."""
        return {"status": self.group, "q": self.words, "priority": self.priority, "robot": self.robot}


@dataclass(frozen=True)
class AlertsPage:
    """The list of alerts; search, filters and position are in the address. `live`: it refreshes itself."""

    shell: Shell
    rows: tuple[AlertItem, ...]
    groups: tuple[ListTab, ...]
    filters: tuple[Filter, ...]
    words: str
    group: str
    live: bool
    query: str
    paging: Paging
    total: int
    shelves: tuple[ShelfDuration, ...]
    notifies: str


@dataclass(frozen=True)
class AlertPage:
    """One alert, its history, and what can be done about it."""

    shell: Shell
    row: AlertItem
    conditions: tuple[str, ...]
    history: tuple[HistoryLine, ...]
    shelves: tuple[ShelfDuration, ...]
    errors: tuple[str, ...]


def item(alert_id: str, alert: Alert, *, now_s: float) -> AlertItem:
    """An alert at an instant of wall time."""
    return AlertItem(alert_id=alert_id, alert=alert, state=status(alert, now_s))


def title(item: AlertItem) -> str:
    """What happened, in a few words; the id of an alert that has not happened."""
    return reasoned(item.alert.newest.title) if item.alert.newest else item.alert_id


def text(item: AlertItem) -> str:
    """What happened, in a sentence; empty for an alert that has not happened."""
    return reasoned(item.alert.newest.text) if item.alert.newest else ""


def tone(item: AlertItem) -> str:
    """Colour only where nobody has acknowledged it."""
    return TONES[item.alert.priority] if item.state in ("unacknowledged", "returned") else "plain"


def put_away(item: AlertItem) -> str:
    """Who shelved or suppressed it and why; empty for an alert in the list."""
    by = item.alert.suppressed_by or item.alert.shelved_by
    if by is None or item.state not in ("shelved", "suppressed"):
        return ""
    return lazy_gettext("{who}: {reason}", who=by.name, reason=item.alert.reason)


def shelved_until_s(item: AlertItem) -> float | None:
    """Until when it is shelved, in wall seconds; None for one that is not."""
    return item.alert.shelved_until_s if item.state == "shelved" else None


def summary(item: AlertItem) -> dict[str, Any]:
    """An alert for programs: what the API and the command line show of it. Times are wall seconds."""
    alert, newest = item.alert, item.alert.newest
    return {
        "alert_id": item.alert_id,
        "title": title(item),
        "text": text(item),
        "kind": newest.kind if newest else "",
        "state": item.state,
        "priority": alert.priority,
        "count": alert.count,
        "total": alert.total,
        "first_s": alert.first_s,
        "last_s": alert.last_s,
        "assignee": alert.assignee,
        "put_away": put_away(item),
        "shelved_until_s": shelved_until_s(item),
        "link": newest.link if newest else "",
    }


def chosen(alerts: Sequence[tuple[str, Alert]], params: AlertListParams, *, now_s: float) -> list[AlertItem]:
    """The alerts that match, in the order given."""
    states = next((states for value, _, states in GROUPS if value == params.group), ())
    items = (item(name, alert, now_s=now_s) for name, alert in alerts)
    return [one for one in items if (not states or one.state in states) and _matches(one, params)]


def _matches(item: AlertItem, params: AlertListParams) -> bool:
    newest = item.alert.newest
    searched = (
        f"{title(item)} {text(item)} {newest.kind if newest else ''} {item.alert_id} {item.alert.assignee}".lower()
    )
    return (
        all(one in searched for one in params.words.lower().split())
        and params.priority in ("", item.alert.priority)
        and params.robot in ("", newest.robot_id if newest else None)
    )


def alerts_page(
    shell: Shell, alerts: Sequence[tuple[str, Alert]], params: AlertListParams, *, now_s: float, services: Sequence[str]
) -> AlertsPage:
    """One page of the list, newest occurrence first."""
    found = chosen(alerts, params, now_s=now_s)
    later = [one for one in found if params.before_s is None or one.alert.last_s < params.before_s]
    listed_later = later[:SHOWN]
    counts = {value: _count(alerts, states, now_s) for value, _, states in GROUPS}
    robots = sorted({alert.newest.robot_id for _, alert in alerts if alert.newest and alert.newest.robot_id})
    return AlertsPage(
        shell=shell,
        rows=tuple(listed_later),
        groups=tuple(
            ListTab(
                title=title,
                href=address(PATH, params.params, status=value),
                count=str(counts[value]),
                chosen=value == params.group,
            )
            for value, title, _ in GROUPS
        ),
        filters=(
            _filter("priority", tuple(reversed(alert_events.PRIORITIES)), params.priority),
            _filter("robot", robots, params.robot),
        ),
        words=params.words,
        group=params.group,
        live=params.before_s is None,
        query=address("", params.params),
        paging=Paging(
            shown=len(listed_later),
            found=str(len(found)),
            following=address(PATH, params.params, before=repr(listed_later[-1].alert.last_s))
            if len(later) > SHOWN
            else "",
            first=address(PATH, params.params) if params.before_s is not None else "",
        ),
        total=len(alerts),
        shelves=shelves(),
        notifies=", ".join(services),
    )


def lasting(condition: str) -> str:
    """A condition that still holds, which its event names by a kind and what it is about."""
    kind, _, about = condition.partition(" ")
    return lazy_gettext("{kind} {about}", kind=word(kind), about=about)


def shelves() -> tuple[ShelfDuration, ...]:
    """The times that an alert can be shelved for, shortest first."""
    return tuple(ShelfDuration(seconds, title) for seconds, title in SHELF)


def sentence(event: alert_events.AlertEvent) -> str:
    """One event of an alert as a sentence."""
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
                reason=reasoned(event.reason),
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
