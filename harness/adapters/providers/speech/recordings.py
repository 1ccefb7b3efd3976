"""Remembers which recordings were taken for which request: the same samples never count for another one."""

import io
import threading
import wave
from pathlib import Path

from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import Digest, RequestId, sha256
from harness.contracts.reasons import because


class RecordingClaims:
    """One line per recording in a file of the data folder; in memory where there is none.

    Samples are compared, not files: another header or tag changes nothing. A copy that was played, filtered or encoded
    again has other samples, and is not known here.
    """

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._lock = threading.Lock()
        self._claimed = _read(file) if file is not None else {}

    def claim(self, recording: bytes, request: RequestId) -> bool:
        """Whether these samples are this request's: it claims them first. Raises StoreUnavailable if that is lost."""
        samples = _digest(recording)
        with self._lock:
            if samples not in self._claimed and self._file is not None:
                _keep(self._file, samples, request)
            return self._claimed.setdefault(samples, request) == request


def _keep(file: Path, samples: Digest, request: RequestId) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8") as lines:
            lines.write(f"{samples} {request}\n")
    except OSError as error:
        raise StoreUnavailable(because("recorded", text=str(error)), where=str(file)) from error


def _read(file: Path) -> dict[Digest, RequestId]:
    """What was claimed before; a line that was cut short is left out."""
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return {}
    pairs = [line.split() for line in lines]
    claimed: dict[Digest, RequestId] = {}
    for pair in pairs:
        if len(pair) == 2 and len(pair[0]) == 64:
            claimed.setdefault(Digest(pair[0]), RequestId(pair[1]))
    return claimed


def _digest(recording: bytes) -> Digest:
    """SHA-256 over the samples of a WAV; over all bytes of anything else."""
    try:
        with wave.open(io.BytesIO(recording)) as file:
            return sha256(file.readframes(file.getnframes()))
    except (wave.Error, EOFError):
        return sha256(recording)
