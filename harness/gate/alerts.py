"""Decides whether an alert may be raised, cleared, acknowledged, shelved, suppressed, restored or assigned. Pure."""

from typing import assert_never

from harness.contracts import alert_commands, alert_events
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.alerts import Alert, apply, status


def decide(alert: Alert, command: alert_commands.AlertCommand, now: Moment) -> Decision[alert_events.AlertEvent]:
    """Accept or refuse one request; what already holds is accepted and adds nothing."""
    if isinstance(command, alert_commands.RaiseAlert):
        return _raise(alert, command)
    if not alert.version:
        return refused("no_such_alert")
    match command:
        case alert_commands.ClearAlert():
            return _clear(alert, command)
        case alert_commands.NoteNotification():
            noted = alert_events.AlertNotified(
                service=command.service,
                outcome=command.outcome,
                tries=command.tries,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((noted,))
        case alert_commands.AcknowledgeAlert():
            return _acknowledge(alert, command, now)
        case alert_commands.ShelveAlert():
            return _shelve(alert, command, now)
        case alert_commands.SuppressAlert():
            if alert.suppressed_by is not None:
                return refused(
                    "suppressed", because("alert_suppressed", actor=alert.suppressed_by.name, reason=alert.reason)
                )
            return Accepted(
                (alert_events.AlertSuppressed(actor=command.actor, reason=command.reason, at_s=now.wall_s),)
            )
        case alert_commands.RestoreAlert():
            if status(alert, now.wall_s) not in ("shelved", "suppressed"):
                return refused("not_put_away")
            return Accepted((alert_events.AlertRestored(actor=command.actor, reason=command.reason, at_s=now.wall_s),))
        case alert_commands.AssignAlert():
            if command.assignee == alert.assignee:
                return Accepted(())
            return Accepted(
                (alert_events.AlertAssigned(actor=command.actor, assignee=command.assignee, at_s=now.wall_s),)
            )
        case _:
            assert_never(command)


def _raise(alert: Alert, command: alert_commands.RaiseAlert) -> Decision[alert_events.AlertEvent]:
    one = command.occurrence
    told_before = 0 < one.source <= alert.told
    if told_before or (one.condition and one.condition in alert.standing):
        return Accepted(())
    return Accepted((alert_events.AlertRaised(occurrence=one, at_s=command.at_s),))


def _clear(alert: Alert, command: alert_commands.ClearAlert) -> Decision[alert_events.AlertEvent]:
    if command.condition not in alert.standing:
        return Accepted(())
    cleared = alert_events.AlertCleared(
        condition=command.condition, reason=command.reason, at_s=command.at_s, source=command.source
    )
    return Accepted((cleared,))


def _acknowledge(
    alert: Alert, command: alert_commands.AcknowledgeAlert, now: Moment
) -> Decision[alert_events.AlertEvent]:
    if command.seen < alert.total:
        newer = alert.total - command.seen
        return refused("happened_again", times=newer)
    if alert.acknowledged:
        by = alert.acknowledged_by.name if alert.acknowledged_by else "somebody"
        return refused("acknowledged", because("alert_acknowledged", actor=by))
    return Accepted((alert_events.AlertAcknowledged(actor=command.actor, note=command.note, at_s=now.wall_s),))


def _shelve(alert: Alert, command: alert_commands.ShelveAlert, now: Moment) -> Decision[alert_events.AlertEvent]:
    if command.for_s > alert_events.LONGEST_SHELF_S:
        return refused("too_long", because("alert_shelf_too_long", limit_h=alert_events.LONGEST_SHELF_S / 3600))
    until_s = now.wall_s + command.for_s
    return Accepted(
        (alert_events.AlertShelved(actor=command.actor, reason=command.reason, until_s=until_s, at_s=now.wall_s),)
    )


DECIDER: Decider[Alert, alert_commands.AlertCommand, alert_events.AlertEvent] = Decider(
    initial=Alert(), apply=apply, decide=decide, codec=Codec(alert_events.AlertEvent)
)
