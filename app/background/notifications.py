"""Sends external notifications of new, pressing alerts; nothing waits for them.

A message holds the alert's title, its numbers and an address of this console, and no free text: goals and reasons are
words of people and models and may hold anything.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from queue import Empty, Full, Queue
from typing import Literal

from harness.contracts.alert_commands import ClearAlert, NoteNotification, RaiseAlert
from harness.contracts.alert_events import PRIORITIES, Priority, alert_id, alert_stream
from harness.contracts.notification import Notification, Notifier
from harness.contracts.reasons import Reason, because
from harness.projections.alert_causes import of_site
from harness.projections.alerts import Alert, status
from harness.runtime import Runtime
from harness.workers import Background, Worker

WAITS_S: tuple[float, ...] = (0.0, 2.0, 8.0)
STEP_S = 0.5
MOST_QUEUED = 200
PRESSING = ("high", "critical")


@dataclass
class Notices(Background):
    """`offer` queues an alert, from any thread; `deliver` sends the queue; `watch` delivers in the background."""

    runtime: Runtime
    notifier: Notifier
    clock: Callable[[], float]
    address: str
    waits_s: Sequence[float] = WAITS_S
    _line: Queue[tuple[str, Alert]] = field(default_factory=lambda: Queue(MOST_QUEUED))
    _notified: dict[str, tuple[float, Priority]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._worker = Worker("notices", self.deliver, every_s=STEP_S, close_within_s=2.0)

    def offer(self, name: str, alert: Alert) -> None:
        """Queue an alert that is pressing, not put away, and new or more pressing than the last notification of it."""
        if not self.notifier.services or alert.newest is None or alert.newest.kind == "notification_failed":
            return
        if alert.priority not in PRESSING or status(alert, self.clock()) != "unacknowledged":
            return
        episode, priority = self._notified.get(name, (-1.0, PRIORITIES[0]))
        if episode == alert.first_s and PRIORITIES.index(alert.priority) <= PRIORITIES.index(priority):
            return
        self._notified[name] = (alert.first_s, alert.priority)
        try:
            self._line.put_nowait((name, alert))
        except Full:
            self._failed("the line", because("notification_line_full", limit=MOST_QUEUED))

    def deliver(self) -> int:
        """Send everything in the queue; returns how many messages a service accepted."""
        taken = 0
        while not self._worker.closed:
            try:
                name, alert = self._line.get_nowait()
            except Empty:
                return taken
            taken += sum(self._send(service, name, alert) for service in self.notifier.services)
        return taken

    def _send(self, service: str, name: str, alert: Alert) -> bool:
        reason: Reason | None = None
        tries = 0
        for wait_s in self.waits_s:
            if self._worker.wait(wait_s):
                return False
            tries += 1
            reason = self.notifier.send(service, message(name, alert, address=self.address))
            if reason is None:
                break
        outcome: Literal["sent", "failed"] = "failed" if reason else "sent"
        noted = NoteNotification(service=service, outcome=outcome, tries=tries, reason=reason or "")
        self.runtime.decide([(alert_stream(name), noted)])
        if reason:
            self._failed(service, because("notification_tried", reason=reason, tries=tries))
            return False
        cleared = ClearAlert(
            condition="notification_failed", reason=because("notifications_taken_again"), at_s=self.clock()
        )
        self.runtime.decide([(alert_stream(alert_id(_cause(service))), cleared)])
        return True

    def _failed(self, service: str, why: Reason) -> None:
        occurrence = of_site(
            "notification_failed", "high", because("alert_notification_failed", service=service),
            cause=_cause(service), text=why, link="/alerts",
        )  # fmt: skip
        stream = alert_stream(alert_id(occurrence.cause))
        self.runtime.decide([(stream, RaiseAlert(occurrence=occurrence, at_s=self.clock()))])


def message(name: str, alert: Alert, *, address: str) -> Notification:
    """The text of a notification: what happened to which robot, how often, and where to look."""
    newest = alert.newest
    kind = newest.kind.replace("_", " ") if newest else "alert"
    whose = newest.robot_id if newest and newest.robot_id else "this installation"
    body = f"{kind}, priority {alert.priority}, {alert.count} times. {address}/alerts/{name}"
    return Notification(title=f"{whose}: {kind}", body=body, urgent=alert.priority == "critical")


def _cause(service: str) -> str:
    return f"notify/{service}"
