"""Backs a data folder up to a folder, and restores one from it: log, blobs and accounts, checked; keys apart."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

import msgspec

from harness.adapters.clock import SystemClock
from harness.adapters.stores import backup_files
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.folder import DataFolder, existing
from harness.adapters.stores.log_address import open_log
from harness.contracts.errors import BackupInvalid, StoreUnavailable
from harness.contracts.ids import Digest
from harness.contracts.ports import LogHead
from harness.contracts.reasons import because
from harness.contracts.values import Count, Value, decode, encode

FORMAT = "regenharness-backup/1"
MANIFEST, DATA = "backup.json", "data"
LARGEST_MANIFEST = 256 * 2**20


class BackupManifest(Value):
    """What a backup holds: the log's head, and every file with its SHA-256."""

    format: str
    taken_at_s: float
    head: LogHead
    blobs: Count
    files: dict[str, Digest]


def back_up(data: Path, target: Path, *, keys: Path | None = None) -> BackupManifest:
    """Copy a data folder into the new folder `target`, also while it is in use, and verify the copy.

    The log is copied first and the blobs after it, so that what it cites is there. Keys go to the folder `keys`, and
    nowhere if there is none: a backup without them cannot sign. Raises StoreUnavailable, LogDamaged.
    """
    folder = existing(data)
    _new(target)
    copy = target / DATA
    copy.mkdir(mode=0o700)
    for name in backup_files.DATABASES:
        if (folder.root / name).is_file():
            backup_files.copy_database(folder.root / name, copy / name)
    for name in backup_files.FOLDERS:
        backup_files.copy_tree(folder.root / name, copy / name)
    if keys is not None:
        _new(keys)
        backup_files.copy_tree(folder.root / backup_files.KEYS, keys)
    head, blobs = _checked(copy)
    files = {one.relative_to(copy).as_posix(): backup_files.digest_of(one) for one in backup_files.files_below(copy)}
    manifest = BackupManifest(format=FORMAT, taken_at_s=SystemClock().now().wall_s, head=head, blobs=blobs, files=files)
    (target / MANIFEST).write_bytes(encode(manifest))
    return manifest


def restore(source: Path, data: Path, *, keys: Path | None = None) -> BackupManifest:
    """A new data folder from a backup, every file compared with its digest before and the log verified after.

    `keys` is the folder that keys were copied to; without it new ones are made when something is signed.
    Raises BackupInvalid, StoreUnavailable, LogDamaged.
    """
    manifest = _manifest(source)
    copy = source / DATA
    for name, digest in manifest.files.items():
        if backup_files.digest_of(copy / name) != digest:
            raise BackupInvalid(because("backup_file_differs", name=name), where=str(source))
    _new(data)
    for name in manifest.files:
        target = data / name
        target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        target.write_bytes((copy / name).read_bytes())
        target.chmod(0o600)
    if keys is not None:
        backup_files.copy_tree(keys, data / backup_files.KEYS)
    head, _ = _checked(data)
    if head != manifest.head:
        raise BackupInvalid(
            because("backup_other_head", position=head.position, expected=manifest.head.position), where=str(source)
        )
    return manifest


def _manifest(source: Path) -> BackupManifest:
    try:
        body = (source / MANIFEST).read_bytes()
        if len(body) > LARGEST_MANIFEST:
            raise ValueError(f"it has {len(body)} bytes")
        manifest = decode(body, BackupManifest)
    except (OSError, ValueError, msgspec.MsgspecError) as error:
        raise BackupInvalid(because("backup_unreadable", error=str(error)), where=str(source)) from error
    if manifest.format != FORMAT:
        raise BackupInvalid(because("backup_unreadable", error=manifest.format), where=str(source))
    for name in _outside(manifest.files):
        raise BackupInvalid(because("backup_file_outside", name=name), where=str(source))
    return manifest


def _outside(names: dict[str, Digest]) -> Iterator[str]:
    """Names that would lead out of the folder."""
    for name in names:
        parts = PurePosixPath(name)
        if parts.is_absolute() or ".." in parts.parts or not parts.parts:
            yield name


def _checked(folder: Path) -> tuple[LogHead, int]:
    """The head of the verified log, and how many whole blobs there are. Raises LogDamaged, BlobDamaged.

    Opening a log brings it to this release's tables: a copy is opened, so that the release before still reads this one.
    """
    with TemporaryDirectory(prefix="regen-backup-") as name:
        copy = DataFolder(Path(name))
        backup_files.copy_database(existing(folder).log, copy.log)
        with closing(open_log(copy.log_url)) as log:
            head = log.verify()
    blobs = FileBlobStore(folder / "blobs")
    count = 0
    for digest in blobs.digests():
        blobs.get(digest)
        count += 1
    return head, count


def _new(folder: Path) -> None:
    """Make a folder for its owner alone. Raises StoreUnavailable if it is there and holds anything."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if any(folder.iterdir()):
            raise StoreUnavailable(because("backup_target_taken"), where=str(folder))
    except OSError as error:
        raise StoreUnavailable(
            because("backup_uncopied", error=error.strerror or str(error)), where=str(folder)
        ) from error
