"""symbolic arrival_without_target: a drive without a named goal. It can be measured, but never satisfied (D38)."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.reasons import because
from harness.verification.body import current_track
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.geometry import path_length
from harness.verification.reading import Evidence


def arrival_without_target(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Ambiguous, always: where the body ended says nothing about where it was to go. Metres by the measured poses."""
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="arrival_without_target"))
    poses = current_track(evidence).poses
    travelled_m = path_length((pose.x_m, pose.y_m) for pose in poses)
    return ambiguous(because("no_target"), path_length_m=travelled_m, samples=float(len(poses)))
