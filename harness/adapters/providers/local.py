"""Base class of providers that run inside the harness and move nothing: accept durably, work when polled, end once."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import HarnessError, ProviderFailed
from harness.contracts.ids import Digest, RequestId
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.reasons import Explanation, because
from harness.contracts.values import Value
from harness.provider_protocol.acceptance import refuse_changed, refuse_unfit
from harness.provider_protocol.journal import JournalEntry, RequestJournal


class ReceiptDraft(Value):
    """A receipt without its id, source and request."""

    kind: Any
    text: str = ""
    blob: Digest | None = None
    values: dict[str, float] = msgspec.field(default_factory=dict)


class Result(Value):
    """What finished work leaves behind. `at_s` is when it ended, if that was before the poll that saw it.

    `proposes` are the facts that the provider believes to be true now (D52).
    """

    message: Explanation
    drafts: tuple[ReceiptDraft, ...]
    declared: dict[str, float]
    blobs: tuple[Digest, ...] = ()
    at_s: float | None = None
    proposes: protocol.ProposedFacts = ()


class Failed(Value):
    """Work that cannot be finished: a failure code of the card, and the reason for a person."""

    failure: str
    message: Explanation


Outcome = Result | protocol.Progress | Failed


class LocalProvider(ABC):
    """The provider protocol for work inside this process. Subclasses implement `work`.

    `start` accepts durably and begins; `report` works and ends the invocation. After a restart an accepted request
    goes on by its request id, so `work` must be idempotent. Nothing here moves, so a stop is acknowledged at once.
    `journal` is the file that remembers requests; None remembers them in this process only.
    """

    def __init__(self, card: CapabilityCard, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        self._card, self._clock, self._blobs = card, clock, blobs
        self._journal = RequestJournal(journal)
        self._lock = threading.RLock()

    @property
    def card(self) -> CapabilityCard:
        return self._card

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        """Accept once per request id. Raises ProviderFailed (refused) or FencingRefused; a refusal leaves no trace."""
        with self._lock:
            known = self.find(request.identity.request_id)
            if known is not None:
                refuse_changed(self._journal, request, provider=self._card.provider_id)
                return known
            refuse_unfit(self._card, self._journal, request)
            self.check(request)
            now_s = self._clock.now().mission_s
            report = protocol.InvocationReport(
                handle=f"{self._card.provider_id}:{request.identity.request_id}",
                identity=request.identity,
                status="accepted",
                at_s=now_s,
                progress=protocol.Progress(share=0.0),
            )
            self._journal.write(JournalEntry(report=report, request=request))
            return self._guarded(report, lambda: self.begin(request, now_s))

    def find(self, request: RequestId) -> protocol.InvocationReport | None:
        return self._journal.reports.get(request)

    def report(self, handle: str) -> protocol.InvocationReport:
        """Do what can be done by now, and report the progress. Raises ProviderFailed for an unknown handle."""
        with self._lock:
            report = self._known(handle)
            if report.status in protocol.TERMINAL:
                return report
            now_s = self._clock.now().mission_s
            request = self._journal.requests[report.identity.request_id]
            if now_s > request.deadline_s:
                self.halt(request.identity.request_id)
                return self._fail(report, failure="timeout", message=because("deadline_passed"))
            return self._guarded(report, lambda: self.work(request, now_s))

    def keepalive(self, handle: str) -> None:
        self._known(handle)

    def resume(self, handle: str) -> protocol.InvocationReport:
        """Never blocked, so there is nothing to resume. Raises ProviderFailed."""
        raise self._refusal(because("invocation_not_blocked", handle=handle, status=self._known(handle).status))

    def stop(self, handle: str) -> protocol.InvocationReport:
        """Cancelled at once unless it had already ended."""
        with self._lock:
            report = self._known(handle)
            if report.status in protocol.TERMINAL:
                return report
            self.halt(report.identity.request_id)
            return self._end(report, status="cancelled", message=because("stopped_on_request"))

    def check(self, request: protocol.StartRequest) -> None:
        """Refuse what the card's parameter types cannot express. Raises ProviderFailed."""
        return None

    def begin(self, request: protocol.StartRequest, now_s: float) -> None:
        """What must happen at the start itself rather than at a poll."""
        return None

    def halt(self, request: RequestId) -> None:
        """Release what `begin` acquired."""
        return None

    @abstractmethod
    def work(self, request: protocol.StartRequest, now_s: float) -> Outcome:
        """The result, or the progress. A HarnessError ends the invocation as failed; its code is the failure code."""

    def _guarded(
        self, report: protocol.InvocationReport, act: Callable[[], Outcome | None]
    ) -> protocol.InvocationReport:
        try:
            outcome = act()
        except HarnessError as error:
            return self._fail(report, failure=error.code, message=error.located)
        if outcome is None:
            return report
        if isinstance(outcome, Failed):
            return self._fail(report, failure=outcome.failure, message=outcome.message)
        if isinstance(outcome, protocol.Progress):
            at_s = self._clock.now().mission_s
            return msgspec.structs.replace(report, status="running", progress=outcome, at_s=at_s)
        return self._succeed(report, result=outcome)

    def _succeed(self, report: protocol.InvocationReport, *, result: Result) -> protocol.InvocationReport:
        request = report.identity.request_id
        at_s = self._clock.now().mission_s if result.at_s is None else result.at_s
        receipts = tuple(
            protocol.Receipt(
                receipt_id=f"{draft.kind}-{request[:16]}-{index}",
                kind=draft.kind,
                at_s=at_s,
                source=self._card.provider_id,
                request_id=request,
                text=draft.text,
                blob=draft.blob,
                values=draft.values,
            )
            for index, draft in enumerate(result.drafts)
        )
        return self._end(
            msgspec.structs.replace(
                report,
                receipts=receipts,
                declared=result.declared,
                blobs=result.blobs,
                proposed_facts=result.proposes,
            ),
            status="succeeded",
            message=result.message,
            at_s=at_s,
        )

    def _fail(
        self, report: protocol.InvocationReport, *, failure: str, message: Explanation
    ) -> protocol.InvocationReport:
        return self._end(msgspec.structs.replace(report, failure=failure), status="failed", message=message)

    def _end(
        self, report: protocol.InvocationReport, *, status: Any, message: Explanation, at_s: float | None = None
    ) -> protocol.InvocationReport:
        progress = protocol.Progress(share=1.0, text=message) if status == "succeeded" else report.progress
        ended = msgspec.structs.replace(
            report,
            status=status,
            message=message,
            progress=progress,
            at_s=self._clock.now().mission_s if at_s is None else at_s,
        )
        self._journal.write(JournalEntry(report=ended))
        return ended

    def _known(self, handle: str) -> protocol.InvocationReport:
        report = self.find(RequestId(handle.removeprefix(f"{self._card.provider_id}:")))
        if report is None:
            raise self._refusal(because("handle_unknown", handle=handle))
        return report

    def _refusal(self, what: Explanation) -> ProviderFailed:
        return ProviderFailed(what, where=self._card.provider_id)
