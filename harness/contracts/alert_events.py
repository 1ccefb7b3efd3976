"""Alerts: what a person should know, one per cause, with everything that people did about it.

States after ISA-18.2: unacknowledged, acknowledged, returned to normal without acknowledgement, normal; shelved until
an instant; suppressed with a reason. Instants are wall seconds since the Unix epoch.
"""

from typing import Literal, get_args

from harness.contracts.actors import Actor, Event
from harness.contracts.ids import StreamId, sha256
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Value

AlertKind = Literal[
    "handoff", "unsafe", "veto", "body_not_static", "mission_failed", "disputed", "duplicate_start", "robot_lost",
    "battery_low", "hardware_stop", "log_damaged", "blob_damaged", "disk_low", "canary_fault", "notification_failed",
]  # fmt: skip
Priority = Literal["low", "medium", "high", "critical"]
PRIORITIES: tuple[Priority, ...] = get_args(Priority)
LONGEST_SHELF_S = 24 * 3600.0


class Occurrence(Value):
    """One thing that went wrong. `cause` says what with whom: everything with the same cause is one alert.

    `condition` names what lasts until it is cleared; empty for what happened at an instant. `source` is the position
    of the log's event that told it, 0 if it was observed live. `link` is the page where something can be done.
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
    """It happened, or it happened again with the same cause."""

    occurrence: Occurrence
    at_s: float


class AlertCleared(Event, tag=True):
    """A condition does not hold any more. `source` as in the occurrence."""

    condition: Name
    reason: Explanation
    at_s: float
    source: Count = 0


class AlertAcknowledged(Event, tag=True):
    """A person has seen it. What happened at an instant is over with this; what lasts stays acknowledged."""

    actor: Actor
    note: str
    at_s: float


class AlertShelved(Event, tag=True):
    """Out of the way until an instant; it comes back by itself."""

    actor: Actor
    reason: Name
    until_s: float
    at_s: float


class AlertSuppressed(Event, tag=True):
    """Out of the way until somebody restores it."""

    actor: Actor
    reason: Name
    at_s: float


class AlertRestored(Event, tag=True):
    """Back from the shelf or from suppression."""

    actor: Actor
    reason: str
    at_s: float


class AlertAssigned(Event, tag=True):
    """Somebody is to look after it; an empty name takes that back."""

    actor: Actor
    assignee: str
    at_s: float


class AlertNotified(Event, tag=True):
    """What became of telling people outside. `service` names a configured service, never its address.

    `sent` is the service's word that it took the message; nobody has read it for that.
    """

    service: Name
    outcome: Literal["sent", "failed"]
    tries: Count
    reason: str
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
    """The one alert of a cause."""
    return f"alert_{sha256(cause.encode())[:16]}"


def alert_stream(name: str) -> StreamId:
    return StreamId(f"alert/{name}")
