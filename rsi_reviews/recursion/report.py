"""Computes rows, contrasts and the answers to the refutation criteria from the fleets' outcomes. Pure. Intervals are
over fleets.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Literal

from harness.contracts.values import Value
from rsi_reviews.bounds import Interval, paired, upper_bound
from rsi_reviews.recursion.arms import ARMS, Arm
from rsi_reviews.recursion.experiment import ArmMeasurement, CandidateStep, FleetOutcome

SHOWN: dict[str, str] = {
    "verified_completion": "verified_completion",
    "false_completion": "contract_false_completion",
    "epistemic_false_completion": "epistemic_false_completion",
    "false_rejection": "false_rejection",
    "handoffs": "handoffs",
    "recovery_cost": "recovery_cost",
    "mission_s": "mission_s",
    "operator_minutes": "operator_minutes",
    "duplicate_starts": "duplicate_starts",
    "safety_violations": "safety_violations",
}
"""Keys of a row, and which measure each is, per mission."""
TWO_SIDED = 0.025
ALPHA = 0.05
Key = Literal["recovery_cost", "verified_completion"]
Over = Literal["last", "all"]


FROZEN_AS_GOOD = "the gated loop does not improve on the frozen harness"
BATCH_AS_GOOD = "the gated loop does not beat batch tuning: no value in recursion"
RANDOM_AS_GOOD = "the gated loop does not beat random search: no value in mining"
RELEASES_IN_CALM = "worlds without regularities release more often than alpha"
CONTRACTS_BROKEN = "the gated loop makes contract false completions"
LOOSENING_HARMLESS = "loosening what evidence binds raises no false completions"
UNGATED_AS_GOOD = "the ungated loop is as good"
REFUTES = (
    FROZEN_AS_GOOD,
    BATCH_AS_GOOD,
    RANDOM_AS_GOOD,
    RELEASES_IN_CALM,
    CONTRACTS_BROKEN,
    LOOSENING_HARMLESS,
    UNGATED_AS_GOOD,
)
"""What docs/recursion.md wrote down before the run: each would refute the loop's value."""


class Contrast(Value):
    """The gated loop against another arm, paired by fleet; positive is better for it.

    `over`: after the last generation, or the mean of all generations after the first.
    """

    measure: Key
    against: Arm
    over: Over
    fleets: int
    gain: float
    low: float
    high: float


class CriterionResult(Value):
    """One criterion that would refute the claim, written down before the run, and the numbers.

    `refuted`: whether it occurred; None where nothing was measured that could decide it.
    """

    refutes: str
    refuted: bool | None
    sentence: str


def rows(outcomes: Sequence[FleetOutcome]) -> list[dict[str, Any]]:
    """One row per arm and generation: means per held-out mission, and 95 % bootstrap intervals over fleets."""
    found = []
    for arm in ARMS:
        for generation in _generations(outcomes):
            parts = [_of(outcome, arm, generation) for outcome in outcomes]
            found.append({**_row(arm, generation, parts), **_decisions(outcomes, arm, before=generation)})
    return found


def by_kind(outcomes: Sequence[FleetOutcome]) -> list[dict[str, Any]]:
    """The same after the last generation, for each kind of site by itself."""
    last = max(_generations(outcomes), default=0)
    found = []
    for kind in sorted({outcome.kind for outcome in outcomes}):
        part = [outcome for outcome in outcomes if outcome.kind == kind]
        for arm in ARMS:
            row = _row(arm, last, [_of(outcome, arm, last) for outcome in part])
            found.append({"kind": kind, **row, **_decisions(part, arm, before=last)})
    return found


def contrasts(outcomes: Sequence[FleetOutcome]) -> tuple[Contrast, ...]:
    """The gated loop against each other arm, on every fleet."""
    if not outcomes:
        return ()
    generations = _generations(outcomes)
    keys: tuple[Key, ...] = ("recovery_cost", "verified_completion")
    spans: tuple[tuple[Over, list[int]], ...] = (("last", generations[-1:]), ("all", generations[1:]))
    return tuple(
        _contrast(outcomes, key, arm, over, span)
        for over, span in spans
        for key in keys
        for arm in ARMS
        if arm != "gated"
    )


def answers(outcomes: Sequence[FleetOutcome]) -> tuple[CriterionResult, ...]:
    """What docs/recursion.md wrote down before the run, each with its answer."""
    if not outcomes:
        return ()
    found = {(one.measure, one.against): one for one in contrasts(outcomes) if one.over == "last"}
    return (
        _beats(FROZEN_AS_GOOD, found, "frozen"),
        _beats(BATCH_AS_GOOD, found, "batch"),
        _beats(RANDOM_AS_GOOD, found, "random"),
        _calm(outcomes),
        _sound(outcomes),
        _loose(outcomes),
        _beats_or_breaks(outcomes, found),
    )


def _generations(outcomes: Sequence[FleetOutcome]) -> list[int]:
    return sorted({one.generation for outcome in outcomes for one in outcome.measured})


def _of(outcome: FleetOutcome, arm: Arm, generation: int) -> ArmMeasurement:
    return next(one for one in outcome.measured if (one.arm, one.generation) == (arm, generation))


def _row(arm: Arm, generation: int, parts: Sequence[ArmMeasurement]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "arm": arm,
        "generation": generation,
        "n": sum(part.missions for part in parts),
        "fleets": len(parts),
    }
    for name, measure in SHOWN.items():
        found = _over(parts, measure, f"{arm}/{generation}")
        row |= {name: round(found.mean, 5), f"{name}_ci": [round(found.low, 5), round(found.high, 5)]}
    done = sum(part.sums["verified_completion"] for part in parts)
    row["verified_mission_s"] = round(sum(part.sums["verified_s"] for part in parts) / done, 2) if done else None
    row["unsound"] = int(sum(part.sums["unsound"] for part in parts))
    return row


def _over(parts: Sequence[ArmMeasurement], measure: str, key: str) -> Interval:
    means = [part.sums[measure] / part.missions for part in parts]
    return paired({"fleets": means}, key=f"recursion/{key}", alpha=TWO_SIDED)


def _decisions(outcomes: Sequence[FleetOutcome], arm: Arm, *, before: int) -> dict[str, Any]:
    """Candidates of this arm so far, and what deciding them took: missions of the gate per release."""
    steps = [step for outcome in outcomes for step in outcome.steps if step.arm == arm and step.generation < before]
    taken = [step for step in steps if step.judgement.accepted]
    spent = sum(step.judgement.missions for step in steps)
    return {
        "proposed": len(steps),
        "accepted": len(taken),
        "rejected": len(steps) - len(taken),
        "rejected_why": dict(sorted(_whys(steps).items())),
        "gate_missions": spent,
        "gate_missions_per_release": round(spent / len(taken), 1) if taken else None,
    }


def _whys(steps: Iterable[CandidateStep]) -> Counter[str]:
    return Counter(step.judgement.clause for step in steps if not step.judgement.accepted)


def _contrast(outcomes: Sequence[FleetOutcome], key: Key, arm: Arm, over: Over, span: Sequence[int]) -> Contrast:
    sign = 1.0 if key == "verified_completion" else -1.0
    gains = [sign * (_mean(one, "gated", key, span) - _mean(one, arm, key, span)) for one in outcomes]
    found = paired({"fleets": gains}, key=f"recursion/{over}/{key}/{arm}", alpha=TWO_SIDED)
    return Contrast(
        measure=key, against=arm, over=over, fleets=found.n, gain=round(found.mean, 5), low=round(found.low, 5),
        high=round(found.high, 5),
    )  # fmt: skip


def _mean(outcome: FleetOutcome, arm: Arm, key: Key, span: Sequence[int]) -> float:
    """Per held-out mission, over these generations of one fleet."""
    parts = [_of(outcome, arm, generation) for generation in span]
    return sum(part.sums[key] for part in parts) / sum(part.missions for part in parts)


def _beats(refutes: str, found: dict[tuple[Key, Arm], Contrast], arm: Arm) -> CriterionResult:
    """Better in one of the two measures beyond its interval, and worse in neither."""
    cost, done = found[("recovery_cost", arm)], found[("verified_completion", arm)]
    better = (cost.low > 0 or done.low > 0) and cost.high >= 0 and done.high >= 0
    return CriterionResult(
        refutes=refutes, refuted=not better, sentence=f"Against {arm}: {_text(cost)}; {_text(done)}."
    )


def _text(one: Contrast) -> str:
    unit = "recovery cost per mission" if one.measure == "recovery_cost" else "verified completion"
    return f"{unit} better by {one.gain:.3f} (95 % interval {one.low:.3f} to {one.high:.3f}, {one.fleets} fleets)"


def _calm(outcomes: Sequence[FleetOutcome]) -> CriterionResult:
    """Releases on sites without regularities, by fleets: alpha is spent once per fleet."""
    fleets = [outcome for outcome in outcomes if outcome.kind == "none"]
    released = sum(
        any(step.judgement.accepted for step in outcome.steps if step.arm == arm)
        for outcome in fleets
        for arm in ("gated", "random", "batch")
    )
    lines = 3 * len(fleets)
    looks = sum(step.arm in ("gated", "random", "batch") for outcome in fleets for step in outcome.steps)
    most = upper_bound(released, lines) if lines else 1.0
    return CriterionResult(
        refutes=RELEASES_IN_CALM,
        refuted=released / lines > ALPHA if lines else None,
        sentence=f"{released} of {lines} gated lines of {len(fleets)} fleets without regularities released anything, "
        f"from {looks} candidates; alpha is {ALPHA:g} for each; the count does not refute a share of {most:.2f}.",
    )


def _sound(outcomes: Sequence[FleetOutcome]) -> CriterionResult:
    measured = [one for outcome in outcomes for one in outcome.measured if one.arm == "gated"]
    false = sum(one.sums["contract_false_completion"] for one in measured)
    missions = sum(one.missions for one in measured)
    return CriterionResult(
        refutes=CONTRACTS_BROKEN,
        refuted=false > 0,
        sentence=f"{false:g} in {missions} held-out missions under its configurations; the count does not refute a "
        f"share of {upper_bound(min(int(false), missions), missions):.4f}.",
    )


def _false(outcomes: Sequence[FleetOutcome], arm: Arm) -> tuple[int, int]:
    """Contract and epistemic false completions of one arm over all generations, and its missions."""
    measured = [one for outcome in outcomes for one in outcome.measured if one.arm == arm]
    count = sum(one.sums["contract_false_completion"] + one.sums["epistemic_false_completion"] for one in measured)
    return int(count), sum(one.missions for one in measured)


def _loose(outcomes: Sequence[FleetOutcome]) -> CriterionResult:
    loose, missions = _false(outcomes, "ungated")
    bound, same = _false(outcomes, "gated")
    return CriterionResult(
        refutes=LOOSENING_HARMLESS,
        refuted=loose <= bound,
        sentence=f"The ungated arm loosens when that pays: {loose} false completions in {missions} missions; "
        f"the gated one has {bound} in {same}.",
    )


def _beats_or_breaks(outcomes: Sequence[FleetOutcome], found: dict[tuple[Key, Arm], Contrast]) -> CriterionResult:
    """At least as good: no worse in both measures and without more false completions."""
    cost, done = found[("recovery_cost", "ungated")], found[("verified_completion", "ungated")]
    loose, _ = _false(outcomes, "ungated")
    bound, _ = _false(outcomes, "gated")
    as_good = loose <= bound and cost.low <= 0 and done.low <= 0
    return CriterionResult(
        refutes=UNGATED_AS_GOOD,
        refuted=as_good,
        sentence=f"Against ungated: {_text(cost)}; {_text(done)}; false completions {bound} to {loose}.",
    )
