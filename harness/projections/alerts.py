"""Folds an alert's state from its events. Pure: reads no clock, writes nothing."""

from typing import Literal, assert_never

from msgspec.structs import replace

from harness.contracts import alert_events
from harness.contracts.actors import Actor
from harness.contracts.values import Count, Value

AlertStatus = Literal["unacknowledged", "acknowledged", "returned", "normal", "shelved", "suppressed"]


class Alert(Value):
    """The fold of one alert's stream.

    `standing` are the conditions that hold. `unseen`: something happened at an instant and nobody acknowledged it.
    `count` counts occurrences since the alert was last normal, `total` all of them; `first_s` is the first of `count`.
    `told` is the newest log position that was taken in.
    """

    version: Count = 0
    newest: alert_events.Occurrence | None = None
    priority: alert_events.Priority = "low"
    standing: tuple[str, ...] = ()
    unseen: bool = False
    acknowledged: bool = False
    acknowledged_by: Actor | None = None
    note: str = ""
    count: Count = 0
    total: Count = 0
    first_s: float = 0.0
    last_s: float = 0.0
    told: Count = 0
    shelved_until_s: float = 0.0
    shelved_by: Actor | None = None
    suppressed_by: Actor | None = None
    reason: str = ""
    assignee: str = ""
    notified: tuple[alert_events.AlertNotified, ...] = ()

    @property
    def active(self) -> bool:
        """Whether it holds, or happened and was not acknowledged."""
        return bool(self.standing) or self.unseen


def status(alert: Alert, now_s: float) -> AlertStatus:
    """The alert's status at an instant of wall time."""
    if alert.suppressed_by is not None:
        return "suppressed"
    if alert.shelved_until_s > now_s:
        return "shelved"
    if alert.active:
        return "acknowledged" if alert.acknowledged else "unacknowledged"
    return "normal" if alert.acknowledged else "returned"


def apply(alert: Alert, event: alert_events.AlertEvent) -> Alert:
    """The alert after one more event."""
    nxt = replace(alert, version=alert.version + 1)
    match event:
        case alert_events.AlertRaised():
            return _raised(nxt, event)
        case alert_events.AlertCleared():
            left = tuple(one for one in nxt.standing if one != event.condition)
            return replace(nxt, standing=left, told=max(nxt.told, event.source))
        case alert_events.AlertAcknowledged():
            return replace(nxt, acknowledged=True, unseen=False, acknowledged_by=event.actor, note=event.note)
        case alert_events.AlertShelved():
            return replace(
                nxt,
                shelved_until_s=event.until_s,
                shelved_by=event.actor,
                suppressed_by=None,
                reason=event.reason,
            )
        case alert_events.AlertSuppressed():
            return replace(nxt, suppressed_by=event.actor, shelved_until_s=0.0, reason=event.reason)
        case alert_events.AlertRestored():
            return replace(nxt, suppressed_by=None, shelved_until_s=0.0, reason="")
        case alert_events.AlertAssigned():
            return replace(nxt, assignee=event.assignee)
        case alert_events.AlertNotified():
            return replace(nxt, notified=(*nxt.notified, event)[-8:])
        case _:
            assert_never(event)


def _raised(alert: Alert, event: alert_events.AlertRaised) -> Alert:
    """A new occurrence needs a new acknowledgement; after a normal state the count begins again."""
    one = event.occurrence
    begins = alert.newest is None or (not alert.active and alert.acknowledged)
    priority = one.priority if begins else max(one.priority, alert.priority, key=alert_events.PRIORITIES.index)
    lasting = (one.condition,) if one.condition and one.condition not in alert.standing else ()
    return replace(
        alert,
        newest=one,
        priority=priority,
        standing=alert.standing + lasting,
        unseen=alert.unseen or not one.condition,
        acknowledged=False,
        acknowledged_by=None,
        note="",
        count=1 if begins else alert.count + 1,
        total=alert.total + 1,
        first_s=event.at_s if begins else alert.first_s,
        last_s=event.at_s,
        told=max(alert.told, one.source),
    )
