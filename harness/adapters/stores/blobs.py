"""Stores content-addressed files: FOLDER/ab/cd/abcd..., named by the SHA-256 of their bytes. Never changes one.

A blob is written under another name, synced, then renamed, so that its digest names all of it or nothing.
"""

import os
import re
from collections.abc import Callable, Iterator
from logging import getLogger
from pathlib import Path
from uuid import uuid4

from harness.adapters.replaced_files import OWN, replacing, sync_folder
from harness.contracts.errors import BlobDamaged, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because

LOG = getLogger(__name__)
_DIGEST = re.compile("[0-9a-f]{64}")
_INCOMING = "incoming"
EraseCopies = Callable[[Digest], object]


def no_copies(digest: Digest) -> None:
    """There is nothing beside the blobs."""


class FileBlobStore:
    """Blobs below `folder`, created on first use. Safe between threads and processes.

    `copies` removes what else in the data folder holds a blob's bytes, when it is erased. Raises StoreUnavailable if
    the folder cannot be used or the disk is full.
    """

    def __init__(self, folder: Path, *, copies: EraseCopies = no_copies) -> None:
        self._folder, self._copies = folder, copies
        self._incoming = folder / _INCOMING
        try:
            self._incoming.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._unavailable(error) from error

    def put(self, body: bytes) -> Digest:
        """Durable on return. Writing the same bytes again is free, and repairs a damaged file."""
        digest = sha256(body)
        path = self._path(digest)
        try:
            if not _holds(path, body):
                self._write(path, body)
            sync_folder(path.parent)
        except OSError as error:
            raise self._unavailable(error) from error
        return digest

    def get(self, digest: Digest) -> bytes:
        """Bytes that match the digest; raises BlobDamaged if they are missing, changed or unreadable."""
        path = self._path(digest)
        try:
            body = path.read_bytes()
        except OSError as error:
            raise BlobDamaged(
                because("blob_not_readable", digest=digest, error=error.strerror or str(error)), where=str(path)
            ) from error
        if sha256(body) != digest:
            raise BlobDamaged(because("blob_differs", digest=digest), where=str(path))
        return body

    def has(self, digest: Digest) -> bool:
        """Whether there is a file of that digest. Only `get` looks inside."""
        return _DIGEST.fullmatch(digest) is not None and os.path.isfile(self._file(digest))

    def digests(self) -> Iterator[Digest]:
        """All digests, in ascending order."""
        for first in sorted(self._folder.glob("[0-9a-f][0-9a-f]")):
            for second in sorted(first.iterdir()):
                for path in sorted(second.iterdir()):
                    if _DIGEST.fullmatch(path.name):
                        yield Digest(path.name)

    def erase(self, digest: Digest) -> None:
        """Unlink the file, durably, and the copies. The disk may hold its blocks until they are written over."""
        path = self._path(digest)
        try:
            if path.is_file():
                path.unlink()
                sync_folder(path.parent)
            self._copies(digest)
        except OSError as error:
            raise self._unavailable(error) from error

    def discard_unfinished(self) -> int:
        """Remove what a killed writer left behind; returns how much. Only for the owner of the data folder.

        Raises StoreUnavailable.
        """
        try:
            left = list(self._incoming.iterdir())
            for path in left:
                path.unlink(missing_ok=True)
        except OSError as error:
            raise self._unavailable(error) from error
        return len(left)

    def _write(self, path: Path, body: bytes) -> None:
        for folder in (path.parent.parent, path.parent):
            if not folder.is_dir():
                folder.mkdir(exist_ok=True)
                sync_folder(folder.parent)
        with replacing(path, beside=self._incoming / uuid4().hex, mode=OWN) as file:
            file.write(body)

    def _path(self, digest: Digest) -> Path:
        if not _DIGEST.fullmatch(digest):
            raise BlobDamaged(because("digest_invalid", digest=digest[:80]), where=str(self._folder))
        return Path(self._file(digest))

    def _file(self, digest: Digest) -> str:
        return f"{self._folder}/{digest[:2]}/{digest[2:4]}/{digest}"

    def _unavailable(self, error: OSError) -> StoreUnavailable:
        return StoreUnavailable(
            because("blob_store_unwritable", error=error.strerror or str(error)), where=str(self._folder)
        )


def owned_blobs(folder: Path, *, copies: EraseCopies = no_copies) -> FileBlobStore:
    """The blob store for the owner of the data folder, cleared of the unfinished blobs of a writer that was killed."""
    blobs = FileBlobStore(folder, copies=copies)
    if discarded := blobs.discard_unfinished():
        LOG.info("unfinished_blobs_discarded count=%d folder=%s", discarded, folder)
    return blobs


def _holds(path: Path, body: bytes) -> bool:
    try:
        return path.read_bytes() == body
    except FileNotFoundError:
        return False
