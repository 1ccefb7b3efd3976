"""Pure: a canary as people watch it: how many missions exercised the change, what each showed, how its test stands."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log

from app.messages import N_, word
from harness.contracts.actors import Actor
from rsi_reviews.canary import outcome
from rsi_reviews.contracts import CanaryTest
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import CanaryEntry, Review

FINDINGS = (
    ("sound", N_("nothing wrong")),
    ("false_completion", N_("false completion")),
    ("duplicate_start", N_("duplicate start")),
    ("safety_violation", N_("safety violation")),
)
OUTCOMES = {
    "go_on": N_("goes on"),
    "hard_fault": N_("a hard fault: rolled back"), "metric_worse": N_("the metric is worse: rolled back"),
    "not_exercised": N_("not exercised enough: withdrawn"), "passed": "passed",
}  # fmt: skip


@dataclass(frozen=True)
class CanaryRow:
    """One canary mission: what was measured of it, and what somebody who did not release it found."""

    mission_id: str
    status: str
    exercised: bool
    value: float
    worse: bool
    hard: str
    finding: str
    by: str
    reason: str
    at_s: float


@dataclass(frozen=True)
class CanaryPanel:
    """A canary. `evidence` of harm grows or shrinks mission by mission; reaching `limit` ends in a rollback.

    `why_not` says why this visitor cannot adjudicate; empty if they can.
    """

    candidate: str
    robot_id: str
    exercised: int
    needed: int
    seen: int
    window: int
    state: str
    metric: str
    bound: float
    bound_missions: int
    evidence: float
    limit: float
    rows: tuple[CanaryRow, ...]
    findings: tuple[tuple[str, str], ...]
    released_by: str
    open: bool
    why_not: str


def canary_panel(review: Review, pointer: Pointer, actor: Actor) -> CanaryPanel:
    """Raises ValueError for a candidate without a manifest: there is no such canary."""
    if review.manifest is None:
        raise ValueError("a canary has a manifest")
    test = review.manifest.canary
    return CanaryPanel(
        candidate=review.candidate,
        robot_id=str(review.robot_id or ""),
        exercised=len(review.exercised),
        needed=test.missions,
        seen=len(review.canary),
        window=test.window,
        state=OUTCOMES[outcome(review)] if review.status == "canary" else word(review.status),
        metric=word(review.manifest.metric),
        bound=review.bound,
        bound_missions=review.bound_missions,
        evidence=evidence([one.measured.worse for one in review.exercised], test),
        limit=1.0 / test.alpha,
        rows=tuple(_row(one) for one in review.canary),
        findings=FINDINGS,
        released_by=review.released_by.actor.name if review.released_by else "",
        open=review.status == "canary",
        why_not=_why_not(review, pointer, actor),
    )


def evidence(worse: Sequence[bool], test: CanaryTest) -> float:
    """The likelihood ratio of a harmful share of worse missions against a harmless one (D34)."""
    harmless = 1.0 - test.quantile
    up, down = log(test.harmful_share / harmless), log((1.0 - test.harmful_share) / (1.0 - harmless))
    return exp(sum(up if one else down for one in worse))


def _row(entry: CanaryEntry) -> CanaryRow:
    return CanaryRow(
        mission_id=entry.measured.mission_id,
        status=entry.measured.status,
        exercised=entry.measured.exercised,
        value=entry.measured.value,
        worse=entry.measured.worse,
        hard=word(entry.measured.hard),
        finding=dict(FINDINGS).get(entry.finding or "", ""),
        by=entry.by.actor.name if entry.by else "",
        reason=entry.by.reason if entry.by else "",
        at_s=entry.by.at_s if entry.by else 0.0,
    )


def _why_not(review: Review, pointer: Pointer, actor: Actor) -> str:
    released_by = review.released_by.actor.name if review.released_by else ""
    if "reviewer" not in actor.role.split("+"):
        return N_("A reviewer says what became of each mission; your role lets you watch.")
    if released_by == actor.name and pointer.policy.kind == "two_person":
        return N_("You released it: somebody else says what became of each mission.")
    return ""
