"""Writes each message as one complete folder or not at all, for people and channels to pick up."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import msgspec

from harness.adapters.replaced_files import sync_folder
from harness.contracts.errors import ProviderFailed, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.ports import BlobStore
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

_SUFFIXES = ((b"\xff\xd8\xff", "jpg"), (b"\x89PNG\r\n\x1a\n", "png"))


class OutboxMessage(Value):
    """What `message.json` holds: the text, the files beside it with their checksums, and the acknowledgement."""

    key: str
    text: str
    images: tuple[Digest, ...]
    files: tuple[str, ...]
    acknowledgement: str


class FolderOutbox:
    """MessageOutbox on disk: `<folder>/<key>/message.json` and the image files, renamed into place when complete.

    Raises ProviderFailed for a key that came before with other contents, and StoreUnavailable when the folder cannot
    be written; nothing half-written is ever visible under a key.
    """

    def __init__(self, folder: Path, *, blobs: BlobStore) -> None:
        self._folder, self._blobs = folder, blobs

    def send(self, key: str, text: str, images: Sequence[Digest]) -> str:
        """Idempotent by key: a repeat returns the first acknowledgement and writes nothing."""
        if not key or not set(key) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-"):
            raise ProviderFailed(because("message_key_invalid", key=key), where=str(self._folder))
        place = self._folder / key
        try:
            if not place.exists():
                self._write(place, text=text, images=tuple(images))
            sent = decode((place / "message.json").read_bytes(), OutboxMessage)
        except (OSError, msgspec.MsgspecError) as error:
            raise StoreUnavailable(because("outbox_unusable", error=str(error)), where=str(place)) from error
        if (sent.text, sent.images) != (text, tuple(images)):
            raise ProviderFailed(because("message_sent_otherwise", key=key), where=str(place))
        return sent.acknowledgement

    def _write(self, place: Path, *, text: str, images: tuple[Digest, ...]) -> None:
        draft = self._folder / f".{place.name}.partial"
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        files = []
        for index, image in enumerate(images, start=1):
            body = self._blobs.get(image)
            files.append(f"image-{index}.{_suffix(body)}")
            _write_durably(draft / files[-1], body)
        content = sha256(encode([place.name, text, images]))
        message = OutboxMessage(
            key=place.name, text=text, images=images, files=tuple(files), acknowledgement=f"folder-{content[:16]}"
        )
        _write_durably(draft / "message.json", encode(message))
        sync_folder(draft)
        draft.rename(place)
        sync_folder(self._folder)


def erase_from_outbox(folder: Path, image: Digest) -> None:
    """Remove the copies of one picture from the messages of an outbox; texts and checksums stay. Raises OSError."""
    for described in folder.rglob("message.json"):
        body = described.read_bytes()
        if image.encode() not in body:
            continue
        message = decode(body, OutboxMessage)
        for digest, name in zip(message.images, message.files, strict=False):
            if digest == image:
                (described.parent / name).unlink(missing_ok=True)
        sync_folder(described.parent)


def _suffix(body: bytes) -> str:
    return next((suffix for magic, suffix in _SUFFIXES if body.startswith(magic)), "bin")


def _write_durably(path: Path, body: bytes) -> None:
    with path.open("wb") as file:
        file.write(body)
        file.flush()
        os.fsync(file.fileno())
