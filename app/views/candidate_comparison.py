"""Shapes two candidates side by side: what each changes, what each was measured to do, and how far each has come."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.views.candidates import title_of
from app.views.forms import SelectOption
from app.views.review import ChangeLine, change_line
from app.views.review_results import FamilyRow, MeasuredResults
from app.views.shell import Shell
from rsi_reviews.contracts import CLAUSES, ClauseAnswer
from rsi_reviews.difference import CandidateDifference
from rsi_reviews.evaluation_jobs import EvaluationJob
from rsi_reviews.projections import Review


@dataclass(frozen=True)
class ComparedCandidate:
    """What the console found of one of the two. `job` is its newest evaluation, if this console ran one."""

    review: Review
    difference: CandidateDifference
    measured: MeasuredResults | None
    clauses: Sequence[ClauseAnswer]
    job: EvaluationJob | None


@dataclass(frozen=True)
class ComparedSide:
    """One of the two as it is shown. `better_by` is the paired gain over all families, with its interval."""

    review: Review
    title: str
    change: tuple[ChangeLine, ...]
    measured: MeasuredResults | None
    job: EvaluationJob | None


@dataclass(frozen=True)
class ComparedRow:
    """One quantity of both; a side is None where it was not measured."""

    name: str
    left: FamilyRow | None
    right: FamilyRow | None


@dataclass(frozen=True)
class ClauseRow:
    """One clause of the acceptance predicate as each of both answers it; empty before an evaluation."""

    clause: str
    left: str
    right: str


@dataclass(frozen=True)
class ComparisonPage:
    """Two candidates, or one and the choice of the other. `alike`: both are judged by the same metric and baseline."""

    shell: Shell
    sides: tuple[ComparedSide, ...]
    families: tuple[ComparedRow, ...]
    clauses: tuple[ClauseRow, ...]
    alike: bool
    others: tuple[SelectOption, ...]
    first: str


def comparison_page(
    shell: Shell, found: Sequence[ComparedCandidate], every: Sequence[Review], *, first: str, second: str
) -> ComparisonPage:
    """`every`: all candidates, newest first, to choose the second from."""
    sides = tuple(
        ComparedSide(
            review=one.review,
            title=title_of(one.review),
            change=tuple(map(change_line, one.difference.changes)),
            measured=one.measured,
            job=one.job,
        )
        for one in found
    )
    others = [one for one in every if one.candidate != first and one.manifest is not None]
    return ComparisonPage(
        shell=shell,
        sides=sides,
        families=_families(*found) if len(found) == 2 else (),
        clauses=_clauses(*found) if len(found) == 2 else (),
        alike=len({(one.review.manifest.metric, one.review.baseline) for one in found if one.review.manifest}) == 1,
        others=tuple(SelectOption(one.candidate, title_of(one), one.candidate == second) for one in others),
        first=first,
    )


def _families(left: ComparedCandidate, right: ComparedCandidate) -> tuple[ComparedRow, ...]:
    measured = [side.measured.families if side.measured else () for side in (left, right)]
    rows = [{one.result.family: one for one in families} for families in measured]
    names = dict.fromkeys((*rows[0], *rows[1]))
    return tuple(ComparedRow(name, rows[0].get(name), rows[1].get(name)) for name in names)


def _clauses(left: ComparedCandidate, right: ComparedCandidate) -> tuple[ClauseRow, ...]:
    answers = [{one.clause: one.answer for one in side.clauses} for side in (left, right)]
    return tuple(ClauseRow(name, answers[0].get(name, ""), answers[1].get(name, "")) for name in CLAUSES)
