"""Buffers the blobs of a replay in one anonymous temporary file, so that memory does not grow with what was read."""

import tempfile
import weakref
from collections.abc import Iterator

from harness.contracts.errors import BlobDamaged
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because


class DiskBuffer:
    """A blob store on disk that lives as long as this object. Implements the BlobStore port."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="regen-replay-")  # noqa: SIM115 - closed by the finaliser
        self._places: dict[bytes, tuple[int, int]] = {}
        self._end = 0
        self.close = weakref.finalize(self, self._file.close)

    def put(self, body: bytes) -> Digest:
        digest = sha256(body)
        key = bytes.fromhex(digest)
        if key not in self._places:
            self._file.seek(self._end)
            self._file.write(body)
            self._places[key] = (self._end, len(body))
            self._end += len(body)
        return digest

    def get(self, digest: Digest) -> bytes:
        """Raises BlobDamaged if it was never put, or if the temporary file no longer holds it."""
        if not self.has(digest):
            raise BlobDamaged(because("blob_not_replayed", digest=digest))
        at, length = self._places[bytes.fromhex(digest)]
        self._file.seek(at)
        body = self._file.read(length)
        if sha256(body) != digest:
            raise BlobDamaged(because("replayed_blob_changed", digest=digest))
        return body

    def has(self, digest: Digest) -> bool:
        return len(digest) == 64 and bytes.fromhex(digest) in self._places

    def erase(self, digest: Digest) -> None:
        """Forget where it is; the file ends with this object."""
        if self.has(digest):
            del self._places[bytes.fromhex(digest)]

    def digests(self) -> Iterator[Digest]:
        return (Digest(key.hex()) for key in self._places)
