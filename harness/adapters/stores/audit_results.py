"""Keeps what audits of recordings found in the data folder: a file of lines for each audited folder."""

import hashlib
from pathlib import Path

import msgspec

from harness.contracts.declared_successes import AuditedRecording, BagAudit
from harness.contracts.values import decode, encode

FOLDER = "bag-audits"


def stored_audits(data: Path) -> tuple[BagAudit, ...]:
    """Every audit whose results the data folder holds, by folder; those still under way too."""
    files = sorted((data / FOLDER).glob("*.jsonl"))
    return tuple(one for one in map(_stored, files) if one is not None)


class AuditResults:
    """The results of one folder: a file of lines, the first of which names the folder."""

    def __init__(self, data: Path, folder: Path) -> None:
        place = str(folder.absolute())
        self._head = encode(BagAudit(folder=place, recordings=()))
        self._file = data / FOLDER / f"{hashlib.sha256(place.encode()).hexdigest()[:24]}.jsonl"

    def read(self) -> tuple[AuditedRecording, ...]:
        stored = _stored(self._file)
        return stored.recordings if stored else ()

    def append(self, one: AuditedRecording) -> None:
        self._file.parent.mkdir(parents=True, exist_ok=True)
        if not self._file.exists():
            self._file.write_bytes(self._head + b"\n")
        with self._file.open("ab") as into:
            into.write(encode(one) + b"\n")

    def replace(self, recordings: tuple[AuditedRecording, ...]) -> None:
        """What is there now, without recordings that are gone and results that were read again."""
        self._file.parent.mkdir(parents=True, exist_ok=True)
        beside = self._file.with_suffix(".new")
        beside.write_bytes(b"".join(line + b"\n" for line in (self._head, *map(encode, recordings))))
        beside.replace(self._file)


def _stored(file: Path) -> BagAudit | None:
    """The newest result of each recording; None for no results. A line that broke off ends them."""
    if not file.exists():
        return None
    lines = file.read_bytes().splitlines()
    newest: dict[str, AuditedRecording] = {}
    try:
        head = decode(lines[0], BagAudit)
    except (IndexError, msgspec.MsgspecError):
        return None
    for line in lines[1:]:
        try:
            one = decode(line, AuditedRecording)
        except msgspec.MsgspecError:
            break
        newest[one.path] = one
    return BagAudit(folder=head.folder, recordings=tuple(newest.values()))
