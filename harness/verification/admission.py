"""Adds the admission rules to a predicate's answer: stale and unsafe (D4), and missing mandatory evidence. Pure."""

from collections.abc import Sequence
from statistics import median

from harness.contracts.observations import Odometry
from harness.contracts.reasons import Explanation, Reason, because, several
from harness.contracts.verifier_inputs import SafetyState
from harness.verification.finding import Finding
from harness.verification.geometry import contains
from harness.verification.reading import AdmittedTrack, Evidence, read

SPEED_SHARE = 1.2
SPEED_WINDOW = 10
INSIDE_SAMPLES = 3
STREAMS = {"pose": "poses", "poses": "poses", "odometry": "odometry", "imu": "imu"}


def stale(finding: Finding, evidence: Evidence) -> Reason | None:
    """Why the newest sample is too old for this decision; None if it is fresh or the answer does not age."""
    limit_s = evidence.policy.evidence.pose_age_s
    if finding.age_s is None or finding.age_s <= limit_s:
        return None
    return because("newest_sample_too_old", age_s=finding.age_s, limit_s=limit_s)


def missing(evidence: Evidence) -> tuple[Reason | None, bool]:
    """Mandatory evidence that the context does not hold, and whether that is only because it was stale."""
    absent = [name for name in evidence.policy.evidence.mandatory if not _present(name, evidence)]
    if not absent:
        return None, False
    aged = {one.kind for one in evidence.context.withheld if one.reason == "stale"}
    return because("mandatory_evidence_missing", names=tuple(absent)), all(name in aged for name in absent)


def unsafe(evidence: Evidence) -> Reason | None:
    """Why this execution is a safety rejection: an active veto, a broken speed cap, a forbidden region."""
    record = evidence.context.one("constraints")
    if record is None:
        return None
    state = read(record, SafetyState)
    reasons: list[Explanation] = [
        because("layer_vetoed", layer=layer, why=why) for layer, why in sorted(state.vetoes.items())
    ]
    for track in evidence.tracks:
        if track.current:
            reasons += [*_too_fast(track.odometry, state.speed_cap_mps), *_trespassed(track, state)]
    return several(reasons)


def _present(name: str, evidence: Evidence) -> bool:
    context = evidence.context
    if name in STREAMS:
        return any(getattr(track, STREAMS[name]) for track in evidence.tracks if track.current)
    kind = {"images": "image", "frames": "image"}.get(name, name)
    return bool(context.all(kind)) or any(receipt.kind == name for receipt in evidence.receipts)


def _too_fast(odometry: Sequence[Odometry], cap_mps: float) -> list[Reason]:
    speeds = [abs(one.v_mps) for one in odometry]
    if max(speeds, default=0.0) <= SPEED_SHARE * cap_mps:
        return []
    windows = range(max(0, len(speeds) - SPEED_WINDOW + 1))
    fastest = max((median(speeds[start : start + SPEED_WINDOW]) for start in windows), default=0.0)
    if fastest <= SPEED_SHARE * cap_mps:
        return []
    return [because("ran_too_fast", speed_mps=fastest, cap_mps=cap_mps)]


def _trespassed(track: AdmittedTrack, state: SafetyState) -> list[Reason]:
    inside = {
        name: sum(contains(region, (pose.x_m, pose.y_m)) for pose in track.poses)
        for name, region in state.keep_out_m.items()
        if len(region) > 2
    }
    return [because("was_in_closed_region", region=name) for name, n in inside.items() if n >= INSIDE_SAMPLES]
