"""Runs the everyday missions of one fleet on one site, one after another in one harness, so that its memory grows.

The fleet's robot is carried back before each mission. Nobody answers its questions, so a mission that asks does not
finish.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from harness.bootstrap import simulated
from harness.contracts.commands import StopMission
from harness.contracts.configuration import Configuration
from harness.contracts.regularities import HiddenSite
from harness.contracts.simulation import Simulator
from harness.settings import HarnessSettings
from rsi_reviews.contracts import CaseResult, Family
from rsi_reviews.generate.trace import MissionTrace, Trace, mission_trace
from rsi_reviews.recursion.random_draws import seed_of, uniform
from rsi_reviews.regression import case_run
from rsi_reviews.regression.cases import Case, Outside, Situation
from rsi_reviews.regression.judge import judged

TEMPLATE = "circuit"
FAULT_SHARE = 0.15
FAULTS: tuple[tuple[Family, str], ...] = (
    ("interrupted_run", "early-success"),
    ("stale_evidence", "stale-pose"),
    ("stale_evidence", "missing-pose"),
    ("stale_evidence", "frozen-localiser"),
    ("duplicate_request", "duplicate-request"),
    ("interrupted_run", "interrupted"),
    ("stale_evidence", "lost-localisation"),
)
"""What goes wrong now and then on every site, in FAULT_SHARE of the missions: nothing of the site's own."""
TAKEN_S = 8.0
Stop = Callable[[Sequence[CaseResult]], bool]


@dataclass(frozen=True)
class MissionSeries:
    """The result of a series: the judge's results, which no generator sees, and the missions' own records."""

    results: tuple[CaseResult, ...]
    trace: Trace


def everyday(site: HiddenSite, *key: object, count: int) -> tuple[Case, ...]:
    """Everyday missions of this site, determined by the key alone."""
    return tuple(_everyday(site, (*key, number)) for number in range(count))


def suite_cases(site: HiddenSite, *key: object, per_family: int) -> tuple[Case, ...]:
    """The five families on this site, each with this many pairs, determined by the key alone."""
    kinds: tuple[tuple[Family, tuple[str, ...], tuple[Outside, ...]], ...] = (
        ("nominal", (), ()),
        ("stale_evidence", ("stale-pose",), ()),
        ("duplicate_request", ("duplicate-request",), ()),
        ("interrupted_run", ("interrupted",), ()),
        ("resource_conflict", (), (Outside(kind="lease", at_s=0.0, for_s=TAKEN_S),)),
    )
    return tuple(
        Case(
            situation=Situation(family=family, template=TEMPLATE, site=site, faults=faults, outside=outside),
            seed=seed_of(*key, family, number),
        )
        for number in range(per_family)
        for family, faults, outside in kinds
    )


def series(
    cases: Sequence[Case], configuration: Configuration, simulator: Simulator, stop: Stop | None = None
) -> MissionSeries:
    """Run the cases one after another in one harness; all of them are on the same site.

    `stop` is called after each mission and returns whether that was enough.
    """
    if not cases:
        return MissionSeries(results=(), trace=Trace(missions=()))
    settings = HarnessSettings(speed=0, fidelity="kinematic", robot_id=case_run.ROBOT)
    results: list[CaseResult] = []
    traces: list[MissionTrace] = []
    site = cases[0].situation.site
    with simulated(
        settings, simulator=simulator, seed=cases[0].seed, configuration=configuration, hidden=site
    ) as harness:
        runtime = harness.runtime
        for case in cases:
            after = runtime.head().position
            mission_id = case_run.begin_mission(harness, case.situation, case.seed)
            begun_s = harness.clock.now().mission_s
            cut = case_run.stepped(harness, mission_id, case.situation.outside)
            traces.append(mission_trace(runtime, mission_id))
            yardstick = case_run.yardstick(case.situation, simulator)
            account = case_run.account_of(
                harness, mission_id, case, yardstick=yardstick, begun_s=begun_s, cut=cut, after=after
            )
            results.append(judged(account))
            if stop is not None and stop(results):
                break
            if not runtime.mission(mission_id).ended:
                runtime.submit(mission_id, StopMission(actor=case_run.ASKING, reason="the robot is fetched"))
                harness.supervisor.run(mission_id)
    return MissionSeries(results=tuple(results), trace=Trace(missions=tuple(traces)))


def _everyday(site: HiddenSite, key: tuple[object, ...]) -> Case:
    seed = seed_of(*key)
    family: Family = "nominal"
    faults: tuple[str, ...] = ()
    if uniform("fault", *key) < FAULT_SHARE:
        family, name = FAULTS[int(uniform("which", *key) * len(FAULTS))]
        faults = (name,)
    return Case(situation=Situation(family=family, template=TEMPLATE, site=site, faults=faults), seed=seed)
