"""Shapes a canary: how many missions exercised the change, what each measured, and where its test stands."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log

from app.i18n.catalogues import N_
from app.i18n.messages import word
from harness.contracts.actors import Actor
from rsi_reviews.canary import outcome
from rsi_reviews.contracts import CanaryTest
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import Review

FINDINGS: tuple[tuple[str, str], ...] = (
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
class CanaryPanel:
    """A canary. `evidence` of harm grows or shrinks mission by mission; reaching `limit` ends in a rollback.

    `why_not` says why this visitor cannot adjudicate; empty if they can.
    """

    review: Review
    test: CanaryTest
    state: str
    metric: str
    evidence: float
    why_not: str


def canary_panel(review: Review, pointer: Pointer, actor: Actor) -> CanaryPanel:
    """The panel of a canary. Raises ValueError for a candidate without a manifest."""
    if review.manifest is None:
        raise ValueError("a canary has a manifest")
    test = review.manifest.canary
    return CanaryPanel(
        review=review,
        test=test,
        state=OUTCOMES[outcome(review)] if review.status == "canary" else word(review.status),
        metric=word(review.manifest.metric),
        evidence=evidence([one.measured.worse for one in review.exercised], test),
        why_not=_why_not(review, pointer, actor),
    )


def evidence(worse: Sequence[bool], test: CanaryTest) -> float:
    """The likelihood ratio of a harmful share of worse missions against a harmless one (D34)."""
    harmless = 1.0 - test.quantile
    up, down = log(test.harmful_share / harmless), log((1.0 - test.harmful_share) / (1.0 - harmless))
    return exp(sum(up if one else down for one in worse))


def _why_not(review: Review, pointer: Pointer, actor: Actor) -> str:
    released_by = review.released_by.actor.name if review.released_by else ""
    if "reviewer" not in actor.role.split("+"):
        return N_("A reviewer says what became of each mission; your role lets you watch.")
    if released_by == actor.name and pointer.policy.kind == "two_person":
        return N_("You released it: somebody else says what became of each mission.")
    return ""
