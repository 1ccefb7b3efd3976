"""Base classes of events and commands, and the actor who issues a command."""

from typing import Literal

from harness.contracts.values import Name, Value

Channel = Literal["human", "timeout", "policy"]


class Event(Value, tag_field="kind"):
    """Base of all events; the tag is the class name."""


class Command(Value, tag_field="command"):
    """Base of all commands."""


class Actor(Value):
    """Who issued a command, in which role and through which channel."""

    name: Name
    role: Name
    channel: Channel = "human"
