"""What every blob store keeps: bytes under their own digest, whole or not at all."""

import re
import resource
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.adapters.stores.blob_address import open_blobs
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.memory import MemoryBlobStore
from harness.contracts.errors import BlobDamaged, ContractInvalid, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.ports import BlobStore
from tests.builders.object_store import ObjectStore, object_store
from tests.saying import raises_saying
from tests.unit.stores.processes import kill, lines, running


@pytest.fixture(scope="module")
def service() -> Iterator[ObjectStore]:
    with pytest.MonkeyPatch.context() as monkeypatch, object_store(monkeypatch) as running_service:
        yield running_service


@pytest.fixture(params=["memory", "files", "bucket"])
def blobs(request: pytest.FixtureRequest, tmp_path: Path, service: ObjectStore) -> BlobStore:
    stores: dict[str, Callable[[], BlobStore]] = {
        "memory": MemoryBlobStore,
        "files": lambda: open_blobs("", tmp_path / "blobs"),
        "bucket": lambda: open_blobs(service.address(), tmp_path / "blobs"),
    }
    return stores[request.param]()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "blobs"


def file_of(folder: Path, digest: Digest) -> Path:
    return folder / digest[:2] / digest[2:4] / digest


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> list[BlobStore]:
    return [MemoryBlobStore(), FileBlobStore(tmp_path_factory.mktemp("kept"))]


@settings(deadline=None)
@given(bodies=st.lists(st.binary(max_size=2000), max_size=5))
def test_every_blob_is_found_again_under_its_sha256(kept: list[BlobStore], bodies: list[bytes]) -> None:
    for blobs in kept:
        digests = [blobs.put(body) for body in bodies]
        assert digests == [sha256(body) for body in bodies]
        assert [blobs.get(digest) for digest in digests] == bodies
        listed = list(blobs.digests())
        assert set(digests) <= set(listed)
        assert listed == sorted(set(listed))


@pytest.mark.parametrize("bodies", [[b""], [b"image", bytes(2000)], [bytes([number]) for number in range(20)]])
def test_a_bucket_finds_every_blob_again_and_lists_it_in_order(
    service: ObjectStore, folder: Path, bodies: list[bytes]
) -> None:
    blobs = open_blobs(service.address(), folder)
    assert [blobs.get(blobs.put(body)) for body in bodies] == bodies
    assert list(blobs.digests()) == sorted({sha256(body) for body in bodies})


def test_what_was_never_put_is_missing(blobs: BlobStore) -> None:
    digest = sha256(b"never put")
    assert not blobs.has(digest)
    with raises_saying(BlobDamaged, match=digest):
        blobs.get(digest)
    assert list(blobs.digests()) == []


@pytest.mark.parametrize(
    "name",
    ["", "abc", "A" * 64, "../../../../etc/passwd", "a" * 63 + "/", "a" * 64 + "\n", "a" * 65, "ab/../" + "a" * 58],
)
def test_what_is_no_digest_names_no_blob_and_no_path(blobs: BlobStore, name: str) -> None:
    assert not blobs.has(Digest(name))
    with pytest.raises(BlobDamaged):
        blobs.get(Digest(name))


@pytest.mark.parametrize("more", ["\n", "/", "/../../../../owner.lock", "0"])
def test_what_follows_a_digest_makes_it_none(folder: Path, more: str) -> None:
    blobs = FileBlobStore(folder)
    digest = blobs.put(b"image")
    with raises_saying(BlobDamaged, match="is no digest"):
        blobs.get(Digest(digest + more))


def test_the_same_bytes_are_kept_once(blobs: BlobStore) -> None:
    assert blobs.put(b"image") == blobs.put(b"image")
    assert len(list(blobs.digests())) == 1


def test_many_threads_may_put_the_same_blobs(blobs: BlobStore) -> None:
    bodies = [bytes([number]) * 5000 for number in range(8)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(blobs.put, bodies * 8))
    assert set(found) == {sha256(body) for body in bodies} == set(blobs.digests())
    assert [blobs.get(sha256(body)) for body in bodies] == bodies


def test_what_is_erased_is_gone_and_may_be_erased_again(blobs: BlobStore) -> None:
    digest, other = blobs.put(b"voice"), blobs.put(b"scan")
    blobs.erase(digest)
    blobs.erase(digest)
    assert not blobs.has(digest)
    assert list(blobs.digests()) == [other]
    with pytest.raises(BlobDamaged):
        blobs.get(digest)


def test_files_lie_in_two_levels_by_digest_and_nothing_else_is_left(folder: Path) -> None:
    blobs = FileBlobStore(folder)
    digest = blobs.put(b"image")
    assert [path for path in folder.rglob("*") if path.is_file()] == [file_of(folder, digest)]
    assert FileBlobStore(folder).get(digest) == b"image"


@pytest.mark.parametrize("spoiled", [b"imagE", b"imag", b"", b"image "])
def test_changed_bytes_are_refused_and_mended_by_putting_them_again(folder: Path, spoiled: bytes) -> None:
    blobs = FileBlobStore(folder)
    digest = blobs.put(b"image")
    file_of(folder, digest).write_bytes(spoiled)
    with raises_saying(BlobDamaged, match="does not match") as caught:
        blobs.get(digest)
    assert caught.value.where == str(file_of(folder, digest))
    assert blobs.put(b"image") == digest
    assert blobs.get(digest) == b"image"


def test_a_killed_writer_leaves_whole_blobs_only(folder: Path) -> None:
    with running("blobs", str(folder)) as child:
        acknowledged = lines(child, 30) + kill(child)
    blobs = FileBlobStore(folder)
    digests = list(blobs.digests())
    assert set(acknowledged) <= set(digests)
    assert [sha256(blobs.get(digest)) for digest in digests] == digests
    assert blobs.discard_unfinished() <= 1
    assert blobs.discard_unfinished() == 0


def test_what_a_killed_writer_left_unfinished_is_no_blob_and_can_be_discarded(folder: Path) -> None:
    blobs = FileBlobStore(folder)
    digest = blobs.put(b"image")
    (folder / "incoming" / "tmp0").write_bytes(b"half an im")
    assert list(blobs.digests()) == [digest]
    assert blobs.discard_unfinished() == 1
    assert list(blobs.digests()) == [digest]


def test_a_full_disk_is_said_and_leaves_nothing_behind(folder: Path) -> None:
    blobs = FileBlobStore(folder)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000_000, hard))
        with raises_saying(StoreUnavailable, match=re.escape(str(folder))):
            blobs.put(bytes(20_000_001))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert [path for path in folder.rglob("*") if path.is_file()] == []


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with raises_saying(StoreUnavailable, match=r"cannot be written.*file"):
        FileBlobStore(tmp_path / "file" / "blobs")


@pytest.mark.parametrize("spoiled", [b"imagE", b"imag", b"", b"image "])
def test_changed_objects_are_refused_and_mended_by_putting_them_again(
    service: ObjectStore, folder: Path, spoiled: bytes
) -> None:
    address = service.address()
    bucket = address.removeprefix("s3://").partition("/")[0]
    blobs = open_blobs(address, folder)
    digest = blobs.put(b"image")
    service.write(bucket, f"evidence/{digest[:2]}/{digest[2:4]}/{digest}", spoiled)
    with raises_saying(BlobDamaged, match="does not match") as caught:
        blobs.get(digest)
    assert caught.value.where == f"s3://{bucket}/evidence/{digest[:2]}/{digest[2:4]}/{digest}"
    assert blobs.put(b"image") == digest
    assert blobs.get(digest) == b"image"


def test_two_hosts_share_a_bucket_and_what_lies_beside_its_blobs_is_none(service: ObjectStore, tmp_path: Path) -> None:
    address = service.address()
    bucket = address.removeprefix("s3://").partition("/")[0]
    one, other = open_blobs(address, tmp_path / "one"), open_blobs(address, tmp_path / "other")
    digest = one.put(b"image")
    service.write(bucket, "evidence/README", b"what this is")
    service.write(bucket, f"elsewhere/{digest[:2]}/{digest[2:4]}/{digest}", b"of another site")
    assert other.get(digest) == b"image"
    assert list(other.digests()) == [digest]
    other.erase(digest)
    assert not one.has(digest)


def test_a_copy_that_cannot_be_erased_with_its_object_is_said(service: ObjectStore, folder: Path) -> None:
    def no_copy(digest: Digest) -> None:
        raise PermissionError("the outbox is read only")

    blobs = open_blobs(service.address(), folder, copies=no_copy)
    digest = blobs.put(b"voice")
    with raises_saying(StoreUnavailable, match="read only"):
        blobs.erase(digest)


def test_a_service_that_is_gone_is_an_outage_and_no_damage(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    with object_store(monkeypatch) as short_lived:
        blobs = open_blobs(short_lived.address(), folder)
        digest = blobs.put(b"image")
        elsewhere = short_lived.address()
    asks: list[Callable[[], object]] = [
        lambda: blobs.put(b"image"),
        lambda: blobs.get(digest),
        lambda: blobs.has(digest),
        lambda: list(blobs.digests()),
        lambda: blobs.erase(digest),
        lambda: open_blobs(elsewhere, folder),
    ]
    for ask in asks:
        with raises_saying(StoreUnavailable, match="object store"):
            ask()


def test_a_bucket_that_is_not_there_is_said_when_it_is_opened(service: ObjectStore, folder: Path) -> None:
    with raises_saying(StoreUnavailable, match="NoSuchBucket|404"):
        open_blobs(service.address(make=False), folder)


@pytest.mark.parametrize(
    "address",
    ["https://bucket/evidence", "s3:///evidence", "s3://key:secret@bucket", "s3://bucket?password=x", "bucket"],
)
def test_an_address_of_another_kind_is_refused_without_being_shown(folder: Path, address: str) -> None:
    with raises_saying(ContractInvalid, match="s3://BUCKET") as caught:
        open_blobs(address, folder)
    assert address not in str(caught.value)
