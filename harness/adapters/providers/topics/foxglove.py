"""Reads topics from a Foxglove WebSocket server: it subscribes to channels, and never publishes or calls."""

import struct
from collections.abc import Sequence
from typing import Any

import msgspec

from harness.adapters.providers.recording.messages import Decoder
from harness.adapters.providers.recording.raw_messages import Channel, Raw
from harness.adapters.providers.topics import ros_messages
from harness.adapters.providers.topics.ros_messages import Role
from harness.adapters.providers.topics.websocket_link import Send
from harness.adapters.providers.topics.witness import LeaveOut, Receive, Topics
from harness.contracts.errors import ProviderFailed, RecordingInvalid
from harness.contracts.reasons import because

MESSAGE = struct.Struct("<BIQ")
"""The head of a binary message: opcode, subscription, the server's time of reception in nanoseconds."""
MESSAGE_OPCODE = 1
ERROR_LEVEL = 2
MOST_REPEATS = 5
READABLE = ("json", "cdr", "ros1")


class ChannelOffer(msgspec.Struct, frozen=True, rename="camel"):
    """One channel, as the server advertises it."""

    id: int
    topic: str
    encoding: str
    schema_name: str = ""
    schema: str = ""
    schema_encoding: str = ""


class ServerOperation(msgspec.Struct, frozen=True, rename="camel"):
    """What the server sends as text."""

    op: str
    channels: tuple[ChannelOffer, ...] = ()
    channel_ids: tuple[int, ...] = ()
    level: int = 0


class FoxgloveDialogue:
    """One connection to a server of the Foxglove WebSocket protocol, of the SDK's or of the bridge's version."""

    subprotocols: Sequence[str] = ("foxglove.sdk.v1", "foxglove.websocket.v1")

    def __init__(self, topics: Topics, receive: Receive, leave_out: LeaveOut, *, where: str) -> None:
        self._roles = {topic: role for role, topic in topics.items()}
        self._receive, self._leave_out = receive, leave_out
        self._decoder = Decoder(where=where)
        self._channels: dict[int, tuple[Role, Channel]] = {}
        self._silent: set[int] = set()
        self._repeats = 0

    def begin(self, send: Send) -> None:
        """The server speaks first."""

    def idle(self, send: Send) -> None:
        """A channel that appears later is advertised by the server."""

    def read(self, message: str | bytes, send: Send) -> None:
        if isinstance(message, bytes):
            self._message(message)
            return
        try:
            operation = msgspec.json.decode(message, type=ServerOperation)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
            return
        for channel in operation.channel_ids if operation.op == "unadvertise" else ():
            self._channels.pop(channel, None)
            self._silent.discard(channel)
        for offer in operation.channels if operation.op == "advertise" else ():
            self._subscribe(offer, send)
        if operation.op == "status" and operation.level >= ERROR_LEVEL:
            self._repeat(send)

    def _repeat(self, send: Send) -> None:
        """Ask again for what has not come: a server may refuse a subscription to a channel that it offered just now.

        A few times for each connection, as an error may be about anything.
        """
        if not self._silent or self._repeats == MOST_REPEATS:
            return
        self._repeats += 1
        channels = sorted(self._silent)
        send(msgspec.json.encode({"op": "unsubscribe", "subscriptionIds": channels}).decode())
        self._send_subscriptions(channels, send)

    @staticmethod
    def _send_subscriptions(channels: Sequence[int], send: Send) -> None:
        rows = [{"id": channel, "channelId": channel} for channel in channels]
        send(msgspec.json.encode({"op": "subscribe", "subscriptions": rows}).decode())

    def _subscribe(self, offer: ChannelOffer, send: Send) -> None:
        """Subscribe where the channel is one of ours and can be read; a subscription has its channel's number."""
        role, kind = self._roles.get(offer.topic), ros_messages.full_name(offer.schema_name)
        if role is None or offer.id in self._channels:
            return
        if offer.encoding not in READABLE:
            self._leave_out(role, because("topic_encoding_unreadable", topic=offer.topic, encoding=offer.encoding[:40]))
        elif kind not in ros_messages.TYPES[role]:
            types = ros_messages.TYPES[role]
            self._leave_out(role, because("topic_type_unusable", topic=offer.topic, type=kind[:80], types=types))
        else:
            own = Channel(offer.topic, kind, offer.encoding, offer.schema_encoding, offer.schema)
            self._channels[offer.id] = (role, own)
            self._silent.add(offer.id)
            self._send_subscriptions([offer.id], send)

    def _message(self, message: bytes) -> None:
        if len(message) < MESSAGE.size or message[0] != MESSAGE_OPCODE:
            return
        _, subscription, log_ns = MESSAGE.unpack_from(message)
        if subscription not in self._channels:
            return
        self._silent.discard(subscription)
        role, channel = self._channels[subscription]
        try:
            found = self._decoded(channel, log_ns, message[MESSAGE.size :])
        except (ProviderFailed, RecordingInvalid) as error:
            self._leave_out(role, error.reason)
            return
        self._receive(role, channel.type, found)

    def _decoded(self, channel: Channel, log_ns: int, body: bytes) -> Any:
        if channel.encoding == "json":
            return ros_messages.of_json(body, channel.type, topic=channel.topic)
        return self._decoder.decode(Raw(log_ns, channel, body))
