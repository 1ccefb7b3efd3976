"""Defines the data types of the release process: manifests, candidates, results and answers. Nothing here decides.

Whether lower or higher is better is given by `Direction`, which the manifest fixes before anything runs. JSON has no
NaN: a measure that is not a number cannot be decoded, so it can never be read back as a pass.
"""

from typing import Annotated, Literal

import msgspec

from harness.contracts import values
from harness.contracts.configuration import Configuration
from harness.contracts.ids import Digest, MissionId
from harness.contracts.reasons import Reason

Section = Literal["context_rules", "templates", "routing", "recovery"]
SECTIONS: tuple[Section, ...] = ("context_rules", "templates", "routing", "recovery")

Metric = Literal[
    "verified_completion", "contract_false_completion", "epistemic_false_completion", "duplicate_starts",
    "safety_violations", "false_rejection", "handoffs", "recovery_cost", "mission_s", "operator_minutes",
]  # fmt: skip
Direction = Literal["higher", "lower"]
BETTER: dict[Metric, Direction] = {
    "verified_completion": "higher", "contract_false_completion": "lower", "epistemic_false_completion": "lower",
    "duplicate_starts": "lower", "safety_violations": "lower", "false_rejection": "lower", "handoffs": "lower",
    "recovery_cost": "lower", "mission_s": "lower", "operator_minutes": "lower",
}  # fmt: skip

Family = Literal["nominal", "stale_evidence", "duplicate_request", "interrupted_run", "resource_conflict"]
FAMILIES: tuple[Family, ...] = (
    "nominal", "stale_evidence", "duplicate_request", "interrupted_run", "resource_conflict",
)  # fmt: skip

Sentence = Annotated[str, msgspec.Meta(min_length=1, max_length=2000)]
Why = Sentence | Reason
"""Why something was decided: in a person's own words, or by a rule of the canary. Older releases kept sentences."""


class Author(values.Value):
    """Who proposed a candidate: a person by account name, or an optimiser by its own name and version."""

    name: values.Name
    kind: Literal["person", "optimiser"]


class Motive(values.Value):
    """A stored mission that led to the change, and the positions of its events in the log (R156)."""

    mission_id: MissionId
    positions: tuple[values.Count, ...] = ()


class CanaryTest(values.Value):
    """The sequential test of the declared metric in canary, fixed beforehand (D34).

    A canary mission is `worse` if its metric lies beyond the `quantile` of the baseline's own missions. The likelihood
    ratio between a share of `harmful_share` and one of 1 - `quantile` (harmless) is multiplied up mission by mission;
    reaching 1 / `alpha` ends in a rollback, which a harmless change meets with probability `alpha` at most, however
    often one looks (Ville). `missions`: how many must have exercised the change before it is current everywhere;
    `window`: how many there may be in all before an unexercised change is withdrawn.
    """

    quantile: values.Share = 0.75
    harmful_share: values.Share = 0.9
    alpha: Annotated[float, msgspec.Meta(gt=0, lt=0.5)] = 0.05
    missions: Annotated[int, msgspec.Meta(ge=5, le=50)] = 5
    window: Annotated[int, msgspec.Meta(ge=5, le=500)] = 50


class Manifest(values.Value):
    """What a change is for (R156). Its digest is recorded before anything runs; nothing in it changes afterwards."""

    component: Section
    reason: Sentence
    intended_effect: Sentence
    metric: Metric
    direction: Direction
    smallest_effect: values.Positive
    baseline: Digest
    rollback: Digest
    author: Author
    motives: tuple[Motive, ...] = ()
    canary: CanaryTest = msgspec.field(default_factory=CanaryTest)


class Candidate(values.Value):
    """A proposed configuration with its manifest, against one baseline. Its id is the digest of the three."""

    configuration: Configuration
    manifest: Manifest
    baseline: Digest

    @property
    def candidate_id(self) -> Digest:
        return candidate_id(
            configuration=self.configuration.configuration_id,
            manifest=values.digest(self.manifest),
            baseline=self.baseline,
        )


def candidate_id(*, configuration: Digest, manifest: Digest, baseline: Digest) -> Digest:
    """SHA-256 over the three digests, so the id is known without the configuration itself."""
    return values.digest({"baseline": baseline, "configuration": configuration, "manifest": manifest})


class EvaluationTerms(values.Value):
    """What an evaluation will be, recorded before it begins: results under other terms are refused by name.

    `predicate`, `suite` and `seeds` are digests of the acceptance predicate, of the regression suite and of the exact
    seed list; `evaluator` is the version of the program that runs it; `cases` how many paired cases there must be;
    `launched_by` everybody who started or parameterised it, `suite_edited_by` whoever edited the suite (D33).
    """

    candidate: Digest
    configuration: Digest
    manifest: Digest
    baseline: Digest
    predicate: Digest
    suite: Digest
    suite_version: values.Name
    seeds: Digest
    evaluator: values.Name
    cases: Annotated[int, msgspec.Meta(ge=1)]
    launched_by: Annotated[tuple[values.Name, ...], msgspec.Meta(min_length=1)]
    suite_edited_by: tuple[values.Name, ...] = ()


class CaseResult(values.Value, omit_defaults=True):
    """One case run under one configuration. Counts and costs are per mission; 0 or 1 for yes and no.

    `outcome`: only `finished` is a result; the others make their clause an error. `recovery_cost` counts spends, and
    the whole task budget for each handoff, safe stop or uncompleted mission (D31). `exercised`: the changed component
    took a decision here. `trace` is the digest of the mission's events, equal for the same seed on any machine.
    """

    case: Digest
    family: Family
    seed: int
    configuration: Digest
    outcome: Literal["finished", "crashed", "timed_out", "truncated"]
    verified_completion: float = 0.0
    partly_verified: float = 0.0
    contract_false_completion: float = 0.0
    epistemic_false_completion: float = 0.0
    duplicate_starts: float = 0.0
    safety_violations: float = 0.0
    false_rejection: float = 0.0
    handoffs: float = 0.0
    recovery_cost: float = 0.0
    mission_s: float = 0.0
    operator_minutes: float = 0.0
    exercised: bool = False
    status: str = ""
    trace: Digest = Digest("")
    note: str = ""


class HeldOutAnswer(values.Value):
    """The whole answer of a held-out look (D32): pass or fail, the number of the look, and the alpha it spent."""

    answer: Literal["pass", "fail"]
    look: Annotated[int, msgspec.Meta(ge=1)]
    alpha: values.Share
    cases: Annotated[int, msgspec.Meta(ge=1)]


class ResultSet(values.Value):
    """Everything that was measured under `terms`: one result per (case, configuration), both configurations."""

    terms: Digest
    results: tuple[CaseResult, ...]
    held_out: HeldOutAnswer | None = None
    seconds: float = 0.0


Answer = Literal["pass", "fail", "inconclusive", "error"]
ClauseName = Literal["contracts_preserved", "checks_not_worse", "metric_better", "release_authorised"]
CLAUSES: tuple[ClauseName, ...] = (
    "contracts_preserved", "checks_not_worse", "metric_better", "release_authorised",
)  # fmt: skip


class ClauseAnswer(values.Value):
    """One clause of the acceptance predicate: its answer, its numbers by name with units, and the reason in a
    sentence.
    """

    clause: ClauseName
    answer: Answer
    sentence: Sentence
    numbers: dict[str, float] = msgspec.field(default_factory=dict)


class AcceptanceReport(values.Value):
    """Clauses 1 to 3 over one result set. The fourth, the authorised release, is decided by the release service
    (D33).
    """

    terms: Digest
    result_set: Digest
    predicate: Digest
    clauses: tuple[ClauseAnswer, ...]

    @property
    def answer(self) -> Answer:
        """Pass only if clauses 1 to 3 are each present once and pass; otherwise the worst of error, fail,
        inconclusive.
        """
        if [clause.clause for clause in self.clauses] != list(CLAUSES[:3]):
            return "error"
        answers = {clause.answer for clause in self.clauses}
        order: tuple[Answer, ...] = ("error", "fail", "inconclusive")
        return next((answer for answer in order if answer in answers), "pass")


class Subject(values.Value):
    """Exactly what a person approves: what will run and what it was judged by (gate 2). Its digest is the subject."""

    candidate: Digest
    configuration: Digest
    manifest: Digest
    baseline: Digest
    predicate: Digest
    suite: Digest
    seeds: Digest
    evaluator: values.Name
    result_set: Digest
    report: Digest


class ReleasePolicy(values.Value):
    """Who must agree before a release (D33). `cooling_off_s`: what a single operator waits after the evaluation."""

    kind: Literal["two_person", "single_operator"] = "two_person"
    quorum: Annotated[int, msgspec.Meta(ge=1, le=10)] = 1
    cooling_off_s: values.NonNegative = 0.0
    authorisation_s: values.Positive = 86_400.0


class RestrictionViolation(values.Value):
    """One change that a candidate may not make: the rule, the path, the old and the new value, and the reason."""

    rule: values.Name
    path: str
    reason: Reason
    old: str = ""
    new: str = ""


Finding = Literal["sound", "false_completion", "duplicate_start", "safety_violation"]


class CanaryMission(values.Value):
    """What was measured of one mission under a candidate: whether the change was exercised, its metric, and faults.

    `hard` names a hard fault that the record itself shows. `worse`: the metric lies beyond the declared bound.
    """

    mission_id: MissionId
    exercised: bool
    value: float
    worse: bool
    hard: Literal["", "false_completion", "duplicate_start", "safety_violation"] = ""
    status: str = ""
