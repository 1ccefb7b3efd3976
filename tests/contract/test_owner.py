"""One owner per data folder: a second is told who it is, a killed one is followed."""

import os
import stat
from pathlib import Path

import pytest

from harness.adapters.stores.folder import prepare
from harness.adapters.stores.owner import OwnerLock, read_owner
from harness.contracts.errors import StoreOwned, StoreUnavailable
from tests.saying import raises_saying
from tests.unit.stores.processes import kill, lines, running

URL = "http://127.0.0.1:8000"


def test_a_folder_without_an_owner_has_none(tmp_path: Path) -> None:
    assert read_owner(tmp_path) is None


def test_the_owner_can_be_read_while_it_lives_and_not_after(tmp_path: Path) -> None:
    with OwnerLock(tmp_path) as lock:
        owner = lock.take(token="secret", url=URL)
        assert (owner.pid, owner.url, owner.token) == (os.getpid(), URL, "secret")
        assert read_owner(tmp_path) == owner
    assert read_owner(tmp_path) is None
    lock.release()


def test_an_owner_may_say_its_address_once_it_listens(tmp_path: Path) -> None:
    with OwnerLock(tmp_path) as lock:
        before = lock.take(token="a token that is much longer than the next one")
        after = lock.take(token="secret", url=URL)
        assert (before.url, after.url) == ("", URL)
        assert before.started_s == after.started_s
        assert read_owner(tmp_path) == after


def test_a_second_owner_is_told_the_first_ones_process_and_address(tmp_path: Path) -> None:
    with running("own", str(tmp_path), URL) as child:
        assert lines(child, 1) == ["owned"]
        with raises_saying(StoreOwned, match=f"process {child.pid} at {URL}") as caught:
            OwnerLock(tmp_path).take(token="other")
        assert caught.value.where == str(tmp_path)
        owner = read_owner(tmp_path)
        assert owner is not None
        assert (owner.pid, owner.url, owner.token) == (child.pid, URL, "secret")


def test_a_killed_owner_is_followed_at_once(tmp_path: Path) -> None:
    with running("own", str(tmp_path), URL) as child:
        assert lines(child, 1) == ["owned"]
        kill(child)
    assert b"secret" in (tmp_path / "owner.lock").read_bytes()
    assert read_owner(tmp_path) is None
    with OwnerLock(tmp_path) as lock:
        owner = lock.take(token="mine", url=URL)
        assert read_owner(tmp_path) == owner


def test_a_child_of_the_owner_does_not_keep_the_folder(tmp_path: Path) -> None:
    lock = OwnerLock(tmp_path)
    lock.take(token="secret")
    (tmp_path / "elsewhere").mkdir()
    with running("own", str(tmp_path / "elsewhere"), URL) as child:
        assert lines(child, 1) == ["owned"]
        lock.release()
        with OwnerLock(tmp_path) as next_one:
            assert next_one.take(token="next").pid == os.getpid()


def test_within_one_process_too_there_is_one_owner(tmp_path: Path) -> None:
    with OwnerLock(tmp_path) as lock:
        lock.take(token="secret", url=URL)
        with raises_saying(StoreOwned, match=str(os.getpid())):
            OwnerLock(tmp_path).take(token="other")
        assert read_owner(tmp_path) is not None


def test_only_its_owner_can_read_the_token(tmp_path: Path) -> None:
    path = tmp_path / "owner.lock"
    path.touch(mode=0o644)
    with OwnerLock(tmp_path) as lock:
        lock.take(token="secret")
        assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_a_folder_that_is_not_there_cannot_be_owned(tmp_path: Path) -> None:
    with raises_saying(StoreUnavailable, match=r"cannot be owned.*nowhere"):
        OwnerLock(tmp_path / "nowhere").take(token="secret")


def test_a_data_folder_is_made_for_its_owner_only(tmp_path: Path) -> None:
    folder = prepare(tmp_path / "deep" / "var", floor_bytes=1)
    assert folder.root == tmp_path / "deep" / "var"
    assert stat.S_IMODE(folder.root.stat().st_mode) == 0o700
    assert folder.log_url == f"sqlite:///{folder.root}/events.db"
    assert list(folder.root.iterdir()) == []
    assert prepare(folder.root, floor_bytes=1) == folder


def test_a_data_folder_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "var").write_bytes(b"")
    for root in (tmp_path / "var", tmp_path / "var" / "deeper"):
        with raises_saying(StoreUnavailable, match="--data") as caught:
            prepare(root)
        assert caught.value.where == str(root)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_data_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with raises_saying(StoreUnavailable, match="--data"):
        prepare(tmp_path)


def test_a_disk_without_room_is_refused_before_a_mission_begins(tmp_path: Path) -> None:
    with raises_saying(StoreUnavailable, match=r"MiB free, a mission needs \d+ MiB"):
        prepare(tmp_path, floor_bytes=2**62)
