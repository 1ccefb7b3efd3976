"""Receives files in pieces from browsers and command lines: recordings to replay, maps to import. Parses none of them.

A file is complete when all of its bytes are here; it stays until it is removed or its day is over.
"""

import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock

import msgspec

from app.views.uploaded_files import (
    BAG_METADATA,
    BUNDLES,
    CLOUDS,
    FLOOR_IMAGES,
    FLOORS,
    RECORDINGS,
    Kind,
    Upload,
    UploadPart,
)
from harness.adapters.replaced_files import replacing
from harness.adapters.zip_folders import unpacked_zip
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.reasons import because
from harness.contracts.values import decode, encode

MOST_OPEN = 20
PIECE_BYTES = 1 << 20
LASTS_S = 7 * 86_400.0
_UNNAMED = re.compile(r"[^\w.\-+ ()]", re.ASCII)
_ID = re.compile(r"[A-Za-z0-9_-]{20,64}")


class Uploads:
    """The files of one data folder. Safe between threads; a piece is added where the last one ended."""

    def __init__(self, folder: Path, *, most_bytes: int, clock: Callable[[], float], fresh: Callable[[], str]) -> None:
        self.most_bytes = most_bytes
        self._folder, self._clock, self._fresh = folder, clock, fresh
        self._lock = Lock()

    def all(self) -> tuple[Upload, ...]:
        """Every file, newest first."""
        with self._lock:
            found = [self._read(one.name) for one in self._folder.glob("*") if one.is_dir()]
        return tuple(sorted((one for one in found if one), key=lambda one: one.begun_s, reverse=True))

    def begin(self, name: str, *, size_bytes: int, by: str, parts: Sequence[UploadPart] = ()) -> Upload:
        """A place for a file, or for several as one. Raises ContractInvalid for another kind of file, one too large, or
        too many at once."""
        self._forget_old()
        plain_name, suffix = _plain(name), Path(_plain(name)).suffix.lower()
        files = tuple(UploadPart(name=_plain(one.name), size_bytes=one.size_bytes) for one in parts)
        if files and (
            sum(one.size_bytes for one in files) != size_bytes or len({one.name for one in files}) < len(files)
        ):
            raise ContractInvalid(because("upload_parts_differ"), where="parts")
        kind, main = _kind_of([one.name for one in files]) if files else (_kind(suffix), "")
        if kind is None and files:
            raise ContractInvalid(because("upload_folder_unknown"), where="parts")
        if kind is None:
            raise ContractInvalid(
                because("upload_kind_unknown", suffix=suffix or "-", known=(*RECORDINGS, *CLOUDS, *BUNDLES)),
                where="name",
            )
        if not 0 < size_bytes <= self.most_bytes:
            raise ContractInvalid(
                because("upload_too_large", size_bytes=size_bytes, limit_bytes=self.most_bytes), where="size_bytes"
            )
        if len(self.all()) >= MOST_OPEN:
            raise ContractInvalid(because("uploads_too_many", limit=MOST_OPEN))
        self._folder.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(self._folder).free < 2 * size_bytes:
            raise ContractInvalid(because("upload_without_space", size_bytes=size_bytes), where="size_bytes")
        upload = Upload(
            upload_id=self._fresh(),
            name=plain_name,
            kind=kind,
            size_bytes=size_bytes,
            received_bytes=0,
            by=by,
            begun_s=self._clock(),
            parts=files,
            main=main,
        )
        with self._lock:
            self._place(upload.upload_id).mkdir()
            (self._place(upload.upload_id) / upload.name).touch()
            self._write(upload)
        return upload

    def add(self, upload_id: str, *, offset: int, piece: bytes, by: str) -> Upload:
        """One more piece, at the place where the last one ended; the same piece again changes nothing.

        Raises ContractInvalid for another place or more bytes than were announced, UnknownName for no such file.
        """
        with self._lock:
            upload = self._found(upload_id)
            if upload.by != by:
                raise UnknownName(because("upload_unknown"))
            if offset + len(piece) == upload.received_bytes:
                return upload
            if offset != upload.received_bytes or offset + len(piece) > upload.size_bytes:
                raise ContractInvalid(
                    because("upload_piece_misplaced", offset=offset, expected=upload.received_bytes), where="offset"
                )
            with self._whole_file(upload).open("r+b") as file:
                file.seek(offset)
                file.write(piece)
                file.truncate()
            grown = msgspec.structs.replace(upload, received_bytes=offset + len(piece))
            if grown.complete:
                grown = self._unfolded(grown)
            self._write(grown)
            return grown

    def whole(self, upload_id: str) -> Upload:
        """A file whose bytes are all here. Raises UnknownName, ContractInvalid."""
        with self._lock:
            upload = self._found(upload_id)
        if not upload.complete:
            raise ContractInvalid(
                because("upload_incomplete", received_bytes=upload.received_bytes, size_bytes=upload.size_bytes)
            )
        return upload

    def path(self, upload: Upload) -> Path:
        """Where its bytes are: a file; of several, the folder of a recording or the file that describes a map."""
        if upload.kind == "map":
            return self._files(upload) / upload.main
        return self._files(upload) if upload.main else self._whole_file(upload)

    def _whole_file(self, upload: Upload) -> Path:
        """What was sent, as one file."""
        return self._place(upload.upload_id) / upload.name

    def _files(self, upload: Upload) -> Path:
        return self._place(upload.upload_id) / "files"

    def _unfolded(self, upload: Upload) -> Upload:
        """Several files as files again. Raises ContractInvalid for what is neither a rosbag2 folder nor a floor map;
        nothing of it stays then."""
        zipped = upload.kind == "folder"
        if not zipped and not upload.parts:
            return upload
        self._files(upload).mkdir(exist_ok=True)
        try:
            names = self._unzipped(upload) if zipped else self._split(upload)
            kind, main = _kind_of(names)
            if kind is None:
                raise ContractInvalid(because("upload_folder_unknown"), where=upload.name)
        except ContractInvalid:
            shutil.rmtree(self._place(upload.upload_id), ignore_errors=True)
            raise
        self._whole_file(upload).unlink()
        return msgspec.structs.replace(upload, kind=kind, main=main)

    def _unzipped(self, upload: Upload) -> Sequence[str]:
        return unpacked_zip(self._whole_file(upload), self._files(upload), most_bytes=self.most_bytes)

    def _split(self, upload: Upload) -> Sequence[str]:
        with self._whole_file(upload).open("rb") as whole:
            for part in upload.parts:
                with (self._files(upload) / part.name).open("xb") as file:
                    left = part.size_bytes
                    while left and (piece := whole.read(min(left, PIECE_BYTES))):
                        left -= len(piece)
                        file.write(piece)
        return [one.name for one in upload.parts]

    def remove(self, upload_id: str) -> None:
        """Take the file away, complete or not. Raises UnknownName."""
        with self._lock:
            self._found(upload_id)
            shutil.rmtree(self._place(upload_id), ignore_errors=True)

    def _forget_old(self) -> None:
        for one in self.all():
            if self._clock() - one.begun_s > LASTS_S:
                self.remove(one.upload_id)

    def _found(self, upload_id: str) -> Upload:
        found = self._read(upload_id) if _ID.fullmatch(upload_id) else None
        if found is None:
            raise UnknownName(because("upload_unknown"))
        return found

    def _place(self, upload_id: str) -> Path:
        return self._folder / upload_id

    def _read(self, upload_id: str) -> Upload | None:
        try:
            return decode((self._place(upload_id) / ".upload.json").read_bytes(), Upload)
        except (OSError, msgspec.MsgspecError):
            return None

    def _write(self, upload: Upload) -> None:
        with replacing(self._place(upload.upload_id) / ".upload.json") as file:
            file.write(encode(upload))


def _plain(name: str) -> str:
    """The name of a file without its folder, and without what a file system or a page could take otherwise."""
    return _UNNAMED.sub("_", Path(name.replace("\\", "/")).name)[-120:]


def _kind(suffix: str) -> Kind | None:
    """What a single file is, by its ending."""
    if suffix in BUNDLES:
        return "folder"
    return "cloud" if suffix in CLOUDS else "recording" if suffix in RECORDINGS else None


def _kind_of(names: Sequence[str]) -> tuple[Kind | None, str]:
    """What several files are together, and which of them says so."""
    if BAG_METADATA in names:
        return "recording", BAG_METADATA
    described = [one for one in names if one.lower().endswith(FLOORS)]
    drawn = [one for one in names if one.lower().endswith(FLOOR_IMAGES)]
    return ("map", described[0]) if len(described) == 1 and drawn else (None, "")
