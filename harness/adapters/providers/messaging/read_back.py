"""Reads delivered messages back from their channel, with clients that share nothing with the ones that send."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import msgspec
from msgspec import UNSET

from harness.contracts.errors import HarnessError, StoreUnavailable
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, RequestId, sha256
from harness.contracts.measurements import Measurement, ReadBack, StoredMessage
from harness.contracts.ports import MessageReadPath
from harness.contracts.reasons import Explanation, because
from harness.contracts.values import encode

SOURCE = "message read path"
Keep = Callable[[bytes], Digest]
_NO_PROBLEM: Explanation = ""


class FolderReader:
    """MessageReadPath of a FolderOutbox's folder: every file is read and its checksum computed again."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def find(self, key: str) -> StoredMessage | None:
        """None unless the message and every file that it names are there."""
        place = self._folder / key
        try:
            if not (place / "message.json").is_file():
                return None
            head = msgspec.json.decode((place / "message.json").read_bytes(), type=_Head)
            if any(Path(name).name != name or not (place / name).is_file() for name in head.files):
                return None
            images = tuple(sha256((place / name).read_bytes()) for name in head.files)
        except (OSError, msgspec.MsgspecError) as error:
            raise StoreUnavailable(because("message_unreadable", error=str(error)), where=str(place)) from error
        return StoredMessage(text=head.text, images=images)


class HeldMessages(Protocol):
    """Messages that a channel holds in this process's memory."""

    def held(self, key: str) -> tuple[str, Sequence[Digest]] | None: ...


class MemoryReader:
    """MessageReadPath of a channel in memory. It holds checksums in place of files."""

    def __init__(self, channel: HeldMessages) -> None:
        self._channel = channel

    def find(self, key: str) -> StoredMessage | None:
        held = self._channel.held(key)
        return StoredMessage(text=held[0], images=tuple(held[1])) if held else None


class MessageReadBack:
    """IndependentSource of `message_stored`: whether the channel holds what was to be sent, asked again for the goal.

    `reader_of` gives a channel's read path by its name, None for one that cannot be read. A read path that does not
    answer gives a reading that says so; it never passes for a message that is not there.
    """

    predicate = "message_stored"
    lasting = True
    able = True

    def __init__(self, reader_of: Callable[[str], MessageReadPath | None], *, keep: Keep) -> None:
        self._reader_of, self._keep = reader_of, keep

    def measure(self, measurement: Measurement) -> tuple[EvidenceReference, ...]:
        """One reading per request, kind "read_back"; the text that was found is kept as a blob."""
        return tuple(self._read(request, measurement) for request in measurement.requests)

    def _read(self, request: RequestId, measurement: Measurement) -> EvidenceReference:
        message, problem = None, _NO_PROBLEM
        try:
            reader = self._reader_of(measurement.channel)
            message = reader.find(request) if reader else None
            problem = _NO_PROBLEM if reader else because("channel_not_readable", channel=measurement.channel)
        except HarnessError as error:
            problem = error.reason
        reading = ReadBack(
            request_id=request,
            found=message is not None,
            asked_text=self._keep(measurement.text.encode()),
            text=self._keep(message.text.encode()) if message else None,
            images=message.images if message else (),
            problem=problem,
            channel=measurement.channel or UNSET,
            copies=message.copies if message and message.copies > 1 else UNSET,
        )
        channel = {"channel": measurement.channel} if measurement.channel else {}
        return EvidenceReference(
            kind="read_back",
            origin="sensor",
            source=SOURCE,
            from_s=measurement.until_s,
            until_s=measurement.until_s,
            confidence=1.0,
            blob=self._keep(encode(reading)),
            values={"request_id": request, "asked_text": reading.asked_text, **channel},
        )


class _Head(msgspec.Struct, frozen=True):
    """The part of a stored message's head that is read."""

    text: str
    files: tuple[str, ...]
