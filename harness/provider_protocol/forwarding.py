"""Runs beside a robot on a bad link: reads its evidence into a spool, and uploads what the receiver does not have yet.

It starts nothing and stops nothing: what the robot may do while the link is down was authorised before, and the
robot's own watchdog ends it.
"""

from collections.abc import Callable
from logging import getLogger

from harness.contracts.errors import BlobDamaged, HarnessError, ProviderFailed
from harness.contracts.ids import Digest
from harness.contracts.observations import AnySample, Image, Scan
from harness.contracts.ports import Robot
from harness.contracts.protocol import RobotStatus
from harness.contracts.reasons import because
from harness.provider_protocol.spool import EvidenceSpool, SpoolBatch, SpoolEntry, SpoolHead, sealed

LOG = getLogger(__name__)
READ_AT_ONCE = 500
BYTES_EACH = 400_000
"""Of the blobs of one entry; a single one may be larger, up to LARGEST_BLOB."""
LARGEST_BLOB = 800_000
Upload = Callable[[SpoolBatch], SpoolHead]


class EvidenceForwarder:
    """`step` reads the robot and uploads. Killed at any moment, the next one on the same folder goes on.

    `upload` sends a batch and returns the receiver's head; it raises HarnessError where it does not get through.
    """

    def __init__(self, robot: Robot, spool: EvidenceSpool, upload: Upload, *, robot_id: str) -> None:
        self._robot, self._spool, self._upload, self._robot_id = robot, spool, upload, robot_id
        self._received: SpoolHead | None = None

    @property
    def behind(self) -> int:
        """How many entries the receiver does not have, as far as it is known."""
        return self._spool.head.seq - (self._received.seq if self._received else 0)

    def step(self) -> None:
        """Read once, upload once. What fails is logged, and tried again at the next step."""
        for act in (self.read, self.send):
            try:
                act()
            except HarnessError as error:
                LOG.warning("forwarding_failed act=%s code=%s %s", act.__name__, error.code, error)

    def read(self) -> None:
        """Everything new of the robot, durably. Raises HarnessError where the robot does not answer."""
        status, newest = self._robot.status(), self._spool.newest
        after = newest.next_seq if newest else 0
        while True:
            batch = self._robot.observations(after, READ_AT_ONCE)
            for samples in self._chunks(batch.samples) or [()]:
                self._add(status, samples, at_s=batch.at_s, after=after)
                after = samples[-1].seq if samples else after
            if len(batch.samples) < READ_AT_ONCE:
                return

    def send(self) -> None:
        """Upload until the receiver has everything. Raises HarnessError where it does not get through."""
        if self._received is None:
            self._received = self._known(self._upload(SpoolBatch(robot_id=self._robot_id)))
        while entries := self._spool.after(self._received.seq):
            before = self._received
            self._received = self._known(self._upload(SpoolBatch(robot_id=self._robot_id, entries=entries)))
            if self._received.seq <= before.seq:
                return
        self._spool.forget(self._received.seq)

    def _known(self, head: SpoolHead) -> SpoolHead:
        """Raises ProviderFailed for a receiver's head that is none of this chain, or that lies before what is left of
        it: one of the two folders was lost, and a person has to say which evidence counts."""
        if not self._spool.holds(head):
            raise ProviderFailed(because("spool_forked", seq=head.seq))
        return head

    def _chunks(self, samples: tuple[AnySample, ...]) -> list[tuple[AnySample, ...]]:
        """The samples in order, cut where the blobs they cite grow too many for one upload."""
        chunks: list[tuple[AnySample, ...]] = []
        chunk: list[AnySample] = []
        size = 0
        for sample in samples:
            length = len(self._bytes(sample.blob) or b"") if isinstance(sample, Scan | Image) else 0
            if chunk and size + length > BYTES_EACH:
                chunks.append(tuple(chunk))
                chunk, size = [], 0
            chunk.append(sample)
            size += length
        return [*chunks, tuple(chunk)] if chunk else chunks

    def _add(self, status: RobotStatus, samples: tuple[AnySample, ...], *, at_s: float, after: int) -> None:
        cited = {one.blob for one in samples if isinstance(one, Scan | Image)}
        found = {digest: body for digest in sorted(cited) if (body := self._bytes(digest)) is not None}
        head = self._spool.head
        entry = SpoolEntry(
            seq=head.seq + 1,
            previous=head.digest,
            at_s=at_s,
            status=status,
            samples=samples,
            next_seq=samples[-1].seq if samples else after,
            skipped=samples[0].seq - after - 1 if samples and self._spool.newest else 0,
            blobs=found,
        )
        self._spool.append(sealed(entry))

    def _bytes(self, digest: Digest) -> bytes | None:
        """None for bytes that the robot no longer holds, or that no upload could carry: the receiver lacks them then,
        and says so."""
        try:
            body = self._robot.blob(digest)
        except BlobDamaged:
            return None
        return body if len(body) <= LARGEST_BLOB else None
