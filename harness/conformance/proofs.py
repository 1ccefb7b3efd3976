"""Rows about a provider's reports and evidence: identity, order, progress, failures, receipts."""

import math
from collections.abc import Iterator
from itertools import pairwise

from harness.conformance.findings import RuleObservation, judged, unless
from harness.conformance.stops import DEADLINE_S, deadline
from harness.conformance.test_bench import POLL_S, Bench
from harness.contracts import observations, protocol
from harness.contracts.errors import HarnessError
from harness.contracts.ids import Digest, sha256
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
TOO_OLD = (
    "it speaks provider protocol {version}, which proposes no facts, so the harness accepts nothing that it does: name "
    f"protocol {protocol.PROTOCOL} on the card, and propose the intended effects in the last report"
)


def completes(bench: Bench) -> RuleObservation:
    """The file's request ends as succeeded."""
    request, ended = bench.done()
    took_s = ended.at_s - bench.asked_s(request)
    return judged(
        f"succeeded after {took_s:.1f} s: {ended.message}",
        unless(ended.status == "succeeded", f"it ended {ended.status} {ended.failure}: {ended.message}".rstrip()),
    )


def identity_echo(bench: Bench) -> RuleObservation:
    """Every report names the request it was asked about: mission, node, attempt, request, provider."""
    bench.done()
    wrong = sorted(
        {
            f"a report on {request.identity.node_id} speaks of {report.identity.mission_id}/{report.identity.node_id}"
            for request, report in bench.log
            if report.identity != request.identity
        }
    )
    return judged(f"{len(bench.log)} reports, each with the identity it was asked for", *wrong[:3])


def progress(bench: Bench) -> RuleObservation:
    """Statuses follow one another as they may, progress is a share that does not fall, all numbers are numbers."""
    bench.done()
    by_handle: dict[str, list[protocol.InvocationReport]] = {}
    for _, report in bench.log:
        by_handle.setdefault(report.handle, []).append(report)
    wrong = [one for reports in by_handle.values() for one in _disorder(reports)]
    seen = sorted({report.status for _, report in bench.log})
    return judged(f"{len(by_handle)} executions in order: {', '.join(seen)}", *sorted(set(wrong))[:4])


def failure_words(bench: Bench) -> RuleObservation:
    """A failure carries a failure code of the card; nothing else does."""
    deadline(bench)
    words = bench.card.failure_words
    failed = [report for _, report in bench.log if report.status == "failed"]
    odd = {f"failed with {r.failure or 'no word'}, which is not on the card" for r in failed if r.failure not in words}
    odd |= {
        f"{r.status} with the failure {r.failure}"
        for _, r in bench.log
        if r.failure and r.status != "failed" and (r.status, r.failure) != ("blocked", protocol.KEEPALIVE_LOST)
    }
    used = sorted({report.failure for report in failed})
    return judged(
        f"{len(failed)} failed reports, words: {', '.join(used)}",
        unless(bool(failed), f"no failure could be provoked by a deadline of {DEADLINE_S:g} s"),
        *sorted(odd)[:3],
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
        f"{', '.join(bench.card.evidence)}; {len(ended.receipts)} receipts, {len(sensed)} samples",
        unless(ended.status == "succeeded", f"it ended {ended.status}"),
        unless(not missing, f"promised and not there: {', '.join(missing)}"),
        *(_blob(bench, blob) for blob in (*ended.blobs, *blobs)),
    )


def proposes_facts(bench: Bench) -> RuleObservation:
    """The last report of a success proposes the effects that the request named; no other report proposes any."""
    if not protocol.proposes_facts(bench.card.protocol):
        return RuleObservation(met=False, text=TOO_OLD.format(version=protocol.version_of(bench.card.protocol)))
    request, ended = bench.done()
    if bench.declaration.estimates:
        spoken = sorted({fact.name for _, report in bench.log for fact in report.proposed_facts})
        return judged(
            f"estimates only: {len(ended.declared)} scores, nothing proposed",
            unless(not spoken, f"it proposes {', '.join(spoken)}"),
            unless(bool(ended.declared), "it declares no score"),
        )
    effects = [one.effect for one in intended(request)]
    missing = [one.predicate for one in effects if not any(matches(fact, one) for fact in ended.proposed_facts)]
    unfinished = [report for _, report in bench.log if report.status != "succeeded" and report.proposed_facts]
    early = sorted({f"{report.status}, and still it proposed {len(report.proposed_facts)}" for report in unfinished})
    return judged(
        f"proposes {', '.join(fact.name for fact in ended.proposed_facts)}, and nothing before a success",
        unless(bool(effects), "the conformance file names no effects"),
        unless(not missing, f"not proposed, or for something else: {', '.join(missing)}"),
        *early,
    )


def receipts_bound(bench: Bench) -> RuleObservation:
    """Receipts name their request and their provider, lie inside the execution, and cite bytes that match."""
    request, ended = bench.done()
    names = [receipt.receipt_id for receipt in ended.receipts]
    wrong = [one for receipt in ended.receipts for one in _unbound(bench, request, ended, receipt)]
    return judged(
        f"{len(names)} receipts bound to their request" if names else "it gives no receipt",
        unless(len(set(names)) == len(names), "two receipts share a name"),
        *wrong[:3],
    )


def late_repeat(bench: Bench) -> RuleObservation:
    """After the end, a late repeat of the start and repeated questions get the same last report, and start nothing."""
    request, ended = bench.done()
    repeated = bench.start(request)
    reports = [bench.report(ended.handle) for _ in range(3)]
    return judged(
        "the same last word four times, nothing begun again",
        unless(ended.status in protocol.TERMINAL, f"it never ended: {ended.status}"),
        unless(repeated == ended, f"a late repeat of the start was answered with {repeated.status}, another report"),
        unless(all(one == ended for one in reports), "the last word changed when asked again"),
        unless(bench.starts_of(request) in (None, 1), "the late repeat was a second physical start"),
    )


def _disorder(reports: list[protocol.InvocationReport]) -> Iterator[str]:
    for earlier, later in pairwise(reports):
        if earlier.status in protocol.TERMINAL and later.status != earlier.status:
            yield f"{later.status} after {earlier.status}"
        if earlier.status == "stopping" and later.status not in (*protocol.TERMINAL, "stopping"):
            yield f"{later.status} after stopping"
        if later.at_s < earlier.at_s:
            yield "time steps back between two reports"
        if later.progress.share < earlier.progress.share - SHARE_SLIP:
            yield f"progress fell from {earlier.progress.share:.2f} to {later.progress.share:.2f}"
    for report in reports:
        remaining = report.progress.remaining_m
        if not 0.0 <= report.progress.share <= 1.0:
            yield f"progress is {report.progress.share}"
        if remaining is not None and not 0.0 <= remaining < math.inf:
            yield f"{remaining} m remain"
        if not all(map(math.isfinite, report.declared.values())):
            yield "a declared value is no number"


def _unbound(
    bench: Bench, request: protocol.StartRequest, ended: protocol.InvocationReport, receipt: protocol.Receipt
) -> Iterator[str]:
    begun_s = bench.asked_s(request)
    if receipt.request_id != request.identity.request_id:
        yield f"receipt {receipt.receipt_id} belongs to another request"
    if receipt.source != bench.card.provider_id:
        yield f"receipt {receipt.receipt_id} is from {receipt.source}"
    if not begun_s - POLL_S <= receipt.at_s <= ended.at_s + POLL_S:
        yield f"receipt {receipt.receipt_id} lies {receipt.at_s - begun_s:+.1f} s from the start"
    if receipt.blob is not None:
        wrong = _blob(bench, receipt.blob)
        if wrong:
            yield f"receipt {receipt.receipt_id}: {wrong}"


def _blob(bench: Bench, digest: Digest) -> str:
    try:
        body = bench.subject.blob(digest)
    except HarnessError as error:
        return f"bytes {digest[:12]} cannot be fetched ({error.what})"
    return unless(sha256(body) == digest, f"bytes {digest[:12]} do not match their digest")
