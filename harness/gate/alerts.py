"""Decides whether an alert may be raised, cleared, acknowledged, shelved, suppressed, restored or assigned. Pure."""

from typing import assert_never

from harness.contracts.alert_commands import (
    AcknowledgeAlert,
    AlertCommand,
    AssignAlert,
    ClearAlert,
    NoteNotification,
    RaiseAlert,
    RestoreAlert,
    ShelveAlert,
    SuppressAlert,
)
from harness.contracts.alert_events import (
    LONGEST_SHELF_S,
    AlertAcknowledged,
    AlertAssigned,
    AlertCleared,
    AlertEvent,
    AlertNotified,
    AlertRaised,
    AlertRestored,
    AlertShelved,
    AlertSuppressed,
)
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.alerts import Alert, apply, status


def decide(alert: Alert, command: AlertCommand, now: Moment) -> Decision[AlertEvent]:
    """Accept or refuse one request; what already holds is accepted and adds nothing."""
    if isinstance(command, RaiseAlert):
        return _raise(alert, command)
    if not alert.version:
        return refused("no_such_alert")
    match command:
        case ClearAlert():
            return _clear(alert, command)
        case NoteNotification():
            noted = AlertNotified(
                service=command.service,
                outcome=command.outcome,
                tries=command.tries,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((noted,))
        case AcknowledgeAlert():
            return _acknowledge(alert, command, now)
        case ShelveAlert():
            return _shelve(alert, command, now)
        case SuppressAlert():
            if alert.suppressed_by is not None:
                return refused(
                    "suppressed", because("alert_suppressed", actor=alert.suppressed_by.name, reason=alert.reason)
                )
            return Accepted((AlertSuppressed(actor=command.actor, reason=command.reason, at_s=now.wall_s),))
        case RestoreAlert():
            if status(alert, now.wall_s) not in ("shelved", "suppressed"):
                return refused("not_put_away")
            return Accepted((AlertRestored(actor=command.actor, reason=command.reason, at_s=now.wall_s),))
        case AssignAlert():
            if command.assignee == alert.assignee:
                return Accepted(())
            return Accepted((AlertAssigned(actor=command.actor, assignee=command.assignee, at_s=now.wall_s),))
        case _:
            assert_never(command)


def _raise(alert: Alert, command: RaiseAlert) -> Decision[AlertEvent]:
    one = command.occurrence
    told_before = 0 < one.source <= alert.told
    if told_before or (one.condition and one.condition in alert.standing):
        return Accepted(())
    return Accepted((AlertRaised(occurrence=one, at_s=command.at_s),))


def _clear(alert: Alert, command: ClearAlert) -> Decision[AlertEvent]:
    if command.condition not in alert.standing:
        return Accepted(())
    cleared = AlertCleared(condition=command.condition, reason=command.reason, at_s=command.at_s, source=command.source)
    return Accepted((cleared,))


def _acknowledge(alert: Alert, command: AcknowledgeAlert, now: Moment) -> Decision[AlertEvent]:
    if command.seen < alert.total:
        newer = alert.total - command.seen
        return refused("happened_again", times=newer)
    if alert.acknowledged:
        by = alert.acknowledged_by.name if alert.acknowledged_by else "somebody"
        return refused("acknowledged", because("alert_acknowledged", actor=by))
    return Accepted((AlertAcknowledged(actor=command.actor, note=command.note, at_s=now.wall_s),))


def _shelve(alert: Alert, command: ShelveAlert, now: Moment) -> Decision[AlertEvent]:
    if command.for_s > LONGEST_SHELF_S:
        return refused("too_long", because("alert_shelf_too_long", limit_h=LONGEST_SHELF_S / 3600))
    until_s = now.wall_s + command.for_s
    return Accepted((AlertShelved(actor=command.actor, reason=command.reason, until_s=until_s, at_s=now.wall_s),))


DECIDER: Decider[Alert, AlertCommand, AlertEvent] = Decider(
    initial=Alert(), apply=apply, decide=decide, codec=Codec(AlertEvent)
)
