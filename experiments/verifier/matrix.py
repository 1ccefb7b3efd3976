"""Counts the verifier's answers against the truth of the simulated world: one confusion matrix per predicate."""

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from experiments.verifier.cases import CaseAnswer, CaseJudge, VerifierCase
from harness.contracts.values import Count, Value
from harness.verification.verdict import Verifier, verify
from rsi_reviews.bounds import upper_bound


class Confusion(Value):
    """Answers by truth. `at_bound_*`: cases too near to the condition's bound for the sensors; either answer is right.

    `refused` is everything that is not satisfied, whatever it is called.
    """

    satisfied_true: Count = 0
    satisfied_false: Count = 0
    refused_true: Count = 0
    refused_false: Count = 0
    at_bound_satisfied: Count = 0
    at_bound_refused: Count = 0

    @property
    def true(self) -> int:
        return self.satisfied_true + self.refused_true

    @property
    def false(self) -> int:
        return self.satisfied_false + self.refused_false

    @property
    def cases(self) -> int:
        """Cases with a truth; those at a bound are not among them."""
        return self.true + self.false


class PredicateMatrix(Value):
    """One predicate: all faults together, each by itself, the verdicts with their reason codes, and the epistemic ones.

    `false_bound`: at most this share of false conditions is satisfied, one-sided Clopper-Pearson at 95 %.
    `refusals`: verdict and reason of what was refused though it is true, most frequent first.
    """

    predicate: str
    total: Confusion
    false_bound: float
    faults: dict[str, Confusion]
    epistemic: dict[str, Confusion]
    verdicts: dict[str, dict[str, Count]]
    refusals: dict[str, Count]


class VerifierReport(Value):
    """All predicates. `offences` must be empty: what is satisfied though false and not epistemic, and too few cases."""

    cases: Count
    seed: Count
    pools: dict[str, Count]
    predicates: tuple[PredicateMatrix, ...]
    offences: tuple[str, ...]


@dataclass
class PredicateCounts:
    """Counts the answers on one predicate."""

    faults: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    epistemic: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    verdicts: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    refusals: Counter[str] = field(default_factory=Counter)

    def add(self, case: VerifierCase, answer: CaseAnswer) -> None:
        """Counts one case."""
        counts = self.epistemic if case.epistemic else self.faults
        counts[case.fault][_place(case, answer)] += 1
        if case.epistemic or answer.satisfied:
            return
        reason = " + ".join(dict.fromkeys(answer.codes)) or "no reason"
        self.verdicts[answer.verdict][reason] += 1
        if case.true:
            self.refusals[f"{answer.verdict}: {reason}"] += 1


def counted(cases: Iterable[VerifierCase], *, verifier: Verifier = verify) -> dict[str, PredicateCounts]:
    """Every case judged, and counted by its predicate."""
    judge, found = CaseJudge(verifier), defaultdict[str, PredicateCounts](PredicateCounts)
    for case in cases:
        found[case.predicate].add(case, judge.answer(case))
    return dict(found)


def matrix(predicate: str, counting: PredicateCounts) -> PredicateMatrix:
    """The matrix of one predicate."""
    total = _confusion(sum(counting.faults.values(), Counter()))
    return PredicateMatrix(
        predicate=predicate,
        total=total,
        false_bound=upper_bound(total.satisfied_false, total.false) if total.false else 1.0,
        faults={name: _confusion(counting.faults[name]) for name in sorted(counting.faults, key=_none_first)},
        epistemic={name: _confusion(counting.epistemic[name]) for name in sorted(counting.epistemic)},
        verdicts={name: dict(counting.verdicts[name].most_common()) for name in sorted(counting.verdicts)},
        refusals=dict(counting.refusals.most_common()),
    )


def offences(found: PredicateMatrix, *, cases: int, false: int) -> list[str]:
    """What must not be: a false condition that is satisfied, or too few cases to say so."""
    problems = [
        f"{found.predicate}: satisfied though false {one.satisfied_false} of {one.false} times, {name}"
        for name, one in found.faults.items()
        if one.satisfied_false
    ]
    if found.total.cases < cases:
        problems.append(f"{found.predicate}: {found.total.cases} cases, at least {cases} are wanted")
    if found.total.false < false:
        problems.append(f"{found.predicate}: {found.total.false} false cases, at least {false} are wanted")
    return problems


def _place(case: VerifierCase, answer: CaseAnswer) -> str:
    outcome = "satisfied" if answer.satisfied else "refused"
    if case.true is None:
        return f"at_bound_{outcome}"
    return f"{outcome}_{'true' if case.true else 'false'}"


def _confusion(counts: Counter[str]) -> Confusion:
    return Confusion(**counts)


def _none_first(name: str) -> tuple[bool, str]:
    return name != "none", name
