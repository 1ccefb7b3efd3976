"""Pure: may this be raised, cleared, acknowledged, shelved, suppressed, restored or assigned?"""

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
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.values import Moment
from harness.projections.alerts import Alert, apply, status


def decide(alert: Alert, command: AlertCommand, now: Moment) -> Decision[AlertEvent]:
    """Accept or refuse one request; what is so already is accepted and adds nothing."""
    if isinstance(command, RaiseAlert):
        return _raise(alert, command)
    if not alert.version:
        return Refused("no_such_alert", "There is no such alert.")
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
                return Refused("suppressed", f"{alert.suppressed_by.name} suppressed it already: {alert.reason}")
            return Accepted((AlertSuppressed(actor=command.actor, reason=command.reason, at_s=now.wall_s),))
        case RestoreAlert():
            if status(alert, now.wall_s) not in ("shelved", "suppressed"):
                return Refused("not_put_away", "It is neither shelved nor suppressed.")
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
        return Refused("happened_again", f"It happened {newer} more times since this was shown. Look again.")
    if alert.acknowledged:
        by = alert.acknowledged_by.name if alert.acknowledged_by else "somebody"
        return Refused("acknowledged", f"{by} acknowledged it already.")
    return Accepted((AlertAcknowledged(actor=command.actor, note=command.note, at_s=now.wall_s),))


def _shelve(alert: Alert, command: ShelveAlert, now: Moment) -> Decision[AlertEvent]:
    if command.for_s > LONGEST_SHELF_S:
        return Refused("too_long", f"An alert is shelved for at most {LONGEST_SHELF_S / 3600:.0f} hours.")
    until_s = now.wall_s + command.for_s
    return Accepted((AlertShelved(actor=command.actor, reason=command.reason, until_s=until_s, at_s=now.wall_s),))


DECIDER: Decider[Alert, AlertCommand, AlertEvent] = Decider(
    initial=Alert(), apply=apply, decide=decide, codec=Codec(AlertEvent)
)
