"""Layout of the data folder, and the check that it can be used. Opens no store."""

import os
import shutil
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

from harness.contracts.errors import StoreUnavailable
from harness.contracts.reasons import because

FLOOR_BYTES = 64 * 1024 * 1024
"""A mission is not begun with less free space than this."""
KEPT = ("*.db", "*.db-wal", "*.db-shm", "owner.lock", "blobs", "spool", "robots")
"""What the harness keeps directly in a data folder."""


@dataclass(frozen=True)
class DataFolder:
    """Where the harness keeps its data under `root`."""

    root: Path

    @property
    def log(self) -> Path:
        return self.root / "events.db"

    @property
    def log_url(self) -> str:
        return f"sqlite:///{self.log}"

    @property
    def blobs(self) -> Path:
        return self.root / "blobs"

    @property
    def spool(self) -> Path:
        return self.root / "spool"

    @property
    def outbox(self) -> Path:
        """Messages as files, for people and channels to pick up."""
        return self.root / "outbox"

    @property
    def robots(self) -> Path:
        """Where robots that run as child processes keep their worlds and start journals."""
        return self.root / "robots"


def existing(root: Path) -> DataFolder:
    """A folder that already holds a log; nothing is created. Raises StoreUnavailable where there is none."""
    folder = DataFolder(root.absolute())
    if not folder.log.is_file():
        raise StoreUnavailable(because("no_log_here"), where=str(folder.root))
    return folder


def prepare(root: Path, *, floor_bytes: int = FLOOR_BYTES) -> DataFolder:
    """Create the folder if it is not there, and try to write to it. What lies in it is for its owner only: a
    folder with a log that others may enter, because an earlier release or a umask made it so, is closed to them.

    Raises StoreUnavailable if it is no folder, cannot be written, or its disk has less than `floor_bytes` free.
    """
    root = root.absolute()
    try:
        root.mkdir(parents=True, exist_ok=True, mode=0o700)
        _closed_to_others(root)
        with tempfile.TemporaryFile(dir=root) as trial:
            trial.write(b"\0")
            trial.flush()
            os.fsync(trial.fileno())
        free = shutil.disk_usage(root).free
    except OSError as error:
        raise StoreUnavailable(
            because("data_folder_unusable", error=error.strerror or str(error)), where=str(root)
        ) from error
    if free < floor_bytes:
        raise StoreUnavailable(
            because("disk_full", free_mib=free // 2**20, needed_mib=floor_bytes // 2**20), where=str(root)
        )
    return DataFolder(root)


def _closed_to_others(root: Path) -> None:
    """Modes 0700 and 0600 for a folder that already holds a log, and for what the harness keeps in it.

    A folder without a log, one that several users share (sticky), and what belongs to another user stay as they are.
    """
    is_sticky = root.stat().st_mode & stat.S_ISVTX
    if is_sticky or not (root / "events.db").is_file():
        return
    for path in (root, *(one for pattern in KEPT for one in root.glob(pattern))):
        found = path.lstat()
        known = stat.S_ISDIR(found.st_mode) or stat.S_ISREG(found.st_mode)
        if known and found.st_uid == os.geteuid() and stat.S_IMODE(found.st_mode) & 0o077:
            path.chmod(0o700 if stat.S_ISDIR(found.st_mode) else 0o600)
