"""Remembers which recordings were taken for which request: neither their samples nor a copy count for another one."""

import io
import threading
import wave
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cachetools import LRUCache

from harness.adapters.providers.speech.copies import RoomNoise, copied, noise_of
from harness.contracts.errors import HarnessError, StoreUnavailable
from harness.contracts.ids import Digest, RequestId, sha256
from harness.contracts.reasons import because

MOST_COMPARED = 40
"""So many of the newest recordings are compared by their noise; the samples themselves with all."""


@dataclass(frozen=True)
class RecordingClaim:
    """The request that samples were first recorded for, and the blob that holds them; older files name no blob."""

    request: RequestId
    blob: Digest | None = None


class RecordingClaims:
    """One line per recording in a file of the data folder; in memory where there is none. `read` fetches earlier ones.

    Samples are compared, not files: another header or tag changes nothing. A copy has other samples and the same noise.
    """

    def __init__(self, file: Path | None, *, read: Callable[[Digest], bytes]) -> None:
        self._file, self._read = file, read
        self._lock = threading.Lock()
        self._claimed = _stored(file) if file is not None else {}
        self._noises: LRUCache[Digest, RoomNoise | None] = LRUCache(maxsize=MOST_COMPARED)

    def earlier(self, recording: bytes, request: RequestId, *, blob: Digest) -> RequestId | None:
        """The other request that this recording, or what it is a copy of, was taken for; None claims it for this one.

        Raises StoreUnavailable if the claim cannot be kept.
        """
        samples = _digest(recording)
        with self._lock:
            known = self._claimed.get(samples)
            if known is not None:
                return known.request if known.request != request else None
            if found := self._copied(recording, request):
                return found
            claim = RecordingClaim(request, blob)
            if self._file is not None:
                _keep(self._file, samples, claim)
            self._claimed[samples] = claim
            return None

    def _copied(self, recording: bytes, request: RequestId) -> RequestId | None:
        mine = noise_of(recording)
        others = [one for one in self._claimed.values() if one.request != request and one.blob][-MOST_COMPARED:]
        for claim in reversed(others) if mine is not None else ():
            other = self._noise(claim)
            if other is not None and mine is not None and copied(mine, other):
                return claim.request
        return None

    def _noise(self, claim: RecordingClaim) -> RoomNoise | None:
        """The noise of an earlier recording; none where its bytes are gone."""
        if claim.blob is None:
            return None
        if claim.blob not in self._noises:
            try:
                self._noises[claim.blob] = noise_of(self._read(claim.blob))
            except HarnessError:
                return None
        return self._noises[claim.blob]


def _keep(file: Path, samples: Digest, claim: RecordingClaim) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8") as lines:
            lines.write(f"{samples} {claim.request} {claim.blob}\n")
    except OSError as error:
        raise StoreUnavailable(because("recorded", text=str(error)), where=str(file)) from error


def _stored(file: Path) -> dict[Digest, RecordingClaim]:
    """What was claimed before; a line that was cut short is left out."""
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return {}
    claimed: dict[Digest, RecordingClaim] = {}
    for parts in (line.split() for line in lines):
        if len(parts) in (2, 3) and all(len(one) == 64 for one in parts[::2]):
            claim = RecordingClaim(RequestId(parts[1]), Digest(parts[2]) if len(parts) == 3 else None)
            claimed.setdefault(Digest(parts[0]), claim)
    return claimed


def _digest(recording: bytes) -> Digest:
    """SHA-256 over the samples of a WAV; over all bytes of anything else."""
    try:
        with wave.open(io.BytesIO(recording)) as file:
            return sha256(file.readframes(file.getnframes()))
    except (wave.Error, EOFError):
        return sha256(recording)
