"""Builds candidates, their evaluations and a release service on a harness in virtual time."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any

from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.bootstrap import Harness, Select, nothing_on_trial, simulated
from harness.contracts.actors import Actor
from harness.contracts.commands import StopMission
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.ports import EventStore
from harness.contracts.values import digest
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.acceptance import Evaluation, Predicate, accepted, predicate_digest
from rsi_reviews.candidate_queries import on_trial, selected
from rsi_reviews.contracts import (
    FAMILIES,
    Author,
    Candidate,
    CaseResult,
    EvaluationTerms,
    HeldOutAnswer,
    Manifest,
    ResultSet,
)
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.regression.cases import Case, Situation, seeds_digest
from rsi_reviews.release_service import ReleaseService, SeenSubject, SignedBy
from simulator.in_process import SIMULATOR

ROBOT = RobotId("vbot-1")
MINER = "trace-miner 1"
LAUNCHER = Actor(name="lea", role="operator")
REVIEWER = Actor(name="rob", role="reviewer")
OTHER_REVIEWER = Actor(name="ria", role="reviewer")
RELEASER = Actor(name="sam", role="releaser")
PREDICATE = Predicate(safety_cases=100)
"""The shipped predicate with fewer safety cases: everything else about it is real."""
_keys = count(1)


def say(actor: Actor, reason: str = "because the figures say so", key: str = "") -> SignedBy:
    """A person's signature under a fresh key, unless one is given."""
    return SignedBy(actor=actor, reason=reason, key=key or f"key-{next(_keys)}")


def tried(**changes: Any) -> Configuration:
    """The baseline with another recovery policy: shorter waits and a ladder in another order."""
    old = baseline()
    ladders = {**old.recovery.ladders, "no_progress": ("switch_skill", "human")}
    return replace(old, recovery=replace(old.recovery, **{"wait_s": 10.0, "ladders": ladders, **changes}))


def manifest(**changes: Any) -> Manifest:
    """A miner's manifest for a change of the recovery policy."""
    current = baseline().configuration_id
    stated = Manifest(
        component="recovery",
        reason="Waiting longer than 10 s never helped in 40 missions.",
        intended_effect="Missions reach a person or an end sooner.",
        metric="recovery_cost",
        direction="lower",
        smallest_effect=0.1,
        baseline=current,
        rollback=current,
        author=Author(name=MINER, kind="optimiser"),
    )
    return replace(stated, **changes)


def candidate(configuration: Configuration | None = None, **stated: Any) -> Candidate:
    """A candidate against H_0. `stated` changes its manifest."""
    words = manifest(**stated)
    return Candidate(configuration=configuration or tried(), manifest=words, baseline=words.baseline)


def routed(history: float = 0.6, **stated: Any) -> Candidate:
    """A candidate that weighs history differently: every mission with a choice of providers exercises it."""
    old = baseline()
    return candidate(replace(old, routing=replace(old.routing, history=history)), component="routing", **stated)


CASES: tuple[Case, ...] = tuple(
    Case(situation=Situation(family=family, template="circuit"), seed=seed) for family in FAMILIES for seed in range(20)
)


def terms_of(made: Candidate, **changes: Any) -> EvaluationTerms:
    """The terms of a candidate's evaluation."""
    terms = EvaluationTerms(
        candidate=made.candidate_id,
        configuration=made.configuration.configuration_id,
        manifest=digest(made.manifest),
        baseline=made.baseline,
        predicate=predicate_digest(PREDICATE),
        suite=digest("regression 1"),
        suite_version="regression 1",
        seeds=seeds_digest(CASES),
        evaluator="test-evaluator 1",
        cases=len(CASES),
        launched_by=(LAUNCHER.name,),
    )
    return replace(terms, **changes)


def result(case: Case, configuration: Digest, **measured: Any) -> CaseResult:
    """One finished case; it costs 2 spends unless measured otherwise."""
    figures: dict[str, Any] = {"verified_completion": 1.0, "recovery_cost": 2.0, "mission_s": 60.0, **measured}
    return CaseResult(
        case=case.case_id,
        family=case.situation.family,
        seed=case.seed,
        configuration=configuration,
        outcome=figures.pop("outcome", "finished"),
        **figures,
    )


def evaluation(made: Candidate, *, look: int = 1, terms: EvaluationTerms | None = None, **measured: Any) -> Evaluation:
    """Results in which the candidate spends half as much as its baseline; `measured` changes the candidate's own."""
    under = terms or terms_of(made)
    own = made.configuration.configuration_id
    results = [result(case, made.baseline) for case in CASES]
    results += [result(case, own, **{"recovery_cost": 1.0, **measured}) for case in CASES]
    alpha = 0.05 / (look * (look + 1))
    found = ResultSet(
        terms=digest(under),
        results=tuple(results),
        held_out=HeldOutAnswer(answer="pass", look=look, alpha=alpha, cases=100),
    )
    return Evaluation(terms=under, manifest=made.manifest, regression=CASES, safety=CASES, results=found)


@dataclass
class Bench:
    """A harness with its release service, and shortcuts for the steps of a candidate."""

    harness: Harness
    releases: ReleaseService
    seeds: Iterator[int] = field(default_factory=lambda: count(1))

    def proposed(self, made: Candidate) -> Digest:
        expect(self.releases.propose(made, say(LAUNCHER)))
        return made.candidate_id

    def evaluated(self, made: Candidate, *, look: int = 1, **measured: Any) -> Digest:
        name = self.proposed(made)
        expect(self.releases.begin(terms_of(made), say(LAUNCHER)))
        expect(self.releases.submit_results(evaluation(made, look=look, **measured), say(LAUNCHER)))
        return name

    def in_review(self, made: Candidate, *, look: int = 1) -> Digest:
        name = self.evaluated(made, look=look)
        expect(self.releases.submit(name, say(LAUNCHER)))
        return name

    def authorised(self, made: Candidate, *, look: int = 1) -> Digest:
        name = self.in_review(made, look=look)
        expect(self.releases.approve(name, say(REVIEWER), self.seen(name)))
        expect(self.releases.authorise(name, say(RELEASER), self.seen(name)))
        return name

    def in_canary(self, made: Candidate, *, look: int = 1) -> Digest:
        name = self.authorised(made, look=look)
        expect(self.releases.release(name, say(RELEASER), self.seen(name), robot_id=ROBOT))
        return name

    def current(self, made: Candidate, *, look: int = 1) -> Digest:
        """Take it through its canary: five missions that exercise the change, each found sound."""
        name = self.in_canary(made, look=look)
        for _ in range(5):
            expect(self.releases.adjudicate(name, self.mission(), "sound", say(REVIEWER)))
        assert self.releases.review(name).status == "current", self.releases.review(name).canary
        return name

    def seen(self, name: Digest) -> SeenSubject:
        review = self.releases.review(name)
        return SeenSubject(cycle=review.cycle, subject=review.subject_digest)

    def mission(self, *faults: str, template: str = "circuit") -> MissionId:
        """Run a whole mission and report its end to the release service."""
        mission_id = self.begun(*faults, template=template)
        self.harness.supervisor.run(mission_id)
        expect(self.releases.catch_up())
        return mission_id

    def called_off(self, mission_id: MissionId) -> None:
        """A mission that a person stops; it ends."""
        stop = StopMission(actor=LAUNCHER, reason="called off")
        expect(self.harness.runtime.submit(mission_id, stop))
        self.harness.supervisor.run(mission_id)
        expect(self.releases.catch_up())

    def begun(self, *faults: str, template: str = "circuit") -> MissionId:
        """A mission that is created and not run."""
        labels = {"faults": ",".join(faults)} if faults else {}
        start = Start(actor=LAUNCHER, robot_id=ROBOT, template=template, seed=next(self.seeds), labels=labels)
        expect(self.harness.runtime.start(start))
        return self.harness.runtime.missions()[0].mission_id


@contextmanager
def bench(
    *, seed: int = 3, store: EventStore | None = None, watched: bool = False, select: Select = selected
) -> Iterator[Bench]:
    """A harness on the kinematic robot, opened with the release service's deciders and its pointer.

    `watched`: a person approves each motion of a canary mission, as outside suites and experiments. `select`: what a
    new mission runs under.
    """
    settings = HarnessSettings(speed=0, fidelity="kinematic")
    trial = on_trial if watched else nothing_on_trial
    with simulated(
        settings, simulator=SIMULATOR, seed=seed, store=store, deciders=DECIDERS, select=select, trial=trial
    ) as harness:
        yield Bench(
            harness=harness, releases=ReleaseService(harness.runtime, judge=partial(accepted, predicate=PREDICATE))
        )


def expect(decision: Any) -> Accepted[Any]:
    """The decision, which must have been accepted."""
    assert isinstance(decision, Accepted), decision
    return decision


def rule_of(decision: Any) -> str:
    """The rule that refused."""
    assert isinstance(decision, Refused), decision
    return decision.rule
