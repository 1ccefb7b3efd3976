"""Copies the files of a data folder for a backup: databases at one instant, everything else byte by byte."""

import hashlib
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import Digest
from harness.contracts.reasons import because

DATABASES = ("events.db", "accounts.db")
FOLDERS = ("blobs", "spool", "outbox", "providers", "robots")
KEYS = "keys"
"""Lists, memory and snapshots of other installations are not copied: they are built again from the log."""
_UNFINISHED = "incoming"


def copy_database(source: Path, target: Path) -> None:
    """One SQLite database as it stands at one instant, also while a process writes it. Raises StoreUnavailable."""
    try:
        with (
            closing(sqlite3.connect(f"{source.absolute().as_uri()}?mode=ro", uri=True)) as opened,
            closing(sqlite3.connect(target)) as copy,
        ):
            opened.backup(copy)
    except (sqlite3.Error, OSError) as error:
        raise StoreUnavailable(because("backup_uncopied", error=str(error)), where=str(source)) from error


def copy_tree(source: Path, target: Path) -> None:
    """Every file below a folder; one that vanishes meanwhile was not part of anything yet. Raises StoreUnavailable."""
    for file in files_below(source):
        to = target / file.relative_to(source)
        to.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        try:
            shutil.copyfile(file, to)
            to.chmod(0o600)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise StoreUnavailable(
                because("backup_uncopied", error=error.strerror or str(error)), where=str(file)
            ) from error


def files_below(folder: Path) -> Iterator[Path]:
    """Regular files below a folder, by name; no link is followed, and nothing that is still being written."""
    for path in sorted(folder.rglob("*")) if folder.is_dir() else ():
        if path.is_file() and not path.is_symlink() and _UNFINISHED not in path.relative_to(folder).parts[:1]:
            yield path


def digest_of(file: Path) -> Digest:
    """SHA-256 of a file. Raises StoreUnavailable."""
    try:
        with file.open("rb") as opened:
            return Digest(hashlib.file_digest(opened, "sha256").hexdigest())
    except OSError as error:
        raise StoreUnavailable(
            because("backup_uncopied", error=error.strerror or str(error)), where=str(file)
        ) from error
