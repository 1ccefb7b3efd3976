"""Reads topics from a rosbridge server, in its JSON protocol 2: it subscribes, and never publishes or calls."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from harness.adapters.providers.topics import ros_messages
from harness.adapters.providers.topics.ros_messages import Role
from harness.adapters.providers.topics.samples import EVERY_S
from harness.adapters.providers.topics.websocket_link import Send
from harness.adapters.providers.topics.witness import LeaveOut, Receive, Topics
from harness.contracts.errors import ProviderFailed
from harness.contracts.reasons import because

ASK_S = 2.0
"""A topic of which nothing came is asked for again: the server knows its type only once somebody publishes it."""
THINNED: frozenset[Role] = frozenset({"scan", "image"})


class Operation(msgspec.Struct, frozen=True):
    """What the server sends; `msg` stays as it came until its topic says its type."""

    op: str
    topic: str = ""
    msg: msgspec.Raw = msgspec.Raw(b"{}")


class RosbridgeDialogue:
    """One connection to a rosbridge server."""

    subprotocols: Sequence[str] = ()

    def __init__(
        self, topics: Topics, receive: Receive, leave_out: LeaveOut, local_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._roles = {topic: role for role, topic in topics.items()}
        self._receive, self._leave_out, self._local_s = receive, leave_out, local_s
        self._silent = set(self._roles)
        self._asked_s = local_s()

    def begin(self, send: Send) -> None:
        """Ask for every topic of which nothing came yet."""
        self._asked_s = self._local_s()
        for topic in sorted(self._silent):
            role = self._roles[topic]
            request: dict[str, Any] = {"op": "subscribe", "id": f"regen:{role}", "topic": topic}
            if role in THINNED:
                request["throttle_rate"] = int(EVERY_S[role] * 1000)
            send(msgspec.json.encode(request).decode())

    def idle(self, send: Send) -> None:
        if self._silent and self._local_s() - self._asked_s > ASK_S:
            self.begin(send)

    def read(self, message: str | bytes, send: Send) -> None:
        """One operation of the server; anything but a message of a topic that was asked for is passed over."""
        try:
            operation = msgspec.json.decode(message, type=Operation)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
            return
        role = self._roles.get(operation.topic)
        if operation.op != "publish" or role is None:
            return
        self._silent.discard(operation.topic)
        try:
            kind, found = _read(role, operation)
        except ProviderFailed as error:
            self._leave_out(role, error.reason)
            return
        self._receive(role, kind, found)


def _read(role: Role, operation: Operation) -> tuple[str, Any]:
    """The message by the first type of its role that it fits: the protocol does not name it."""
    trouble = ProviderFailed(because("topic_message_unusable", topic=operation.topic, error=""))
    kinds = ros_messages.TYPES[role]
    for kind in sorted(kinds, key=lambda one: one == ros_messages.POSE):
        try:
            return kind, ros_messages.of_json(operation.msg, kind, topic=operation.topic)
        except ProviderFailed as error:
            trouble = error
    raise trouble
