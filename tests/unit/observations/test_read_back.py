"""A message is read back from its channel by a client of its own: text and images by their own checksums."""

from pathlib import Path

import pytest

from app.i18n.reasons.rendering import sentence
from harness.adapters.providers.messaging.folder import FolderOutbox
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.messaging.read_back import FolderReader, MemoryReader, MessageReadBack
from harness.adapters.stores.memory import MemoryBlobStore
from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import RequestId, sha256
from harness.contracts.measurements import Measurement, ReadBack
from harness.contracts.values import decode

KEY = RequestId("a" * 64)
PICTURE = b"\xff\xd8\xffpicture"


@pytest.fixture
def blobs() -> MemoryBlobStore:
    return MemoryBlobStore()


def read(source: MessageReadBack, blobs: MemoryBlobStore, text: str = "The passage is clear.") -> ReadBack:
    (found,) = source.measure(Measurement(requests=(KEY,), text=text, from_s=1.0, until_s=2.0))
    assert (found.kind, found.origin) == ("read_back", "sensor")
    return decode(blobs.get(found.blob), ReadBack)


def test_a_stored_message_is_read_back_with_the_checksums_of_its_files(tmp_path: Path, blobs: MemoryBlobStore) -> None:
    image = blobs.put(PICTURE)
    FolderOutbox(tmp_path, blobs=blobs).send(KEY, "The passage is clear.", [image])
    found = read(MessageReadBack(lambda _: FolderReader(tmp_path), keep=blobs.put), blobs)
    assert (
        found.found and found.images == (image,) and found.text == found.asked_text == sha256(b"The passage is clear.")
    )


def test_a_message_that_was_deleted_is_not_found(tmp_path: Path, blobs: MemoryBlobStore) -> None:
    FolderOutbox(tmp_path, blobs=blobs).send(KEY, "The passage is clear.", [blobs.put(PICTURE)])
    (tmp_path / KEY / "image-1.jpg").unlink()
    assert not read(MessageReadBack(lambda _: FolderReader(tmp_path), keep=blobs.put), blobs).found


def test_a_picture_that_was_exchanged_on_the_disk_has_another_checksum(tmp_path: Path, blobs: MemoryBlobStore) -> None:
    image = blobs.put(PICTURE)
    FolderOutbox(tmp_path, blobs=blobs).send(KEY, "The passage is clear.", [image])
    (tmp_path / KEY / "image-1.jpg").write_bytes(b"\xff\xd8\xffanother")
    assert read(MessageReadBack(lambda _: FolderReader(tmp_path), keep=blobs.put), blobs).images != (image,)


def test_a_read_path_that_fails_is_told_apart_from_a_message_that_is_not_there(
    tmp_path: Path, blobs: MemoryBlobStore
) -> None:
    (tmp_path / KEY).mkdir()
    (tmp_path / KEY / "message.json").write_bytes(b"{")
    with pytest.raises(StoreUnavailable):
        FolderReader(tmp_path).find(KEY)
    found = read(MessageReadBack(lambda _: FolderReader(tmp_path), keep=blobs.put), blobs)
    assert not found.found and "cannot be read back" in sentence(found.problem)


def test_a_head_that_names_files_elsewhere_is_no_message(tmp_path: Path, blobs: MemoryBlobStore) -> None:
    (tmp_path / KEY).mkdir()
    (tmp_path / KEY / "message.json").write_bytes(b'{"text": "hi", "files": ["../../secret"]}')
    assert FolderReader(tmp_path).find(KEY) is None


def test_a_channel_in_memory_is_read_back_too(blobs: MemoryBlobStore) -> None:
    outbox = MemoryOutbox()
    source = MessageReadBack(lambda _: MemoryReader(outbox), keep=blobs.put)
    assert not read(source, blobs).found
    outbox.send(KEY, "The passage is clear.", [sha256(PICTURE)])
    assert read(source, blobs).images == (sha256(PICTURE),)
