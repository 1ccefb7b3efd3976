"""Reads and writes dossiers: ZIP archives whose contents list is signed with the installation's Ed25519 key."""

import hashlib
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import msgspec
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from harness.adapters.replaced_files import replacing
from harness.adapters.stores.chain import check_record, damaged, event_digest
from harness.contracts import dossier, errors, ports
from harness.contracts.ids import Digest, StreamId
from harness.contracts.reasons import Reason, because
from harness.contracts.stored_commands import command_of
from harness.contracts.values import Moment, decode, encode

T = TypeVar("T")
_UNREADABLE = (KeyError, zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, ValueError)
ALGORITHM = "ed25519"
LARGEST_BYTES = 2 * 2**30
MOST_FILES = 200_000
LARGEST_CONTENTS, LARGEST_SIGNATURE, LARGEST_LINES = 32 * 2**20, 64 * 2**10, 256 * 2**20
"""Bytes of the contents list, of the signature, and of events or records; a blob is hashed piece by piece."""
FREE_BYTES, MOST_RATIO = 64 * 2**20, 100
"""A file may unpack to so many bytes, and to so many times its own size beyond that."""
KNOWN_COMPRESSION = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
_PIECE = 2**20


def signing_key(folder: Path) -> Ed25519PrivateKey:
    """The installation's key below the data folder, made at its first use and readable by its owner alone."""
    path = folder / "keys" / "dossier.ed25519"
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not path.exists():
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(descriptor, "wb") as file:
                file.write(Ed25519PrivateKey.generate().private_bytes_raw())
        return Ed25519PrivateKey.from_private_bytes(path.read_bytes())
    except (OSError, ValueError) as error:
        raise errors.StoreUnavailable(because("signing_key_unusable", error=str(error)), where=str(path)) from error


def public_key(key: Ed25519PrivateKey) -> str:
    """In hexadecimal: a recipient compares it with the key they were given."""
    return key.public_key().public_bytes_raw().hex()


def write_dossier(
    path: Path, contents: dossier.DossierContents, files: Mapping[str, bytes], key: Ed25519PrivateKey
) -> None:
    """Written under another name, then renamed, so that it is complete or absent. Raises StoreUnavailable."""
    signed = encode(contents)
    signature = dossier.DossierSignature(
        algorithm=ALGORITHM, public_key=public_key(key), signature=key.sign(signed).hex()
    )
    try:
        with replacing(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, body in (
                (dossier.CONTENTS, signed),
                (dossier.SIGNATURE, encode(signature)),
                *sorted(files.items()),
            ):
                archive.writestr(name, body)
    except OSError as error:
        raise errors.StoreUnavailable(
            because("dossier_unwritable", error=error.strerror or str(error)), where=str(path)
        ) from error


class DossierBlobs:
    """The blobs of a dossier, read on demand. Read-only."""

    def __init__(self, archive: zipfile.ZipFile, contents: dossier.DossierContents) -> None:
        self._archive = archive
        self._names = {name.removeprefix("blobs/") for name in contents.files if name.startswith("blobs/")}

    def put(self, body: bytes) -> Digest:
        raise errors.ContractInvalid(because("dossier_read_only"), where="blobs")

    def get(self, digest: Digest) -> bytes:
        """Raises BlobDamaged if it is not in the dossier."""
        if digest not in self._names:
            raise errors.BlobDamaged(because("blob_not_in_dossier", digest=digest), where="blobs")
        return self._archive.read(f"blobs/{digest}")

    def has(self, digest: Digest) -> bool:
        return digest in self._names

    def erase(self, digest: Digest) -> None:
        raise errors.ContractInvalid(because("dossier_read_only"), where="blobs")

    def digests(self) -> Iterator[Digest]:
        """All digests, in ascending order."""
        yield from (Digest(name) for name in sorted(self._names))


class DossierLog:
    """The events and records of a dossier behind the log's port. Nothing can be appended."""

    def __init__(
        self, events: Sequence[ports.StoredEvent], records: Sequence[ports.Record], head: ports.LogHead
    ) -> None:
        self._log = list(events)
        self._records = {record.digest: record for record in records}
        self._head = head
        self._by_stream: dict[StreamId, list[ports.StoredEvent]] = {}
        for event in self._log:
            self._by_stream.setdefault(event.stream, []).append(event)

    def append(self, batches: Sequence[ports.Batch], records: Sequence[ports.Record], now: Moment) -> ports.LogHead:
        raise errors.ContractInvalid(because("dossier_read_only"), where="log")

    def turn(self) -> AbstractContextManager[None]:
        """Nothing to look at: no other process appends."""
        return nullcontext()

    def load(self, stream: StreamId, after: int = 0) -> list[ports.StoredEvent]:
        return self._by_stream.get(stream, [])[after:]

    def read(self, after: int = 0, limit: int = 1000) -> list[ports.StoredEvent]:
        return [event for event in self._log if event.position > after][:limit]

    def streams(self, prefix: str) -> list[StreamId]:
        return [stream for stream in self._by_stream if stream.startswith(prefix)]

    def open_missions(self) -> list[StreamId]:
        ended = {event.stream for event in self._log if event.kind == ports.MISSION_ENDED}
        return [one for one in self.streams(ports.MISSION_STREAMS) if one not in ended]

    def ended_missions(self, after: int, upto: int) -> list[StreamId]:
        return [one.stream for one in self._log if one.kind == ports.MISSION_ENDED and after < one.position <= upto]

    def record(self, digest: Digest) -> ports.Record:
        """Raises UnknownName."""
        if digest not in self._records:
            raise errors.UnknownName(because("record_not_in_dossier", digest=digest), where="records")
        return self._records[digest]

    def head(self) -> ports.LogHead:
        """Of the log that the dossier was taken from."""
        return self._head

    def verify(self) -> ports.LogHead:
        """Every event's own digest, its stream's numbering, and the chain where two neighbours are both here."""
        before: ports.StoredEvent | None = None
        at: dict[StreamId, int] = {}
        for event in self._log:
            if event.digest != event_digest(event):
                raise damaged(event.position, because("event_digest_differs"))
            if event.version != at.get(event.stream, 0) + 1:
                raise damaged(event.position, because("stream_goes_on_at", stream=event.stream, version=event.version))
            if before is not None and event.position <= before.position:
                raise damaged(event.position, because("events_out_of_order"))
            if before is not None and event.position == before.position + 1 and event.previous != before.digest:
                raise damaged(event.position, because("event_unchained"))
            at[event.stream] = event.version
            before = event
        commands = {name: one.position for one in self._log if (name := command_of(one)) is not None}
        for name, position in commands.items():
            if name not in self._records:
                raise damaged(position, because("dossier_lacks_command", command=name[:12]))
        for record in self._records.values():
            check_record(record)
        return self._head

    def close(self) -> None:
        """Nothing to release."""


@dataclass(frozen=True)
class Dossier:
    """An opened dossier whose signature and files hold. `public_key` in hexadecimal."""

    contents: dossier.DossierContents
    public_key: str
    log: DossierLog
    blobs: DossierBlobs


def open_dossier(archive: zipfile.ZipFile, *, where: str) -> Dossier:
    """Check the signature, then every file against the list it covers, then the chain; needs nothing but the file.

    Nothing is unpacked beyond the declared limits, and only the contents list and the signature before that is checked.
    Raises DossierInvalid or LogDamaged that name the first part that does not hold.
    """
    signed = _member(archive, dossier.CONTENTS, where, limit=LARGEST_CONTENTS)
    stated = _member(archive, dossier.SIGNATURE, where, limit=LARGEST_SIGNATURE)
    try:
        signature = decode(stated, dossier.DossierSignature)
        _signed(signed, signature, where)
        contents = decode(signed, dossier.DossierContents)
    except msgspec.MsgspecError as error:
        raise _invalid(because("dossier_contents_unreadable", error=str(error)), where) from error
    _bounded(archive, where)
    if contents.format != dossier.FORMAT:
        raise _invalid(because("dossier_format_unknown", format=contents.format, known=dossier.FORMAT), where)
    _listed(archive, contents, where)
    try:
        events = _lines(_member(archive, dossier.EVENTS, where, limit=LARGEST_LINES), ports.StoredEvent)
        records = _lines(_member(archive, dossier.RECORDS, where, limit=LARGEST_LINES), ports.Record)
    except msgspec.MsgspecError as error:
        raise _invalid(because("dossier_record_unreadable", error=str(error)), where) from error
    log = DossierLog(events, records, contents.head)
    log.verify()
    return Dossier(contents=contents, public_key=signature.public_key, log=log, blobs=DossierBlobs(archive, contents))


def _bounded(archive: zipfile.ZipFile, where: str) -> None:
    members = archive.infolist()
    packed, unpacked = sum(one.compress_size for one in members), sum(one.file_size for one in members)
    if len(members) > MOST_FILES or unpacked > min(LARGEST_BYTES, FREE_BYTES + MOST_RATIO * packed):
        raise _invalid(because("dossier_too_large", packed=packed, unpacked=unpacked, files=len(members)), where)


def _signed(signed: bytes, signature: dossier.DossierSignature, where: str) -> None:
    if signature.algorithm != ALGORITHM:
        raise _invalid(because("dossier_algorithm_unknown", algorithm=signature.algorithm, known=ALGORITHM), where)
    try:
        known = Ed25519PublicKey.from_public_bytes(bytes.fromhex(signature.public_key))
        known.verify(bytes.fromhex(signature.signature), signed)
    except (InvalidSignature, ValueError) as error:
        raise _invalid(because("dossier_signature_differs"), where) from error


def _listed(archive: zipfile.ZipFile, contents: dossier.DossierContents, where: str) -> None:
    names = {one.filename for one in archive.infolist()} - {dossier.CONTENTS, dossier.SIGNATURE}
    if strange := sorted(names - set(contents.files)):
        raise _invalid(because("dossier_file_unsigned", name=strange[0]), where)
    for name, expected in contents.files.items():
        if _digest(archive, name, where) != expected:
            raise _invalid(because("dossier_file_differs", name=name), where)
        if name.startswith("blobs/") and name != f"blobs/{expected}":
            raise _invalid(because("dossier_blob_misnamed", name=name), where)


def _member(archive: zipfile.ZipFile, name: str, where: str, *, limit: int) -> bytes:
    """A whole file of the archive, if it is declared with at most `limit` bytes, which is all that is unpacked."""
    return b"".join(_pieces(archive, name, where, limit=limit))


def _digest(archive: zipfile.ZipFile, name: str, where: str) -> Digest:
    found = hashlib.sha256()
    for piece in _pieces(archive, name, where, limit=LARGEST_BYTES):
        found.update(piece)
    return Digest(found.hexdigest())


def _pieces(archive: zipfile.ZipFile, name: str, where: str, *, limit: int) -> Iterator[bytes]:
    try:
        declared = archive.getinfo(name)
        if declared.file_size > limit:
            raise _invalid(because("dossier_file_too_large", name=name, bytes=declared.file_size, limit=limit), where)
        if declared.compress_type not in KNOWN_COMPRESSION:
            raise _invalid(because("dossier_compression_unknown", name=name), where)
        with archive.open(declared) as file:
            while piece := file.read(_PIECE):
                yield piece
    except _UNREADABLE as error:
        raise _invalid(because("dossier_file_missing", name=name, error=str(error)), where) from error


def _lines(body: bytes, kind: type[T]) -> list[T]:
    return [msgspec.json.decode(line, type=kind) for line in body.splitlines()]


def _invalid(why: Reason, where: str) -> errors.DossierInvalid:
    return errors.DossierInvalid(because("dossier_unverified", why=why), where=where)
