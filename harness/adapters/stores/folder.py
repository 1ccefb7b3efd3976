"""Layout of the data folder, and the check that it can be used. Opens no store."""

import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from harness.contracts.errors import StoreUnavailable
from harness.contracts.reasons import because

FLOOR_BYTES = 64 * 1024 * 1024
"""A mission is not begun with less free space than this."""


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
    """Create the folder if it is not there, for its owner only, and try to write to it.

    Raises StoreUnavailable if it is no folder, cannot be written, or its disk has less than `floor_bytes` free.
    """
    root = root.absolute()
    try:
        root.mkdir(parents=True, exist_ok=True, mode=0o700)
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
