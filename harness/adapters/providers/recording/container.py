"""Detects the kind of a recording and opens its reader: MCAP, rosbag2, ROS 1 bag, trajectory, CARMEN log."""

import hashlib
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePath
from typing import Annotated

import msgspec

from harness.adapters.bounded_yaml import plain_values
from harness.adapters.providers.recording import bag_reader, mcap_reader
from harness.adapters.providers.recording.bag_reader import BagReader
from harness.adapters.providers.recording.mcap_reader import McapReader
from harness.adapters.providers.recording.packing import ZSTD_MAGIC, unpack_file
from harness.adapters.providers.recording.raw_messages import MessageReader, reading
from harness.adapters.providers.recording.sqlite_reader import SqliteReader
from harness.adapters.providers.recording.topics import TopicSettings
from harness.adapters.providers.recording.trajectory_reader import TrajectoryReader, trajectory_format
from harness.contracts.errors import ContractInvalid, RecordingInvalid
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because

SQLITE_MAGIC = b"SQLite format 3\x00"
TIMES = "times.txt"
"""Stamps of a trajectory without any, one a line, in one folder with it: KITTI keeps them apart."""
LONGEST_METADATA = 2**22
"""Characters of metadata.yaml: a topic with its types and qualities of service takes about a thousand."""


class _Metadata(msgspec.Struct):
    """What is read of metadata.yaml; there is more in it."""

    relative_file_paths: tuple[str, ...]
    storage_identifier: str
    message_count: Annotated[int, msgspec.Meta(ge=0)]
    compression_mode: str | None = None


class _Described(msgspec.Struct):
    rosbag2_bagfile_information: _Metadata


class Container:
    """A recording on disk: `digest` names its bytes, `reader` reads them, `declared` is its folder's message count.

    The digest of a folder is the SHA-256 over its files' names and digests, in the order that its metadata gives.
    """

    def __init__(self, path: Path, *, settings: TopicSettings, recover: bool = False) -> None:
        self.declared: int | None = None
        self._settings = settings
        self._unpacked = ExitStack()
        if not path.exists():
            raise RecordingInvalid(because("recording_absent"), where=str(path))
        with reading(path):
            self.reader: MessageReader
            if path.is_dir():
                self._folder(path, recover=recover)
            else:
                self.digest = _file_digest(path)
                self._file(path, recover=recover)

    def close(self) -> None:
        """Remove unpacked copies; nothing can be read afterwards."""
        self._unpacked.close()

    def _file(self, path: Path, *, recover: bool) -> None:
        with path.open("rb") as file:
            start = file.read(16)
        if not start:
            raise RecordingInvalid(because("recording_empty"), where=str(path))
        if start.startswith(ZSTD_MAGIC):
            self.reader = McapReader([self._unpack(path)], names=[path], recover=recover)
        elif start.startswith(mcap_reader.MAGIC):
            self.reader = McapReader([path], names=[path], recover=recover)
        elif start.startswith(bag_reader.MAGIC):
            self.reader = BagReader(path, recover=recover)
        elif start.startswith(SQLITE_MAGIC):
            self.reader = SqliteReader([path], names=[path])
        elif trajectory_format(path):
            self.reader = TrajectoryReader(path, times=None, settings=self._settings, recover=recover)
        else:
            raise RecordingInvalid(because("not_a_recording", start=repr(start[:8])), where=str(path))

    def _folder(self, path: Path, *, recover: bool) -> None:
        if (path / TIMES).exists() and not (path / "metadata.yaml").exists():
            self._timed(path, recover=recover)
            return
        described = _metadata(path)
        files = [path / PurePath(name).name for name in described.relative_file_paths]
        missing = [file.name for file in files if not file.exists()]
        if missing:
            raise RecordingInvalid(
                because("recording_files_missing", files=len(files), count=len(missing), missing=tuple(missing)),
                where=str(path),
            )
        self.digest = _named_digest(files)
        self.declared = described.message_count
        packed = (described.compression_mode or "").upper() == "FILE"
        paths = [self._unpack(file) if packed else file for file in files]
        match described.storage_identifier:
            case "mcap":
                self.reader = McapReader(paths, names=files, recover=recover)
            case "sqlite3":
                self.reader = SqliteReader(paths, names=files)
            case other:
                raise RecordingInvalid(because("recording_storage_unknown", storage=str(other)), where=str(path))

    def _timed(self, path: Path, *, recover: bool) -> None:
        """A trajectory without stamps beside its times."""
        poses = [one for one in sorted(path.glob("*.txt")) if one.name != TIMES and trajectory_format(one)]
        if len(poses) != 1:
            raise RecordingInvalid(because("trajectory_ambiguous", count=len(poses), times=TIMES), where=str(path))
        self.digest = _named_digest([poses[0], path / TIMES])
        self.reader = TrajectoryReader(poses[0], times=path / TIMES, settings=self._settings, recover=recover)

    def _unpack(self, path: Path) -> Path:
        copy = self._unpacked.enter_context(_temporary())
        with copy.open("wb") as into:
            unpack_file(path, into)
        return copy


@contextmanager
def _temporary() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="regen-recording-") as folder:
        yield Path(folder) / "unpacked"


def _metadata(path: Path) -> _Metadata:
    file = path / "metadata.yaml"
    if not file.exists():
        raise RecordingInvalid(because("recording_metadata_missing"), where=str(path))
    try:
        read = plain_values(file.read_text(), where=str(file), longest=LONGEST_METADATA)
        return msgspec.convert(read, _Described).rosbag2_bagfile_information
    except ContractInvalid as error:
        raise RecordingInvalid(because("recording_metadata_unusable", error=error.what), where=str(file)) from error
    except (msgspec.ValidationError, UnicodeDecodeError) as error:
        raise RecordingInvalid(because("recording_metadata_unusable", error=str(error)), where=str(file)) from error


def _named_digest(files: list[Path]) -> Digest:
    return sha256("".join(f"{file.name}\n{_file_digest(file)}\n" for file in files).encode())


def _file_digest(path: Path) -> Digest:
    with path.open("rb") as file:
        return Digest(hashlib.file_digest(file, "sha256").hexdigest())
