"""External notifications: the message and the port that sends it. A message holds no image and no free text."""

from collections.abc import Collection
from typing import Protocol

from harness.contracts.reasons import Reason
from harness.contracts.values import Name, Value


class Notification(Value):
    """Names, numbers and an address of this console; no text that people or models wrote."""

    title: Name
    body: str
    urgent: bool


class Notifier(Protocol):
    """Sends to services by name; their addresses are secrets that only the notifier knows."""

    @property
    def services(self) -> Collection[str]: ...

    def send(self, service: str, message: Notification) -> Reason | None:
        """None if the service reported accepting it; else the reason, without any address."""
        ...
