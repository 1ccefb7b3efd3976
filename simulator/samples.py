"""Buffers the robot's newest sensor samples, with rising sequence numbers, and the bytes they cite."""

from collections import OrderedDict
from itertools import islice
from pathlib import Path

from harness.contracts.errors import BlobDamaged
from harness.contracts.ids import Digest, sha256
from harness.contracts.observations import AnySample, Pose
from harness.contracts.protocol import Observations
from harness.contracts.reasons import because

KEPT_SAMPLES = 40_000
KEPT_BYTES = 48 * 1024 * 1024
KEPT_FILES = 400
RECENT = 4000


class SampleRing:
    """The newest KEPT_SAMPLES to 2 * KEPT_SAMPLES samples, in order of `seq`, which is contiguous."""

    def __init__(self, newest: int = 0) -> None:
        self._samples: list[AnySample] = []
        self.newest = newest
        """The last sequence number given away."""

    def pose_age_s(self, at_s: float) -> float | None:
        """How old the newest pose among the last RECENT samples is, by its sensor time; None without one."""
        newest = next((one.at_s for one in islice(reversed(self._samples), RECENT) if isinstance(one, Pose)), None)
        return None if newest is None else at_s - newest

    def next(self) -> int:
        """The sequence number for the next sample; `add` uses it up."""
        return self.newest + 1

    def add(self, sample: AnySample) -> None:
        self.newest = sample.seq
        self._samples.append(sample)
        if len(self._samples) > 2 * KEPT_SAMPLES:
            del self._samples[:KEPT_SAMPLES]

    def after(self, seq: int, *, limit: int, at_s: float) -> Observations:
        """Samples with a sequence number above `seq`, oldest first. Forgotten ones are silently absent."""
        first = self._samples[0].seq if self._samples else self.newest + 1
        start = max(0, seq + 1 - first)
        found = tuple(self._samples[start : start + limit])
        return Observations(samples=found, next_seq=found[-1].seq if found else seq, at_s=at_s)


class SensorBlobs:
    """Scans in memory, images in memory or in `folder`; the oldest are forgotten first."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._held: OrderedDict[Digest, bytes] = OrderedDict()
        self._size = 0
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)

    def keep(self, body: bytes) -> Digest:
        """Store for as long as there is room."""
        digest = sha256(body)
        if digest not in self._held:
            self._held[digest] = body
            self._size += len(body)
            while self._size > KEPT_BYTES:
                self._size -= len(self._held.popitem(last=False)[1])
        return digest

    def keep_image(self, body: bytes) -> Digest:
        """Store across a restart where there is a folder."""
        digest = self.keep(body)
        if self._folder is not None:
            (self._folder / digest).write_bytes(body)
            files = sorted(self._folder.iterdir(), key=lambda path: path.stat().st_mtime)
            for path in files[:-KEPT_FILES]:
                path.unlink()
        return digest

    def get(self, digest: Digest) -> bytes:
        """Raises BlobDamaged if it is unknown, forgotten or changed on disk."""
        body = self._held.get(digest)
        if body is None and self._folder is not None and digest.isalnum() and (self._folder / digest).exists():
            body = (self._folder / digest).read_bytes()
        if body is None or sha256(body) != digest:
            raise BlobDamaged(because("robot_blob_not_held", blob=digest[:16]))
        return body
