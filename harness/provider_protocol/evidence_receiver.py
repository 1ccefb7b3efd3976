"""Receives a robot's spooled evidence and serves it for reading, as a robot serves its own: in order and whole.

An entry that comes again changes nothing; one that comes early is left out, and the answer says what follows next. The
clock of what is served is the newest entry's: evidence that came late is late.
"""

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

from harness.contracts.errors import BlobDamaged, ProviderFailed
from harness.contracts.ids import Digest, sha256
from harness.contracts.observations import AnySample
from harness.contracts.ports import Provider
from harness.contracts.protocol import Observations, PhysicalStart, RobotStatus
from harness.contracts.reasons import because
from harness.provider_protocol.operations import Names, Operation, provider_operations
from harness.provider_protocol.spool import EvidenceSpool, SpoolBatch, SpoolEntry, SpoolHead

KEPT_SAMPLES = 40_000
KEPT_BYTES = 64 * 1024 * 1024
KEPT_ENTRIES = 50_000


class EvidenceReceiver:
    """What one robot uploaded, on disk in `folder`. Implements the reading half of `contracts.ports.Robot`.

    `skipped`: samples that the robot itself had forgotten before they were spooled.
    """

    def __init__(self, folder: Path, *, robot_id: str) -> None:
        self._spool, self._robot_id = EvidenceSpool(folder), robot_id
        self._samples: list[AnySample] = []
        self._blobs: OrderedDict[Digest, bytes] = OrderedDict()
        self._size = 0
        self.skipped = 0
        for entry in self._spool.entries():
            self._take(entry)

    def receive(self, batch: SpoolBatch) -> SpoolHead:
        """Take what follows, and say how far the chain is held. Raises ProviderFailed for another robot's upload, and
        for a chain that contradicts the one here."""
        if batch.robot_id != self._robot_id:
            raise ProviderFailed(because("request_misdirected", named=batch.robot_id, own=self._robot_id))
        for entry in sorted(batch.entries, key=lambda one: one.seq):
            if self._spool.append(entry):
                self._take(entry)
        self._spool.forget(self._spool.head.seq - KEPT_ENTRIES)
        return self._spool.head

    def providers(self) -> Sequence[Provider]:
        """Nothing is started by this way."""
        return ()

    def status(self) -> RobotStatus:
        """The robot's condition at the newest entry. Raises ProviderFailed while nothing came."""
        return self._newest().status

    def observations(self, after: int, limit: int = 5000) -> Observations:
        """Samples in the robot's order; `at_s` is the newest entry's. Raises ProviderFailed while nothing came."""
        at_s = self._newest().at_s
        first = next((place for place, one in enumerate(self._samples) if one.seq > after), len(self._samples))
        found = tuple(self._samples[first : first + limit])
        return Observations(samples=found, next_seq=found[-1].seq if found else after, at_s=at_s)

    def blob(self, digest: Digest) -> bytes:
        """Raises BlobDamaged for bytes that never came, or are no longer held."""
        body = self._blobs.get(digest)
        if body is None:
            raise BlobDamaged(because("robot_blob_not_held", blob=digest[:16]))
        return body

    def starts(self) -> Sequence[PhysicalStart]:
        """The start journal is the robot's own, and read there."""
        return ()

    def _newest(self) -> SpoolEntry:
        if self._spool.newest is None:
            raise ProviderFailed(because("nothing_received"))
        return self._spool.newest

    def _take(self, entry: SpoolEntry) -> None:
        self.skipped += entry.skipped
        self._samples.extend(entry.samples)
        if len(self._samples) > 2 * KEPT_SAMPLES:
            del self._samples[:KEPT_SAMPLES]
        for digest, body in entry.blobs.items():
            if sha256(body) == digest and digest not in self._blobs:
                self._blobs[digest] = body
                self._size += len(body)
        while self._size > KEPT_BYTES:
            self._size -= len(self._blobs.popitem(last=False)[1])


def receiver_operations(receiver: EvidenceReceiver) -> tuple[Operation, ...]:
    """Reading as of any robot, and the upload."""

    def upload(names: Names, body: SpoolBatch) -> SpoolHead:
        return receiver.receive(body)

    return (
        *(one for one in provider_operations(receiver) if one.method == "GET"),
        Operation("POST", "/spool", "Spooled evidence, once per entry", SpoolHead, upload, body=SpoolBatch),
    )
