"""Rows about stopping: a stop is acknowledged only at rest, and without a supervisor the robot stands still."""

from harness.conformance.findings import RuleObservation, judged, unless
from harness.conformance.motion import Motion
from harness.conformance.test_bench import POLL_S, SLACK_S, Bench
from harness.contracts.errors import HarnessError
from harness.contracts.protocol import KEEPALIVE_LOST, TERMINAL, InvocationReport
from harness.contracts.reasons import Reason, because
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
        because("kit_stopped", first=first, status=stopped.status, took_s=took_s, rest=rest),
        unless(first in ("stopping", "cancelled"), because("kit_stop_answered", status=first)),
        unless(stopped.status == "cancelled", because("kit_not_cancelled", status=stopped.status, took_s=took_s)),
        unless(not moved, because("kit_cancelled_in_motion", rest=rest)),
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
        because("kit_stays_cancelled"),
        unless(ended.status == "cancelled", because("kit_was_not_cancelled", status=ended.status)),
        unless(repeated.handle == report.handle, because("kit_repeat_started", handle=repeated.handle)),
        unless(after.status == "cancelled", because("kit_revived", status=after.status)),
        unless(bench.starts_of(request) in (None, 1), because("kit_begun_again")),
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
        because("kit_timed_out", late_s=late_s, rest=rest),
        unless(ended.status == "failed", because("kit_no_timeout", status=ended.status, late_s=late_s)),
        unless(ended.failure == "timeout", because("kit_failure_other", failure=ended.failure, expected="timeout")),
        unless(late_s < bench.card.cancel.within_s + SLACK_S, because("kit_ended_late", late_s=late_s)),
        unless(not moved, because("kit_ended_in_motion", rest=rest)),
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
        because("kit_stood_still", before=_in_window(motion), after=_in_window(after), within_s=STANDS_WITHIN_S),
        unless(after is not None, because("kit_standstill_unseen")),
        unless(
            after is None or after.still, because("kit_still_moving", rest=_in_window(after), within_s=STANDS_WITHIN_S)
        ),
        unless(held.status == "blocked", because("kit_not_blocked", status=held.status)),
        unless(
            held.failure == KEEPALIVE_LOST,
            because("kit_failure_other", failure=held.failure, expected=KEEPALIVE_LOST),
        ),
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
        because("kit_resumed", status=resumed.status, rest=_in_window(again)),
        unless(resumed.status in ("accepted", "running"), because("kit_not_resumed", status=resumed.status)),
        unless(again is not None and not again.still, because("kit_resumed_without_motion")),
        unless(bench.starts_of(request) in (None, 1), because("kit_resume_started")),
    )


def _rest_after(bench: Bench, ended: InvocationReport) -> tuple[Reason, bool]:
    """What odometry shows of the second after the end, and whether that is motion or unknown."""
    if not bench.card.moves:
        return because("kit_moves_nothing"), False
    ended_s = min(ended.at_s, bench.now_s)
    bench.wait(max(0.0, ended_s + WINDOW_S + POLL_S - bench.now_s))
    motion = bench.observations.motion(ended_s + WINDOW_S)
    return _in_window(motion), motion is None or not motion.still


def _in_window(motion: Motion | None) -> Reason:
    """What odometry shows of a window."""
    if motion is None:
        return because("kit_no_odometry")
    return because("kit_motion", displacement_m=motion.displacement_m, turned_rad=motion.turned_rad, window_s=WINDOW_S)


def _never_moved(report: InvocationReport) -> RuleObservation:
    return RuleObservation(met=False, text=because("kit_never_moved", status=report.status, reason=report.message))
