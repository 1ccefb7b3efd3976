"""Rows about a provider's reports and evidence: identity, order, progress, failures, receipts."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from harness.conformance.findings import RuleObservation, judged, unless
from harness.conformance.stops import DEADLINE_S, deadline
from harness.conformance.test_bench import POLL_S, Bench
from harness.contracts import observations, protocol
from harness.contracts.errors import HarnessError
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import Reason, because, plain
from harness.projections.proposals import matches
from harness.provider_protocol.proposals import intended

SAMPLES: dict[str, type[observations.Sample]] = {
    "pose": observations.Pose,
    "odometry": observations.Odometry,
    "imu": observations.Imu,
    "scan": observations.Scan,
    "image": observations.Image,
    "battery": observations.Battery,
}
SHARE_SLIP = 0.05


def completes(bench: Bench) -> RuleObservation:
    """The file's request ends as succeeded."""
    request, ended = bench.done()
    took_s = ended.at_s - bench.asked_s(request)
    return judged(
        because("kit_completed", took_s=took_s, reason=ended.message),
        unless(
            ended.status == "succeeded",
            because("kit_not_completed", status=ended.status, failure=ended.failure, reason=ended.message),
        ),
    )


def identity_echo(bench: Bench) -> RuleObservation:
    """Every report names the request it was asked about: mission, node, attempt, request, provider."""
    bench.done()
    wrong = sorted(
        {
            (request.identity.node_id, report.identity.mission_id, report.identity.node_id)
            for request, report in bench.log
            if report.identity != request.identity
        }
    )
    return judged(
        because("kit_identities_echoed", reports=len(bench.log)),
        *(because("kit_identity_other", node_id=a, mission_id=b, other_id=c) for a, b, c in wrong[:3]),
    )


def progress(bench: Bench) -> RuleObservation:
    """Statuses follow one another as they may, progress is a share that does not fall, all numbers are numbers."""
    bench.done()
    by_handle: dict[str, list[protocol.InvocationReport]] = {}
    for _, report in bench.log:
        by_handle.setdefault(report.handle, []).append(report)
    wrong = [one for reports in by_handle.values() for one in _disorder(reports)]
    seen = sorted({report.status for _, report in bench.log})
    return judged(because("kit_in_order", executions=len(by_handle), statuses=tuple(seen)), *_distinct(wrong)[:4])


def failure_words(bench: Bench) -> RuleObservation:
    """A failure carries a failure code of the card; nothing else does."""
    deadline(bench)
    words = bench.card.failure_words
    failed = [report for _, report in bench.log if report.status == "failed"]
    odd = [because("kit_failure_undeclared", failure=r.failure) for r in failed if r.failure not in words]
    odd += [
        because("kit_failure_of_no_failure", status=r.status, failure=r.failure)
        for _, r in bench.log
        if r.failure and r.status != "failed" and (r.status, r.failure) != ("blocked", protocol.KEEPALIVE_LOST)
    ]
    used = sorted({report.failure for report in failed})
    return judged(
        because("kit_failures", failed=len(failed), words=tuple(used)),
        unless(bool(failed), because("kit_no_failure", within_s=DEADLINE_S)),
        *_distinct(odd)[:3],
    )


def evidence_promised(bench: Bench) -> RuleObservation:
    """Every kind of evidence on the card is really there after a success: receipts in the report, samples, bytes."""
    begun_s = bench.now_s
    _, ended = bench.done()
    bench.wait(1.0)
    kinds = {f"receipt:{receipt.kind}" for receipt in ended.receipts}
    sensed = [s for s in bench.observations.collect() if s.at_s >= begun_s - POLL_S]
    kinds |= {word for word, kind in SAMPLES.items() if any(isinstance(sample, kind) for sample in sensed)}
    kinds |= {f"instrument:{sample.source}" for sample in sensed if isinstance(sample, observations.InstrumentReading)}
    missing = [word for word in bench.card.evidence if word not in kinds]
    blobs = [s.blob for s in sensed if isinstance(s, observations.Image | observations.Scan)][-3:]
    return judged(
        because("kit_evidence", kinds=bench.card.evidence, receipts=len(ended.receipts), samples=len(sensed)),
        unless(
            ended.status == "succeeded",
            because("kit_not_completed", status=ended.status, failure=ended.failure, reason=ended.message),
        ),
        unless(not missing, because("kit_evidence_missing", kinds=tuple(missing))),
        *(_blob(bench, blob) for blob in (*ended.blobs, *blobs)),
    )


def proposes_facts(bench: Bench) -> RuleObservation:
    """The last report of a success proposes the effects that the request named; no other report proposes any."""
    if not protocol.proposes_facts(bench.card.protocol):
        return RuleObservation(
            met=False,
            text=because(
                "kit_protocol_old", version=protocol.version_of(bench.card.protocol), wanted=protocol.PROTOCOL
            ),
        )
    request, ended = bench.done()
    if bench.declaration.estimates:
        spoken = sorted({fact.name for _, report in bench.log for fact in report.proposed_facts})
        return judged(
            because("kit_estimates_only", scores=len(ended.declared)),
            unless(not spoken, because("kit_estimator_proposes", facts=tuple(spoken))),
            unless(bool(ended.declared), because("kit_no_score")),
        )
    effects = [one.effect for one in intended(request)]
    missing = [one.predicate for one in effects if not any(matches(fact, one) for fact in ended.proposed_facts)]
    unfinished = [report for _, report in bench.log if report.status != "succeeded" and report.proposed_facts]
    early = [because("kit_proposed_early", status=one.status, facts=len(one.proposed_facts)) for one in unfinished]
    return judged(
        because("kit_proposed", facts=tuple(fact.name for fact in ended.proposed_facts)),
        unless(
            ended.status == "succeeded",
            because("kit_not_completed", status=ended.status, failure=ended.failure, reason=ended.message),
        ),
        unless(bool(effects), because("kit_no_effects_named")),
        unless(not missing, because("kit_not_proposed", effects=tuple(missing))),
        *_distinct(early),
    )


def receipts_bound(bench: Bench) -> RuleObservation:
    """Receipts name their request and their provider, lie inside the execution, and cite bytes that match."""
    request, ended = bench.done()
    names = [receipt.receipt_id for receipt in ended.receipts]
    wrong = [one for receipt in ended.receipts for one in _unbound(bench, request, ended, receipt)]
    return judged(
        because("kit_receipts_bound", receipts=len(names)) if names else because("kit_no_receipt"),
        unless(len(set(names)) == len(names), because("kit_receipt_twice")),
        *wrong[:3],
    )


def late_repeat(bench: Bench) -> RuleObservation:
    """After the end, a late repeat of the start and repeated questions get the same last report, and start nothing."""
    request, ended = bench.done()
    repeated = bench.start(request)
    reports = [bench.report(ended.handle) for _ in range(3)]
    return judged(
        because("kit_last_report_stays"),
        unless(ended.status in protocol.TERMINAL, because("kit_never_ended", status=ended.status)),
        unless(repeated == ended, because("kit_late_repeat_changed", status=repeated.status)),
        unless(all(one == ended for one in reports), because("kit_last_report_changed")),
        unless(bench.starts_of(request) in (None, 1), because("kit_late_repeat_started")),
    )


def _distinct(reasons: Sequence[Reason]) -> list[Reason]:
    """Each of them once, in a fixed order."""
    return [one for _, one in sorted({plain(one): one for one in reasons}.items())]


def _disorder(reports: list[protocol.InvocationReport]) -> Iterator[Reason]:
    for earlier, later in pairwise(reports):
        if earlier.status in protocol.TERMINAL and later.status != earlier.status:
            yield because("kit_status_order", later=later.status, earlier=earlier.status)
        if earlier.status == "stopping" and later.status not in (*protocol.TERMINAL, "stopping"):
            yield because("kit_status_order", later=later.status, earlier=earlier.status)
        if later.at_s < earlier.at_s:
            yield because("kit_time_steps_back")
        if later.progress.share < earlier.progress.share - SHARE_SLIP:
            yield because("kit_progress_fell", earlier=earlier.progress.share, later=later.progress.share)
    for report in reports:
        remaining = report.progress.remaining_m
        if not 0.0 <= report.progress.share <= 1.0:
            yield because("kit_progress_is", share=report.progress.share)
        if remaining is not None and not 0.0 <= remaining < math.inf:
            yield because("kit_remaining_is", remaining_m=remaining)
        if not all(map(math.isfinite, report.declared.values())):
            yield because("kit_declared_nan")


def _unbound(
    bench: Bench, request: protocol.StartRequest, ended: protocol.InvocationReport, receipt: protocol.Receipt
) -> Iterator[Reason]:
    begun_s = bench.asked_s(request)
    if receipt.request_id != request.identity.request_id:
        yield because("kit_receipt_of_other_request", receipt=receipt.receipt_id)
    if receipt.source != bench.card.provider_id:
        yield because("kit_receipt_of_other_source", receipt=receipt.receipt_id, source=receipt.source)
    if not begun_s - POLL_S <= receipt.at_s <= ended.at_s + POLL_S:
        yield because("kit_receipt_outside", receipt=receipt.receipt_id, apart_s=receipt.at_s - begun_s)
    if receipt.blob is not None:
        wrong = _blob(bench, receipt.blob)
        if wrong:
            yield because("kit_receipt_blob", receipt=receipt.receipt_id, reason=wrong)


def _blob(bench: Bench, digest: Digest) -> Reason | None:
    try:
        body = bench.subject.blob(digest)
    except HarnessError as error:
        return because("kit_blob_missing", digest=digest[:12], reason=error.reason)
    return unless(sha256(body) == digest, because("kit_blob_differs", digest=digest[:12]))
