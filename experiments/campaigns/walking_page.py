"""Writes the walking campaign's figures into docs/walking.md, between the marks of its page, and as JSON."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import fmean, quantiles

import msgspec

from experiments.campaigns.regen import ROOT
from experiments.campaigns.walking_gaps import WalkedLeg
from harness.contracts.values import Count, Value
from rsi_reviews.bounds import upper_bound

PAGE = ROOT / "docs" / "walking.md"
RESULTS = ROOT / "docs" / "results" / "walking.json"
BEGIN, END = "<!-- figures: written by the campaign -->", "<!-- end of figures -->"
FALL = "pushed-over"


class WalkedMission(Value):
    """One mission. `accepted`: navigations that the gate committed; `accepted_falsely`: of these, the stages whose body
    truly stood outside the tolerance.
    """

    number: Count
    seed: Count
    template: str
    fault: str
    status: str
    reason: str
    seconds: float
    cpu_s: float
    falls: Count
    lost: Count
    found: Count
    accepted: Count
    accepted_falsely: tuple[str, ...]
    legs: tuple[WalkedLeg, ...]


class Spread(Value):
    """Mean, median and 95th percentile."""

    mean: float
    median: float
    high: float


class LegGaps(Value):
    """The succeeded navigations of one commanded length: what each source says of it, metres."""

    stage: str
    legs: Count
    commanded_m: float
    odometry_m: Spread
    localiser_m: Spread
    truth_m: Spread
    lateral_m: Spread
    lateral_worst_m: float
    drift_m: Spread
    localiser_off_m: Spread
    silent_s: Spread
    declared_error_m: Spread
    end_error_m: Spread
    end_worst_m: float


class MissionCounts(Value):
    """Missions of one template under one fault, and how they ended."""

    template: str
    fault: str
    missions: Count
    ended: dict[str, Count]
    falls: Count
    lost: Count
    found: Count


class WalkingReport(Value):
    """The campaign. `asked` is the size that the figures are wanted at, `core_hours` what that size needs."""

    seed: Count
    missions: Count
    asked: Count
    cpu_s: float
    core_hours: float
    mission_s: float
    counts: tuple[MissionCounts, ...]
    legs: tuple[LegGaps, ...]
    falls_unpushed: Count
    falls_unpushed_bound: float
    accepted: Count
    accepted_falsely: Count
    accepted_falsely_bound: float
    open_reasons: dict[str, Count]


def figures(missions: Sequence[WalkedMission], *, seed: int, target: int) -> WalkingReport:
    """All figures of these missions."""
    kinds = sorted({(one.template, one.fault) for one in missions})
    legs = [leg for one in missions for leg in one.legs if leg.status == "succeeded"]
    stages = sorted({(_stage(one), one.commanded_m) for one in legs}, key=lambda one: one[1])
    unpushed = [one for one in missions if one.fault != FALL]
    falls = sum(one.falls > 0 for one in unpushed)
    accepted, falsely = sum(one.accepted for one in missions), sum(len(one.accepted_falsely) for one in missions)
    cpu_s = sum(one.cpu_s for one in missions)
    return WalkingReport(
        seed=seed,
        missions=len(missions),
        asked=target,
        cpu_s=round(cpu_s, 1),
        core_hours=round(cpu_s / max(len(missions), 1) * target / 3600, 2),
        mission_s=round(sum(one.seconds for one in missions), 1),
        counts=tuple(_counts(kind, [one for one in missions if (one.template, one.fault) == kind]) for kind in kinds),
        legs=tuple(
            _gaps(name, m, [one for one in legs if (_stage(one), one.commanded_m) == (name, m)]) for name, m in stages
        ),
        falls_unpushed=falls,
        falls_unpushed_bound=upper_bound(falls, len(unpushed)),
        accepted=accepted,
        accepted_falsely=falsely,
        accepted_falsely_bound=upper_bound(falsely, accepted),
        open_reasons=dict(Counter(_kind(one.reason) for one in unpushed if one.status != "succeeded")),
    )


def _kind(reason: str) -> str:
    """A reason without its figures, so that equal ones are counted together."""
    return re.sub(r"[0-9a-f]{12,}|\d+(\.\d+)?", "…", reason)


def _stage(leg: WalkedLeg) -> str:
    return f"{leg.node_id} ({leg.provider_id})"


def _counts(kind: tuple[str, str], missions: Sequence[WalkedMission]) -> MissionCounts:
    return MissionCounts(
        template=kind[0],
        fault=kind[1],
        missions=len(missions),
        ended=dict(Counter(one.status for one in missions)),
        falls=sum(one.falls for one in missions),
        lost=sum(one.lost for one in missions),
        found=sum(one.found for one in missions),
    )


def _gaps(stage: str, commanded_m: float, legs: Sequence[WalkedLeg]) -> LegGaps:
    def spread(of: Callable[[WalkedLeg], float]) -> Spread:
        return _spread([of(one) for one in legs])

    return LegGaps(
        stage=stage,
        legs=len(legs),
        commanded_m=commanded_m,
        odometry_m=spread(lambda one: one.odometry_m),
        localiser_m=spread(lambda one: one.localiser_m),
        truth_m=spread(lambda one: one.truth_m),
        lateral_m=spread(lambda one: one.lateral_m[1]),
        lateral_worst_m=max(one.lateral_m[0] for one in legs),
        drift_m=spread(lambda one: one.drift_m),
        localiser_off_m=spread(lambda one: one.localiser_off_m),
        silent_s=spread(lambda one: one.silent_s),
        declared_error_m=spread(lambda one: one.declared_error_m or 0.0),
        end_error_m=spread(lambda one: one.end_error_m),
        end_worst_m=max(one.end_error_m for one in legs),
    )


def _spread(values: Sequence[float]) -> Spread:
    cuts = quantiles(values, n=20, method="inclusive") if len(values) > 1 else [values[0]] * 19
    return Spread(mean=round(fmean(values), 4), median=round(cuts[9], 4), high=round(cuts[18], 4))


def table(found: WalkingReport) -> str:
    """The figures in Markdown."""
    return "\n\n".join([_intro(found), _missions(found), _distances(found), _errors(found), _open(found)])


def _intro(found: WalkingReport) -> str:
    false_share, fall_share = 100 * found.accepted_falsely_bound, 100 * found.falls_unpushed_bound
    return (
        f"{found.missions:,} missions, seeds from {found.seed}, {found.mission_s / 3600:.1f} h of mission time in "
        f"{found.cpu_s / 3600:.2f} core-hours. {found.asked:,} missions of this mix need {found.core_hours:.1f} "
        f"core-hours of this machine.\n\n"
        f"- Accepted navigations: {found.accepted}. Of these the body truly stood outside the tolerance in "
        f"{found.accepted_falsely} (at most {false_share:.1f} %, one-sided 95 % Clopper-Pearson).\n"
        f"- Missions in which it fell without being pushed: {found.falls_unpushed} "
        f"(at most {fall_share:.1f} %)."
    )


def _missions(found: WalkingReport) -> str:
    rows = [
        f"| {one.template} | {one.fault or 'none'} | {one.missions} | "
        + ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in sorted(one.ended.items()))
        + f" | {one.falls} | {one.lost} | {one.found} |"
        for one in found.counts
    ]
    head = (
        "| mission | fault | missions | ended | falls | localiser lost | found again |\n"
        "|---|---|---:|---|---:|---:|---:|"
    )
    return "\n".join([head, *rows])


def _distances(found: WalkingReport) -> str:
    rows = [
        f"| {one.stage} | {one.legs} | {one.commanded_m:.2f} | {one.odometry_m.mean:.2f} | "
        f"{one.localiser_m.mean:.2f} | {one.truth_m.mean:.2f} | {one.lateral_m.mean:.3f} / {one.lateral_worst_m:.2f} | "
        f"{one.drift_m.mean:.2f} / {one.drift_m.high:.2f} |"
        for one in found.legs
    ]
    head = (
        "| leg (metres) | legs | commanded | odometry | localiser | truth | off the route: mean / worst | "
        "odometry's drift at the end: mean / 95 % |\n|---|---:|---:|---:|---:|---:|---:|---:|"
    )
    return "\n".join([head, *rows])


def _errors(found: WalkingReport) -> str:
    rows = [
        f"| {one.stage} | {one.legs} | {one.declared_error_m.mean:.3f} | {one.end_error_m.mean:.3f} / "
        f"{one.end_error_m.high:.3f} / {one.end_worst_m:.3f} | {one.localiser_off_m.mean:.4f} / "
        f"{one.localiser_off_m.high:.4f} | {one.silent_s.mean:.2f} / {one.silent_s.high:.2f} |"
        for one in found.legs
    ]
    head = (
        "| leg (metres, seconds) | legs | declared from the goal: mean | truly from the goal: mean / 95 % / worst | "
        "localiser from the truth: mean / 95 % | longest time without a pose: mean / 95 % |\n"
        "|---|---:|---:|---:|---:|---:|"
    )
    return "\n".join([head, *rows])


def _open(found: WalkingReport) -> str:
    if not found.open_reasons:
        return "Every mission that nobody pushed over succeeded."
    lines = [f"- {count} x {reason}" for reason, count in sorted(found.open_reasons.items(), key=lambda one: -one[1])]
    return "\n".join(["Missions that nobody pushed over and that did not succeed:", "", *lines])


def publish(found: WalkingReport, *, page: Path = PAGE, results: Path = RESULTS) -> None:
    """Write the JSON file and the part of the page between its two marks. Raises ValueError without the marks."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    results.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=2) + b"\n")
    page.write_text(f"{before}{BEGIN}\n\n{table(found)}\n\n{END}{after}", encoding="utf-8")
