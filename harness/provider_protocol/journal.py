"""Journals a provider's requests, so that a process that was killed starts nothing twice."""

import os
from collections.abc import Callable
from pathlib import Path

import msgspec

from harness.contracts.errors import LogDamaged, StoreUnavailable
from harness.contracts.ids import RequestId
from harness.contracts.protocol import InvocationReport, StartRequest
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode


class JournalEntry(Value):
    """One journal line: a new status of one request. `request` is on the line that accepted it."""

    report: InvocationReport
    request: StartRequest | None = None


class RequestJournal:
    """A provider's record of its requests: append-only JSON lines, fsynced; in memory when `path` is None.

    A last line without its newline was never acknowledged and is cut off. Raises LogDamaged for a damaged earlier
    line and StoreUnavailable when the file cannot be read or written.
    """

    def __init__(self, path: Path | None) -> None:
        self.requests: dict[RequestId, StartRequest] = {}
        self.reports: dict[RequestId, InvocationReport] = {}
        self.tokens: dict[str, int] = {}
        self._path = path
        if path is not None:
            self._on_disk(self._load, path)

    def write(self, entry: JournalEntry) -> None:
        """Durable on return, then visible."""
        if self._path is not None:
            line = encode(entry) + b"\n"
            self._on_disk(_append, self._path, line)
        self._fold(entry)

    def _load(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        body = path.read_bytes() if path.exists() else b""
        whole = body[: body.rfind(b"\n") + 1]
        if len(whole) < len(body):
            os.truncate(path, len(whole))
        for number, line in enumerate(whole.splitlines(), start=1):
            try:
                self._fold(decode(line, JournalEntry))
            except msgspec.MsgspecError as error:
                raise LogDamaged(
                    because("journal_line_unreadable", error=str(error)),
                    where=f"{path}:{number}",
                ) from error

    def _fold(self, entry: JournalEntry) -> None:
        request = entry.report.identity.request_id
        self.reports[request] = entry.report
        if entry.request is not None:
            self.requests[request] = entry.request
            for resource, token in entry.request.fencing.items():
                self.tokens[resource] = max(token, self.tokens.get(resource, token))

    def _on_disk(self, act: Callable[..., None], path: Path, *rest: bytes) -> None:
        try:
            act(path, *rest)
        except OSError as error:
            raise StoreUnavailable(
                because("journal_unusable", error=error.strerror or str(error)), where=str(path)
            ) from error


def _append(path: Path, line: bytes) -> None:
    with path.open("ab") as file:
        before = file.tell()
        try:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        except OSError:
            file.truncate(before)
            raise
