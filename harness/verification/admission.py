"""Pure: what admission adds to a predicate's answer: stale and unsafe (D4), and mandatory evidence that is missing."""

from collections.abc import Sequence
from statistics import median

from harness.contracts.judging import SafetyState
from harness.contracts.observations import Odometry
from harness.verification.finding import Finding
from harness.verification.geometry import contains
from harness.verification.reading import Evidence, Track, read

SPEED_SHARE = 1.2
SPEED_WINDOW = 10
INSIDE_SAMPLES = 3
STREAMS = {"pose": "poses", "poses": "poses", "odometry": "odometry", "imu": "imu"}


def stale(finding: Finding, evidence: Evidence) -> str:
    """Why the newest sample is too old for this decision; empty if it is fresh or the answer does not age."""
    limit_s = evidence.policy.evidence.pose_age_s
    if finding.age_s is None or finding.age_s <= limit_s:
        return ""
    return f"the newest sample is {finding.age_s:.2f} s old, limit {limit_s:.2f} s"


def missing(evidence: Evidence) -> tuple[str, bool]:
    """Mandatory evidence that the context does not hold, and whether that is only because it was stale."""
    absent = [name for name in evidence.policy.evidence.mandatory if not _present(name, evidence)]
    if not absent:
        return "", False
    aged = {one.kind for one in evidence.context.withheld if one.reason == "stale"}
    return f"mandatory evidence is missing: {', '.join(absent)}", all(name in aged for name in absent)


def unsafe(evidence: Evidence) -> str:
    """Why this execution is a safety rejection: a standing veto, a broken speed cap, a forbidden region."""
    record = evidence.context.one("constraints")
    if record is None:
        return ""
    state = read(record, SafetyState)
    reasons = [f"{layer} vetoed: {reason}" for layer, reason in sorted(state.vetoes.items())]
    for track in evidence.tracks:
        if track.current:
            reasons += [*_too_fast(track.odometry, state.speed_cap_mps), *_trespassed(track, state)]
    return "; ".join(reasons)


def _present(name: str, evidence: Evidence) -> bool:
    context = evidence.context
    if name in STREAMS:
        return any(getattr(track, STREAMS[name]) for track in evidence.tracks if track.current)
    kind = {"images": "image", "frames": "image"}.get(name, name)
    return bool(context.all(kind)) or any(receipt.kind == name for receipt in evidence.receipts)


def _too_fast(odometry: Sequence[Odometry], cap_mps: float) -> list[str]:
    speeds = [abs(one.v_mps) for one in odometry]
    if max(speeds, default=0.0) <= SPEED_SHARE * cap_mps:
        return []
    windows = range(max(0, len(speeds) - SPEED_WINDOW + 1))
    fastest = max((median(speeds[start : start + SPEED_WINDOW]) for start in windows), default=0.0)
    if fastest <= SPEED_SHARE * cap_mps:
        return []
    return [f"the body ran at {fastest:.2f} m/s, the cap is {cap_mps:.2f} m/s"]


def _trespassed(track: Track, state: SafetyState) -> list[str]:
    inside = {
        name: sum(contains(region, (pose.x_m, pose.y_m)) for pose in track.poses)
        for name, region in state.keep_out_m.items()
        if len(region) > 2
    }
    return [f"the body was in {name}, which is closed to it" for name, n in inside.items() if n >= INSIDE_SAMPLES]
