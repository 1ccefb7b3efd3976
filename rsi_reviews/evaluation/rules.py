"""Defines the arms' own rules for accepting a leg as done. Pure; no setting of the harness selects them.

A rule returns "" or a sentence that says why this execution is not accepted. The judge has its own geometry
(`witnesses`), so that a rule and its judge cannot share an error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from harness.contracts.effects import Metric
from harness.contracts.observations import Odometry, Pose
from harness.contracts.protocol import InvocationReport
from harness.contracts.tasks import Node
from harness.verification import geometry
from harness.verification.bridging import bridged
from harness.verification.sources import Sources

SAMPLES = 3
REST_M = 0.02
BEFORE_S = 2.0


@dataclass(frozen=True)
class LegExecution:
    """One execution of a leg, and the evidence at hand. `bound`: only what was seen in this execution counts.

    `poses` and `odometry` are everything published in the mission, in order; `since_s` is the leg's first dispatch.
    """

    node: Node
    request_id: str
    report: InvocationReport
    dispatched_s: float
    since_s: float
    now_s: float
    poses: Sequence[Pose]
    odometry: Sequence[Odometry]
    bound: bool = True

    @property
    def effect(self) -> Metric:
        """The effect that the leg leads to."""
        return effect_of(self.node)

    @property
    def from_s(self) -> float:
        """The time from which a sample may count for this leg: some seconds before its dispatch; unbound, any time."""
        return self.since_s - BEFORE_S if self.bound else float("-inf")

    @property
    def own_poses(self) -> list[Pose]:
        """Poses that may count for this leg, by sensor time."""
        from_s = self.from_s
        found = {one.at_s: one for one in self.poses if one.at_s >= from_s}
        return [found[at_s] for at_s in sorted(found)]

    @property
    def own_odometry(self) -> list[Odometry]:
        """Odometry that may count for this leg, by sensor time."""
        from_s = self.from_s
        return [one for one in self.odometry if one.at_s >= from_s]


Rule = Callable[[LegExecution], str]


def effect_of(node: Node) -> Metric:
    """The place or route that a navigating node is to reach."""
    return next(one.effect for one in node.success_conditions if isinstance(one.effect, Metric))


def ended_well(one: LegExecution) -> str:
    """The provider itself reported success."""
    if one.report.status == "succeeded":
        return ""
    return f"the execution ended {one.report.status} ({one.report.failure or 'no failure word'})"


def in_time(one: LegExecution) -> str:
    """The end came before the node's deadline."""
    late_s = one.report.at_s - one.dispatched_s - one.node.timeout_s
    return f"the end came {late_s:.1f} s after the deadline" if late_s > 0 else ""


def of_this_request(one: LegExecution) -> str:
    """Binding: the report echoes the request that is open, and no other."""
    echoed = one.report.identity.request_id
    return "" if echoed == one.request_id else f"the report is about request {echoed[:12]}"


def fresh(one: LegExecution) -> str:
    """Binding: the newest pose is recent by its own stamp."""
    poses = one.own_poses
    age_s = one.now_s - poses[-1].at_s if poses else float("inf")
    limit_s = one.node.evidence.pose_age_s
    return f"the newest pose is {age_s:.2f} s old, limit {limit_s:.2f} s" if age_s > limit_s else ""


def arrived(one: LegExecution) -> str:
    """Three poses with distinct sensor times within the tolerance: the newest, or unbound any three in a row."""
    near = [
        geometry.distance((pose.x_m, pose.y_m), one.effect.target_m) <= one.effect.tolerance_m for pose in one.own_poses
    ]
    if len(near) < SAMPLES:
        return f"{len(near)} of {SAMPLES} poses"
    runs = [near[-SAMPLES:]] if one.bound else [near[at : at + SAMPLES] for at in range(len(near) - SAMPLES + 1)]
    return "" if any(all(run) for run in runs) else "the poses are not within the tolerance"


def at_rest(one: LegExecution) -> str:
    """Less than 2 cm by odometry in the last second."""
    fixes = [geometry.Fix(sample.at_s, sample.x_m, sample.y_m) for sample in one.own_odometry]
    moved_m = geometry.window_displacement(fixes, until_s=fixes[-1].at_s) if fixes else None
    if moved_m is None:
        return "odometry shows less than a second"
    return f"the body moved {moved_m:.3f} m in its last second" if moved_m >= REST_M else ""


def sources_agree(one: LegExecution) -> str:
    """Localiser and odometry agree over the last two seconds in motion, or since they last agreed."""
    sources = Sources(one.own_poses, one.own_odometry)
    direct = sources.before_standstill()
    if direct is not None and direct.holds:
        return ""
    since = sources.since_agreement(departed_s=one.since_s)
    if since is not None and since.holds and one.own_poses[-1].at_s > one.report.at_s + 1.0:
        return ""
    return "localiser and odometry do not agree"


def walked(one: LegExecution) -> str:
    """A circuit was left, walked in order for 95 % of its length, and returned to; other legs are not asked."""
    effect = one.effect
    if effect.predicate != "circuit":
        return ""
    track = list(bridged(one.own_poses, one.own_odometry).track)
    after_s = one.since_s if one.bound else one.from_s
    left_s = geometry.departed_s(track, origin=effect.target_m, after_s=after_s, radius_m=effect.bounds["departure_m"])
    if left_s is None:
        return "no pose shows that the body left"
    progress = geometry.route_progress(effect.route_m, [fix.point for fix in track])
    if progress.share < effect.bounds["progress"] or progress.waypoints < progress.of_waypoints:
        return f"{progress.share:.1%} of the route, {progress.waypoints} of {progress.of_waypoints} waypoints"
    return ""


PROVIDER_WORD: tuple[Rule, ...] = (ended_well,)
MONITORED: tuple[Rule, ...] = (ended_well, in_time)
BINDING: tuple[Rule, ...] = (of_this_request, fresh)
EVIDENCE: tuple[Rule, ...] = (ended_well, in_time, arrived, at_rest, walked, sources_agree)
BOUND: tuple[Rule, ...] = (*BINDING, *EVIDENCE)


def first_broken(rules: Sequence[Rule], execution: LegExecution) -> str:
    """Name and sentence of the first rule that refuses; empty if none does."""
    for rule in rules:
        if why := rule(execution):
            return f"{rule.__name__}: {why}"
    return ""
