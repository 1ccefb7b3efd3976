"""Rows about stopping: a stop is acknowledged only at rest, and without a supervisor the robot stands still."""

from harness.conformance.findings import RuleObservation, judged, unless
from harness.conformance.motion import Motion
from harness.conformance.test_bench import POLL_S, SLACK_S, Bench
from harness.contracts.errors import HarnessError
from harness.contracts.protocol import KEEPALIVE_LOST, TERMINAL, InvocationReport
from harness.supervisor.standstill import WINDOW_S

STANDS_WITHIN_S = 2.0
DEADLINE_S = 1.0
STOP_POLL_S = 0.1


def acknowledged_stop(bench: Bench) -> RuleObservation:
    """`stopping` at once, `cancelled` only with the body at rest, within the time that the card declares."""
    report, motion = bench.moving()
    if bench.card.moves and motion is None:
        return _never_moved(report)
    asked_s = bench.now_s
    stopped = bench.stop(report.handle)
    first = stopped.status
    while stopped.status not in TERMINAL and bench.now_s < asked_s + bench.card.cancel.within_s + SLACK_S:
        bench.wait(STOP_POLL_S)
        stopped = bench.report(report.handle)
    took_s = bench.now_s - asked_s
    rest, moved = _rest_after(bench, stopped)
    return judged(
        f"{first}, {stopped.status} after {took_s:.1f} s; {rest}: the lease may be released",
        unless(first in ("stopping", "cancelled"), f"the answer to a stop was {first}"),
        unless(stopped.status == "cancelled", f"{stopped.status} after {took_s:.1f} s: the lease would be quarantined"),
        unless(not moved, f"cancelled while the body moved ({rest}): the lease would be quarantined"),
    )


def stop_is_final(bench: Bench) -> RuleObservation:
    """Nothing revives what was cancelled: not a second stop, a keepalive, a resume or a repeated start."""
    request = bench.request(long=True)
    report = bench.start(request)
    bench.stop(report.handle)
    bench.close()
    ended = bench.report(report.handle)
    for act in (bench.provider.stop, bench.provider.keepalive, bench.provider.resume):
        try:
            act(report.handle)
        except HarnessError:
            continue
    repeated = bench.start(request)
    bench.wait(1.0)
    after = bench.report(report.handle)
    return judged(
        "stays cancelled after stop, keepalive, resume and a repeated start",
        unless(ended.status == "cancelled", f"it was {ended.status} to begin with"),
        unless(repeated.handle == report.handle, "a repeated start became another execution"),
        unless(after.status == "cancelled", f"it became {after.status} again"),
        unless(bench.starts_of(request) in (None, 1), "it was begun again"),
    )


def deadline(bench: Bench) -> RuleObservation:
    """Work that is not done by the deadline ends as failed with `timeout`, at rest."""
    request = bench.request(long=True, within_s=DEADLINE_S)
    report = bench.start(request)
    bench.wait(DEADLINE_S + POLL_S, keep=report.handle)
    report = bench.report(report.handle)
    ended = bench.ended(report, within_s=bench.card.cancel.within_s + SLACK_S)
    late_s = ended.at_s - request.deadline_s
    rest, moved = _rest_after(bench, ended)
    return judged(
        f"failed with timeout {late_s:.1f} s after the deadline; {rest}",
        unless(ended.status == "failed", f"{ended.status} {late_s:+.1f} s from the deadline"),
        unless(ended.failure == "timeout", f"the failure word is {ended.failure or 'empty'}, not timeout"),
        unless(late_s < bench.card.cancel.within_s + SLACK_S, f"it ended {late_s:.1f} s after the deadline"),
        unless(not moved, f"it ended while the body moved ({rest})"),
    )


def dead_man(bench: Bench) -> RuleObservation:
    """Without keepalives the body stands within 2 s by its odometry, and the execution reports why it is blocked."""
    report, motion = bench.moving()
    if motion is None:
        return _never_moved(report)
    lost_s = bench.now_s
    bench.wait(STANDS_WITHIN_S + WINDOW_S + POLL_S)
    after = bench.observations.motion(lost_s + STANDS_WITHIN_S + WINDOW_S)
    held = bench.report(report.handle)
    return judged(
        f"moved {motion}, then {after} from {STANDS_WITHIN_S:.0f} s after the last keepalive on",
        unless(after is not None, "no odometry shows whether it stands"),
        unless(after is None or after.still, f"still moving {after} after {STANDS_WITHIN_S:.0f} s without keepalives"),
        unless(held.status == "blocked", f"it is {held.status}, not blocked"),
        unless(held.failure == KEEPALIVE_LOST, f"its failure is {held.failure or 'empty'}, not {KEEPALIVE_LOST}"),
    )


def resume(bench: Bench) -> RuleObservation:
    """After a lost keepalive the same execution goes on; nothing is started a second time."""
    report, motion = bench.moving()
    if motion is None:
        return _never_moved(report)
    bench.wait(STANDS_WITHIN_S + WINDOW_S)
    request = bench.requested(report.handle)
    resumed = bench.noted(request, bench.provider.resume(report.handle))
    again: Motion | None = None
    for _ in bench.watch(resumed, within_s=STANDS_WITHIN_S + WINDOW_S):
        again = bench.observations.motion(bench.now_s)
        if again is not None and not again.still:
            break
    return judged(
        f"{resumed.status} again, moving {again}",
        unless(resumed.status in ("accepted", "running"), f"after a resume it is {resumed.status}"),
        unless(again is not None and not again.still, "after a resume the body does not move"),
        unless(bench.starts_of(request) in (None, 1), "the resume was a second physical start"),
    )


def _rest_after(bench: Bench, ended: InvocationReport) -> tuple[str, bool]:
    """What odometry shows of the second after the end, and whether that is motion or unknown."""
    if not bench.card.moves:
        return "it moves nothing", False
    ended_s = min(ended.at_s, bench.now_s)
    bench.wait(max(0.0, ended_s + WINDOW_S + POLL_S - bench.now_s))
    motion = bench.observations.motion(ended_s + WINDOW_S)
    return (str(motion), not motion.still) if motion else ("no odometry shows rest", True)


def _never_moved(report: InvocationReport) -> RuleObservation:
    return RuleObservation(
        met=False, text=f"odometry never showed motion; the execution is {report.status}: {report.message}"
    )
