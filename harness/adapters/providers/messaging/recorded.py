"""Sends through a remote channel at most once for each key: what was begun and what was sent is recorded on disk first.

A message that may have been sent is looked for in the channel, and where nobody can look it is not sent again.
"""

import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import msgspec

from harness.adapters.replaced_files import replacing
from harness.contracts.errors import (
    ChannelUnreachable,
    DeliveryUnknown,
    HarnessError,
    ProviderFailed,
    StoreUnavailable,
)
from harness.contracts.ids import Digest, sha256
from harness.contracts.ports import MessageReadPath
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

WAITS_S = (0.5, 2.0)
"""How long is waited between two tries, wall seconds: what was not reached may be reached a moment later."""
LOOKS, LOOK_S = 5, 1.0
"""How often, and how far apart, a message that may be under way is looked for before it counts as not sent."""
_KEY = re.compile(r"[A-Za-z0-9_-]{1,200}")
Note = Callable[[str], None]


class MessageService(Protocol):
    """The sending end of one remote channel."""

    def send(self, key: str, text: str, images: Sequence[Digest], *, sent: Sequence[str], note: Note) -> None:
        """Send the parts that follow those already `sent`; `note` takes the id of each as soon as it was taken.

        Raises ChannelUnreachable and ChannelRefused where the next part was not sent, DeliveryUnknown where nobody
        knows.
        """

    def state(self, ids: Sequence[str]) -> str:
        """What the service answers of parts that were sent; empty where it cannot be asked. Raises as `send`."""


class SendingRecord(Value):
    """What is known of one message. `begun`: a part was handed over and its end is not known; `ids`: what the channel
    returned for each part; `done`: all of it was sent; `state`: what the service then answered of it. Wall times.
    """

    key: str
    content: Digest
    begun: bool
    begun_s: float
    ids: tuple[str, ...] = ()
    done: bool = False
    sent_s: float | None = None
    state: str = ""


class RecordedOutbox:
    """MessageOutbox of a remote channel. `folder` holds one record for each key; None keeps them in this process.

    `reader` finds a message that may have been sent. `wait` pauses between tries.
    """

    def __init__(
        self,
        channel: str,
        service: MessageService,
        *,
        folder: Path | None,
        reader: MessageReadPath | None = None,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        self._channel, self._service, self._folder = channel, service, folder
        self._reader, self._wait = reader, wait
        self._records: dict[str, SendingRecord] = {}

    def send(self, key: str, text: str, images: Sequence[Digest]) -> str:
        """The channel's ids of the message. Raises ProviderFailed as the service does, and StoreUnavailable."""
        if not _KEY.fullmatch(key):
            raise ProviderFailed(because("message_key_invalid", key=key), where=self._channel)
        content = sha256(encode([key, text, tuple(images)]))
        record = self._load(key) or SendingRecord(key=key, content=content, begun=False, begun_s=time.time())
        if record.content != content:
            raise ProviderFailed(because("message_sent_otherwise", key=key), where=self._channel)
        if record.begun and not record.done:
            record = self._looked_for(record)
        for wait_s in (*WAITS_S, None):
            if record.done:
                break
            try:
                record = self._sent(record, text, images)
            except ChannelUnreachable:
                record = self._load(key) or record
                if wait_s is None:
                    raise
                self._wait(wait_s)
            except DeliveryUnknown:
                record = self._looked_for(self._load(key) or record)
        if not record.done:
            raise DeliveryUnknown(because("delivery_unknown_for_good", channel=self._channel, key=key))
        return _acknowledged(self._channel, record)

    def _sent(self, record: SendingRecord, text: str, images: Sequence[Digest]) -> SendingRecord:
        """The record of a message of which every part was taken. `begun` stands while the outcome is open."""
        records = [self._keep(msgspec.structs.replace(record, begun=True, begun_s=time.time()))]

        def note(message_id: str) -> None:
            records.append(self._keep(msgspec.structs.replace(records[-1], ids=(*records[-1].ids, message_id))))

        try:
            self._service.send(record.key, text, images, sent=record.ids, note=note)
        except (DeliveryUnknown, StoreUnavailable):
            raise  # a part may have been sent, or was, and nobody could write that down
        except HarnessError:
            self._keep(msgspec.structs.replace(records[-1], begun=False))
            raise
        sent_s = time.time()
        try:
            state = self._service.state(records[-1].ids)
        except ChannelUnreachable:
            state = "query=unanswered"
        return self._keep(msgspec.structs.replace(records[-1], done=True, sent_s=sent_s, state=state))

    def _looked_for(self, record: SendingRecord) -> SendingRecord:
        """What became of a message that may have been sent. Raises DeliveryUnknown where the channel cannot say."""
        if self._reader is None:
            raise DeliveryUnknown(because("delivery_unknown_for_good", channel=self._channel, key=record.key))
        for look in range(LOOKS):
            if look:
                self._wait(LOOK_S)
            try:
                found = self._reader.find(record.key)
            except HarnessError as error:
                raise DeliveryUnknown(
                    because("delivery_not_looked_up", channel=self._channel, key=record.key, problem=error.reason)
                ) from error
            if found is not None:
                done = msgspec.structs.replace(record, done=True, sent_s=record.begun_s, ids=(*record.ids, "found"))
                return self._keep(done)
        return self._keep(msgspec.structs.replace(record, begun=False))

    def _load(self, key: str) -> SendingRecord | None:
        if self._folder is None:
            return self._records.get(key)
        file = self._folder / f"{key}.json"
        try:
            return decode(file.read_bytes(), SendingRecord) if file.exists() else None
        except (OSError, msgspec.MsgspecError) as error:
            raise StoreUnavailable(because("outbox_unusable", error=str(error)), where=str(file)) from error

    def _keep(self, record: SendingRecord) -> SendingRecord:
        """The record, durable before anything else happens. Raises StoreUnavailable."""
        self._records[record.key] = record
        if self._folder is not None:
            file = self._folder / f"{record.key}.json"
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
                with replacing(file) as stream:
                    stream.write(encode(record))
            except OSError as error:
                raise StoreUnavailable(because("outbox_unusable", error=str(error)), where=str(file)) from error
        return record


def _acknowledged(channel: str, record: SendingRecord) -> str:
    """The channel, and every id that it returned."""
    state = f" {record.state}" if record.state else ""
    return f"{channel}:{','.join(record.ids) or 'accepted'}{state}"
