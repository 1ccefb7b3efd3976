"""Records the end and the adjudication of each canary mission once, and acts on them by the fixed canary rule.

Losing a call is harmless: `catch_up` finds missions that were missed, and `selected` assigns no further mission to a
canary whose rule has already reached a result.
"""

from collections.abc import Callable
from typing import Any

from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import MissionId, StreamId
from harness.contracts.reasons import Reason, because
from harness.projections.mission import Mission
from harness.runtime import Runtime
from rsi_reviews import commands
from rsi_reviews.canary import exercised, is_worse, outcome, value_of
from rsi_reviews.canary_metrics import canary_missions, metrics_of, ran
from rsi_reviews.contracts import BETTER, CanaryMission, Manifest
from rsi_reviews.pointers import POINTER, Pointer, candidate_stream
from rsi_reviews.projections import Review
from rsi_reviews.rollback import DESK, why

Answered = Accepted[Any] | Refused
Starts = Callable[[MissionId], int]


def no_duplicates(mission_id: MissionId) -> int:
    """For a runtime without a robot's journal: whoever adjudicates then finds duplicate starts."""
    return 0


def mission_ended(runtime: Runtime, mission_id: MissionId, *, duplicate_starts: int = 0) -> Answered:
    """Add a finished mission to the canary it belongs to, and act on the result. No-op for any other mission.

    `duplicate_starts`: physical starts beyond the first of one request, from the robot's journal.
    """
    review, mission = _trial(runtime), runtime.mission(mission_id)
    if review is None or mission.configuration != review.configuration or not _counts(mission):
        return Accepted(())
    if review.entry(mission_id) is None:
        measured = _measured(runtime, review, mission, duplicate_starts)
        decision = runtime.decide(
            [(candidate_stream(review.candidate), commands.RecordCanaryMission(measured=measured))]
        )
        if isinstance(decision, Refused):
            return decision
    return settle(runtime)


def catch_up(runtime: Runtime, *, duplicate_starts: Starts = no_duplicates) -> Answered:
    """Record every canary mission that ended unrecorded, in the order of their ends, and act on the results."""
    review = _trial(runtime)
    if review is None:
        return Accepted(())
    for mission in canary_missions(runtime, review):
        if review.entry(mission.mission_id) is None and ran(mission):
            mission_ended(runtime, mission.mission_id, duplicate_starts=duplicate_starts(mission.mission_id))
    return settle(runtime)


def settle(runtime: Runtime) -> Answered:
    """Do what the canary's rule now requires: continue, roll back, withdraw, or promote to every robot."""
    review = _trial(runtime)
    if review is None:
        return Accepted(())
    match outcome(review):
        case "go_on":
            return Accepted(())
        case "passed":
            return _act(runtime, review, commands.PromoteCandidate(), "released", because("canary_sound"))
        case "not_exercised":
            reason = because("canary_not_exercised", missions=len(review.canary))
            withdrawn = commands.WithdrawCandidate(actor=DESK, reason=reason, key="canary:not_exercised")
            return _act(runtime, review, withdrawn, "withdrawn", reason)
        case "hard_fault" as found:
            rolled_back = _act(runtime, review, _back(review, found), "rolled_back", why(review))
            if isinstance(rolled_back, Accepted):
                runtime.pause_pinned(
                    review.configuration, actor=DESK, reason=because("pinned_rolled_back", why=why(review))
                )
            return rolled_back
        case "metric_worse" as found:
            return _act(runtime, review, _back(review, found), "rolled_back", why(review))


def _back(review: Review, found: str) -> commands.RollBack:
    return commands.RollBack(actor=DESK, reason=why(review), key=f"canary:{found}")


def _act(runtime: Runtime, review: Review, command: Any, cause: Any, reason: Reason) -> Answered:
    move = commands.MovePointer(
        cause=cause,
        candidate=review.candidate,
        configuration=review.configuration,
        rollback=review.authorised.rollback if review.authorised else review.baseline,
        actor=DESK,
        reason=reason,
    )
    requests: list[tuple[StreamId, Any]] = [(candidate_stream(review.candidate), command), (POINTER, move)]
    return runtime.decide(requests)


def _trial(runtime: Runtime) -> Review | None:
    """The candidate in canary."""
    pointer: Pointer = runtime.fold(POINTER)
    if pointer.trial is None:
        return None
    review: Review = runtime.fold(candidate_stream(pointer.trial))
    return review if review.status == "canary" else None


def _counts(mission: Mission) -> bool:
    """Whether the mission is over, ran on the robot itself, and began. One that was cancelled before anything ran shows
    nothing.
    """
    return mission.ended and not mission.replay and ran(mission)


def _measured(runtime: Runtime, review: Review, mission: Mission, duplicate_starts: int) -> CanaryMission:
    course = metrics_of(runtime, mission.mission_id, duplicate_starts=duplicate_starts)
    baseline = runtime.stored_configuration(review.baseline)
    manifest = _manifest(review)
    value = value_of(manifest.metric, mission, course)
    took_part = exercised(baseline, runtime.configuration_of(mission), mission, course)
    return CanaryMission(
        mission_id=mission.mission_id,
        exercised=took_part,
        value=value,
        worse=is_worse(value, review.bound, BETTER[manifest.metric]),
        hard="duplicate_start" if duplicate_starts else "false_completion" if mission.false_completions else "",
        status=mission.status,
    )


def _manifest(review: Review) -> Manifest:
    if review.manifest is None:
        raise ValueError(f"candidate {review.candidate} has no manifest")
    return review.manifest
