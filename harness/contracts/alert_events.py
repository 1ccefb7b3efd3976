"""Events of alerts: each alert stands for one cause and records what happened and what people did about it.

States follow ISA-18.2: unacknowledged, acknowledged, returned to normal without acknowledgement, normal; shelved until
an instant; suppressed with a reason. Instants are wall seconds since the Unix epoch.
"""

from typing import Literal, get_args

from harness.contracts.actors import Actor, Event
from harness.contracts.ids import StreamId, sha256
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Value

AlertKind = Literal[
    "handoff", "unsafe", "veto", "body_not_static", "mission_failed", "partly_verified", "disputed", "duplicate_start",
    "robot_lost", "battery_low", "hardware_stop", "log_damaged", "blob_damaged", "disk_low", "canary_fault",
    "notification_failed", "safety_not_reached",
]  # fmt: skip
Priority = Literal["low", "medium", "high", "critical"]
PRIORITIES: tuple[Priority, ...] = get_args(Priority)
LONGEST_SHELF_S = 24 * 3600.0


class Occurrence(Value):
    """One thing that went wrong. `cause` names what and for whom: everything with the same cause is one alert.

    `condition` names what lasts until it is cleared; empty for what happened at an instant. `source` is the position of
    the log event that reported it, 0 if it was observed live. `link` is the page where something can be done.
    """

    cause: Name
    kind: AlertKind
    priority: Priority
    title: Explanation
    text: Explanation
    condition: str = ""
    source: Count = 0
    robot_id: str = ""
    mission_id: str = ""
    link: str = ""


class AlertRaised(Event, tag=True):
    """Something went wrong, for the first time or again with the same cause."""

    occurrence: Occurrence
    at_s: float


class AlertCleared(Event, tag=True):
    """A condition no longer holds. `source` as in the occurrence."""

    condition: Name
    reason: Explanation
    at_s: float
    source: Count = 0


class AlertAcknowledged(Event, tag=True):
    """A person acknowledged the alert. A momentary occurrence is closed by this; a lasting one stays acknowledged."""

    actor: Actor
    note: str
    at_s: float


class AlertShelved(Event, tag=True):
    """The alert is hidden until an instant, then returns by itself."""

    actor: Actor
    reason: Name
    until_s: float
    at_s: float


class AlertSuppressed(Event, tag=True):
    """The alert is hidden until somebody restores it."""

    actor: Actor
    reason: Name
    at_s: float


class AlertRestored(Event, tag=True):
    """A shelved or suppressed alert is shown again."""

    actor: Actor
    reason: str
    at_s: float


class AlertAssigned(Event, tag=True):
    """Somebody was assigned to the alert; an empty name removes the assignment."""

    actor: Actor
    assignee: str
    at_s: float


class AlertNotified(Event, tag=True):
    """The result of one external notification. `service` names a configured service, never its address.

    `sent` means that the service reported accepting the message, not that anybody read it. The reason is empty then.
    """

    service: Name
    outcome: Literal["sent", "failed"]
    tries: Count
    reason: Explanation
    at_s: float


AlertEvent = (
    AlertRaised
    | AlertCleared
    | AlertAcknowledged
    | AlertShelved
    | AlertSuppressed
    | AlertRestored
    | AlertAssigned
    | AlertNotified
)


def alert_id(cause: str) -> str:
    """The id of the one alert for a cause."""
    return f"alert_{sha256(cause.encode())[:16]}"


def alert_stream(name: str) -> StreamId:
    return StreamId(f"alert/{name}")
