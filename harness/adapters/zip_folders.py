"""Unpacks a zip of one folder's files: plain names, bounded bytes, no links. Anybody may have made it.

A process with limits does it, for the directory of a zip is read as a whole.
"""

import stat
import zipfile
from pathlib import Path, PurePosixPath

from harness.adapters.limited_process import Limits, run_limited
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

MOST_FILES = 200
PIECE_BYTES = 1 << 20


class ZipToUnpack(Value):
    """What the process that reads a zip is asked."""

    file: str
    folder: str
    most_bytes: int


class UnpackedFiles(Value):
    """The names of the files, as they stand in the folder now."""

    names: tuple[str, ...]


def unpacked_zip(file: Path, folder: Path, *, most_bytes: int) -> tuple[str, ...]:
    """Write the files of a zip into an existing folder. Raises ContractInvalid for a zip that is none, with files of
    more than one folder, of one name, with links, or with more bytes than these."""
    mib = most_bytes / 2**20
    limits = Limits(memory_bytes=512 * 2**20, cpu_s=20.0 + mib, wall_s=120.0 + 4 * mib, output_bytes=most_bytes)
    task = ZipToUnpack(file=str(file.absolute()), folder=str(folder.absolute()), most_bytes=most_bytes)
    answer = run_limited(unpack, encode(task), limits, failure=ContractInvalid, where=file.name)
    return decode(answer, UnpackedFiles).names


def unpack(request: bytes) -> bytes:
    """Unpack it in this very process. Raises ContractInvalid."""
    task = decode(request, ZipToUnpack)
    names: list[str] = []
    left = task.most_bytes
    try:
        with zipfile.ZipFile(task.file) as opened:
            for name, entry in _entries(opened):
                left -= _written(opened, entry, Path(task.folder) / name, most_bytes=left)
                names.append(name)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise ContractInvalid(because("zip_unreadable", error=str(error)[:200])) from error
    return encode(UnpackedFiles(names=tuple(names)))


def _entries(opened: zipfile.ZipFile) -> list[tuple[str, zipfile.ZipInfo]]:
    """Each file with its plain name; all of them lie in one folder."""
    found = [one for one in opened.infolist() if not one.is_dir() and "__MACOSX" not in one.filename]
    paths = [PurePosixPath(one.filename) for one in found]
    names = [one.name for one in paths]
    links = any(stat.S_ISLNK(one.external_attr >> 16) for one in found)
    outside = any(one.is_absolute() or ".." in one.parts for one in paths)
    if not found or len(found) > MOST_FILES or links or outside:
        raise ContractInvalid(because("zip_not_a_folder", limit=MOST_FILES))
    if len({one.parent for one in paths}) > 1 or len(set(names)) < len(names):
        raise ContractInvalid(because("zip_not_a_folder", limit=MOST_FILES))
    return list(zip(names, found, strict=True))


def _written(opened: zipfile.ZipFile, entry: zipfile.ZipInfo, file: Path, *, most_bytes: int) -> int:
    """How many bytes it has, counted as they come and not as the zip says."""
    size = 0
    with opened.open(entry) as packed, file.open("xb") as plain:
        while piece := packed.read(PIECE_BYTES):
            size += len(piece)
            if size > most_bytes:
                raise ContractInvalid(because("zip_too_large", limit_bytes=most_bytes))
            plain.write(piece)
    return size
