"""Runs the recursion experiment: fleets on hidden sites, six arms, several generations. Every number follows from a
seed.

A fleet is one task. It runs on any process, and its outcome is one file, so that a run can be interrupted and resumed.
"""

import hashlib
from collections.abc import Sequence

from harness.contracts.configuration import Configuration
from harness.contracts.ids import Digest
from harness.contracts.regularities import HiddenSite
from harness.contracts.simulation import Simulator
from harness.contracts.values import Count, Name, Value
from rsi_reviews.contracts import Metric
from rsi_reviews.held_out import Secret
from rsi_reviews.hidden_sites import hidden_site, site_file
from rsi_reviews.recursion import arms
from rsi_reviews.recursion.gating import GateJudgement, Scale, SiteGate
from rsi_reviews.recursion.missions import MissionSeries, Stop, everyday, series
from rsi_reviews.regression.cases import Case, seeds_digest

MEASURED: tuple[Metric, ...] = (
    "verified_completion", "contract_false_completion", "epistemic_false_completion", "false_rejection", "handoffs",
    "recovery_cost", "mission_s", "operator_minutes", "duplicate_starts", "safety_violations",
)  # fmt: skip


class Terms(Value):
    """Everything that a run's numbers follow from. `recorded` and `measured`: missions per generation and fleet."""

    seed: Count
    generations: Count = 6
    recorded: Count = 8
    measured: Count = 10
    proposals: Count = 1
    scale: Scale = Scale()


class Task(Value):
    """One fleet of a run."""

    terms: Terms
    fleet: Count
    site: Name


class ArmMeasurement(Value):
    """One arm of one fleet in one generation: sums over its held-out missions, and its configuration."""

    arm: arms.Arm
    generation: Count
    missions: Count
    sums: dict[str, float]
    configuration: Digest


class CandidateStep(Value):
    """What was decided about one candidate."""

    arm: arms.Arm
    generation: Count
    judgement: GateJudgement


class FleetOutcome(Value):
    """The outcome of one fleet. `simulated` counts the missions that were really run for it."""

    task: Task
    kind: str
    measured: tuple[ArmMeasurement, ...]
    steps: tuple[CandidateStep, ...]
    simulated: Count


class _SeriesCache:
    """Series that were run before: the same cases under the same configuration give the same result."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._held: dict[tuple[Digest, Digest], MissionSeries] = {}
        self.missions = 0

    def run(self, cases: Sequence[Case], configuration: Configuration, stop: Stop | None = None) -> MissionSeries:
        """One series; one that was cut short is run again if all of it is wanted."""
        key = (seeds_digest(tuple(cases)), configuration.configuration_id)
        held = self._held.get(key)
        if held is None or (stop is None and len(held.results) < len(cases)):
            held = self._held[key] = series(cases, configuration, self._simulator, stop)
            self.missions += len(held.results)
        return held


def run_fleet(task: Task, simulator: Simulator) -> FleetOutcome:
    """All six arms of one fleet, generation by generation."""
    terms, book = task.terms, _SeriesCache(simulator)
    key = f"{terms.seed}/{task.fleet}"
    lines = [arms.ArmLineage(arm=arm) for arm in arms.ARMS]
    gates = {arm: _gate(terms, key, book) for arm in arms.ARMS}
    measured: list[ArmMeasurement] = []
    for generation in range(terms.generations + 1):
        site = hidden_site(f"{task.site}@{task.fleet}.{generation}")
        for line in lines:
            if line.arm == "expert":
                line.current = arms.written_by_hand(site_file(task.site).phase(generation).expert)
            measured.append(_measure(line, generation, cases=_held_out(terms, key, site), book=book))
            if generation < terms.generations:
                setting = arms.Setting(
                    gate=gates[line.arm],
                    recorded=_recorded(book, terms, key, site),
                    site=site,
                    proposals=terms.proposals,
                    generations=terms.generations,
                    key=key,
                )
                arms.step(line, generation, setting)
    return FleetOutcome(
        task=task,
        kind=site_file(task.site).kind,
        measured=tuple(measured),
        steps=tuple(
            CandidateStep(arm=line.arm, generation=generation, judgement=judgement)
            for line in lines
            for generation, judgement in line.judgements
        ),
        simulated=book.missions,
    )


def _gate(terms: Terms, key: str, book: _SeriesCache) -> SiteGate:
    secret = Secret(hashlib.sha256(f"evaluator/{key}".encode()).digest())
    return SiteGate(
        lambda cases, configuration, stop: book.run(cases, configuration, stop).results,
        secret=secret,
        scale=terms.scale,
        key=key,
    )


def _recorded(book: _SeriesCache, terms: Terms, key: str, site: HiddenSite) -> arms.Recorded:
    """What everyday missions of a generation recorded under a configuration: all that a generator gets."""
    return lambda configuration, at: (
        book.run(everyday(site, key, "recorded", at, count=terms.recorded), configuration).trace
    )


def _held_out(terms: Terms, key: str, site: HiddenSite) -> tuple[Case, ...]:
    """Missions that no gate and no generator sees: the same ones for every arm and generation."""
    return everyday(site, key, "measured", count=terms.measured)


def _measure(line: arms.ArmLineage, generation: int, *, cases: tuple[Case, ...], book: _SeriesCache) -> ArmMeasurement:
    results = book.run(cases, line.current).results
    sums: dict[str, float] = {name: sum(getattr(one, name) for one in results) for name in MEASURED}
    done = [one.mission_s for one in results if one.verified_completion]
    sums |= {"verified_s": sum(done), "unsound": float(sum(one.outcome != "finished" for one in results))}
    return ArmMeasurement(
        arm=line.arm,
        generation=generation,
        missions=len(results),
        sums=sums,
        configuration=line.current.configuration_id,
    )
