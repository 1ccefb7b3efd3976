"""Telling people outside: what is sent, and the port that sends it. A message holds no image and no free text."""

from collections.abc import Collection
from typing import Protocol

from harness.contracts.values import Name, Value


class Notification(Value):
    """Made of names, numbers and an address of this console: no words that people or models wrote."""

    title: Name
    body: str
    urgent: bool


class Notifier(Protocol):
    """Sends to services by name; their addresses are secrets that it alone knows."""

    @property
    def services(self) -> Collection[str]: ...

    def send(self, service: str, message: Notification) -> str:
        """Empty if the service took it, by its own word; else why not, in words that hold no address."""
        ...
