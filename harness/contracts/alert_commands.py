"""Commands about alerts: the alert service raises and clears them, people acknowledge, shelve and assign them."""

from typing import Literal

from harness.contracts.actors import Actor, Command
from harness.contracts.alert_events import Occurrence
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, NonNegative, Positive


class RaiseAlert(Command, tag=True):
    """Raise an alert for something that happened at `at_s`.

    A source that was already reported, or a condition that is already active, adds nothing.
    """

    occurrence: Occurrence
    at_s: NonNegative


class ClearAlert(Command, tag=True):
    condition: Name
    reason: Explanation
    at_s: NonNegative
    source: Count = 0


class NoteNotification(Command, tag=True):
    service: Name
    outcome: Literal["sent", "failed"]
    tries: Count
    reason: Explanation


class AcknowledgeAlert(Command, tag=True):
    """Acknowledge an alert. `seen` is the count the person saw: later occurrences are not acknowledged with it."""

    actor: Actor
    seen: Count
    note: str = ""


class ShelveAlert(Command, tag=True):
    actor: Actor
    reason: Name
    for_s: Positive


class SuppressAlert(Command, tag=True):
    actor: Actor
    reason: Name


class RestoreAlert(Command, tag=True):
    actor: Actor
    reason: str = ""


class AssignAlert(Command, tag=True):
    actor: Actor
    assignee: str


AlertPersonCommand = AcknowledgeAlert | ShelveAlert | SuppressAlert | RestoreAlert | AssignAlert
AlertCommand = RaiseAlert | ClearAlert | NoteNotification | AlertPersonCommand
