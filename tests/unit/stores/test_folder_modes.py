"""A data folder is for its owner only, however it was made."""

import stat
from pathlib import Path

from harness.adapters.stores.folder import prepare


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_a_new_folder_is_made_for_its_owner_only(tmp_path: Path) -> None:
    assert mode(prepare(tmp_path / "var").root) == 0o700


def test_a_folder_that_others_may_read_is_closed_to_them_with_what_is_in_it(tmp_path: Path) -> None:
    root = tmp_path / "var"
    (root / "blobs").mkdir(parents=True)
    for name in ("events.db", "events.db-wal", "accounts.db", "lists.db", "notes.txt"):
        (root / name).write_bytes(b"")
        (root / name).chmod(0o644)
    root.chmod(0o755)
    (root / "blobs").chmod(0o755)
    prepare(root)
    assert [mode(root / name) for name in ("", "blobs")] == [0o700, 0o700]
    assert {mode(root / name) for name in ("events.db", "events.db-wal", "accounts.db", "lists.db")} == {0o600}
    assert mode(root / "notes.txt") == 0o644, "what the harness did not put there is left alone"


def test_a_folder_without_a_log_or_one_that_users_share_is_left_as_it_is(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    prepare(tmp_path)
    assert mode(tmp_path) == 0o755
    (tmp_path / "events.db").write_bytes(b"")
    tmp_path.chmod(0o1777)
    prepare(tmp_path)
    assert mode(tmp_path) == 0o1777
