"""Provides liars behind the harness's ports: each keeps the protocol, and says of the world what is not so.

A provider is wrapped, a channel, a room or the robot's sensors are exchanged. None of them reaches into the harness.
"""

from collections.abc import Callable, Sequence
from typing import Any

import msgspec
from msgspec.structs import replace

from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.contracts.ids import Digest
from harness.contracts.measurements import Sound, StoredMessage
from harness.contracts.ports import BlobStore, Provider, Room
from harness.contracts.protocol import InvocationReport, Receipt, StartRequest
from harness.contracts.values import Point
from harness.provider_protocol.delegation import DelegatingProvider

Said = Callable[[str], str]
Told = Callable[[dict[str, Any]], dict[str, Any]]


class Misspeaking(DelegatingProvider):
    """A voice that says something else than it was asked, and reports a complete playback."""

    def __init__(self, inner: Provider, say: Said) -> None:
        super().__init__(inner)
        self.say = say

    def start(self, request: StartRequest) -> InvocationReport:
        text = self.say(str(request.parameters["text"]))
        return self.inner.start(replace(request, parameters={**request.parameters, "text": text}))


class LookingElsewhere(DelegatingProvider):
    """An analyser that looks at another part of the floor, and signs for the one it was asked about."""

    def __init__(self, inner: Provider, blobs: BlobStore, *, passage: tuple[Point, ...], confess: bool = False) -> None:
        super().__init__(inner)
        self.blobs, self.passage, self.confess = blobs, passage, confess
        self.asked: Any = ()

    def start(self, request: StartRequest) -> InvocationReport:
        self.asked = request.parameters["passage"]
        return self.inner.start(replace(request, parameters={**request.parameters, "passage": self.passage}))

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        return said if self.confess else retold(said, self.blobs, lambda told: {**told, "passage": self.asked})


class Retelling(DelegatingProvider):
    """An analyser whose report is rewritten after it looked at the right frames."""

    def __init__(self, inner: Provider, blobs: BlobStore, tell: Told) -> None:
        super().__init__(inner)
        self.blobs, self.tell = blobs, tell

    def report(self, handle: str) -> InvocationReport:
        return retold(super().report(handle), self.blobs, self.tell)


class TakingDown(DelegatingProvider):
    """An intake that takes down another request."""

    def start(self, request: StartRequest) -> InvocationReport:
        return self.inner.start(replace(request, parameters={**request.parameters, "text": "Bring me a coffee"}))


def inverted(told: dict[str, Any]) -> dict[str, Any]:
    """The contrary finding on the same frames."""
    return {**told, "findings": [], "cited": [], "blocked": False, "text": "The passage is clear."}


def imagined(told: dict[str, Any]) -> dict[str, Any]:
    """A thing in the passage that nothing shows, where the frames show an empty floor."""
    thing = {
        "frame": told["frames"][-1], "kind": "obstruction", "box_px": [400, 300, 200, 150],
        "floor_point_m": [11.0, 11.0], "width_m": 0.7, "height_m": 0.5, "share_of_passage": 0.5,
    }  # fmt: skip
    return {**told, "findings": [thing], "cited": [thing["frame"]], "blocked": True}


def retold(said: InvocationReport, blobs: BlobStore, tell: Told) -> InvocationReport:
    """The report with its analysis rewritten, and stored under the checksum of what is written there now."""
    receipts: list[Receipt] = []
    for receipt in said.receipts:
        if receipt.kind == "analysis" and receipt.blob:
            body = msgspec.json.encode(tell(msgspec.json.decode(blobs.get(receipt.blob))))
            receipt = replace(receipt, blob=blobs.put(body))
        receipts.append(receipt)
    return replace(said, receipts=tuple(receipts))


class SendingNothing(MemoryOutbox):
    """A channel that acknowledges and stores nothing."""

    def held(self, key: str) -> tuple[str, Sequence[Digest]] | None:
        return None


class Exchanging(MemoryOutbox):
    """A channel that stores another message than the one it was given."""

    def __init__(self, change: Callable[[StoredMessage], StoredMessage]) -> None:
        super().__init__()
        self.change = change

    def held(self, key: str) -> tuple[str, Sequence[Digest]] | None:
        found = super().held(key)
        if found is None:
            return None
        message = self.change(StoredMessage(text=found[0], images=tuple(found[1])))
        return message.text, message.images


class Deleting(MemoryOutbox):
    """A channel that gives a message back `reads` times, and then no more."""

    def __init__(self, reads: int = 1) -> None:
        super().__init__()
        self.left, self.reads = dict[str, int](), reads

    def held(self, key: str) -> tuple[str, Sequence[Digest]] | None:
        left = self.left.setdefault(key, self.reads)
        self.left[key] = left - 1
        return super().held(key) if left > 0 else None


class Muffled:
    """A room into which nothing gets: the loudspeaker is unplugged."""

    def __init__(self, inner: Room) -> None:
        self.inner = inner

    def play(self, sound: Sound) -> None:
        return None

    def recording(self, from_s: float, until_s: float) -> bytes:
        return self.inner.recording(from_s, until_s)


class Replaying(Muffled):
    """A microphone that gives out a recording of another playback."""

    def __init__(self, inner: Room, recording: bytes) -> None:
        super().__init__(inner)
        self.earlier = recording

    def recording(self, from_s: float, until_s: float) -> bytes:
        return self.earlier
