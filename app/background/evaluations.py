"""Caches what evaluations measured, read from the log once per result set. Writes nothing."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from threading import Lock

from cachetools import LRUCache

from app.i18n.messages import lazy_gettext, listed, word
from app.views.review_results import MeasuredResults, measured
from harness.contracts.ids import Digest
from rsi_reviews.candidate_queries import CandidateQueries
from rsi_reviews.contracts import ResultSet
from rsi_reviews.projections import Review
from rsi_reviews.regression.cases import Case, cases_of
from rsi_reviews.regression.results import results_path
from rsi_reviews.regression.suite import shipped

KEPT = 4


class EvaluationCache:
    """Safe between threads; the newest KEPT result sets stay in memory."""

    def __init__(self, queries: CandidateQueries, folder: Path | None = None) -> None:
        """`folder`: where the evaluator of this installation keeps finished cases while it runs."""
        self._shelf, self._folder = queries, folder
        self._known: LRUCache[Digest, tuple[ResultSet, MeasuredResults]] = LRUCache(KEPT)
        self._lock = Lock()

    def of(self, candidate: Digest) -> tuple[ResultSet, MeasuredResults] | None:
        """What was measured of a candidate, and how it is shown; None before. Raises UnknownName."""
        review = self._shelf.review(candidate)
        if review.evaluation is None or review.manifest is None:
            return None
        name = review.evaluation.result_set
        with self._lock:
            if name not in self._known:
                results = self._shelf.results(candidate)
                if results is None:
                    return None
                self._known[name] = results, measured(results, review.manifest, regression_cases(), situations())
            return self._known[name]

    def progress(self, review: Review) -> str:
        """How many results of an evaluation under way its evaluator has kept, in words; empty where nobody can tell."""
        terms = review.terms
        if terms is None:
            return ""
        needed = _grouped(2 * terms.cases)
        path = results_path(self._folder, terms.evaluator) if self._folder else None
        if path is None or not path.is_file():
            return lazy_gettext("{count} missions to run", count=needed)
        body = path.read_bytes()
        count = sum(body.count(f'"configuration":"{one}"'.encode()) for one in (terms.baseline, terms.configuration))
        return lazy_gettext(
            "{done} of {count} missions to run", done=_grouped(min(count, 2 * terms.cases)), count=needed
        )


def evaluator_folder(data: Path) -> Path:
    """Where the evaluator of a data folder keeps its secret, its looks and its results: beside it."""
    return data.absolute().with_name(f"{data.absolute().name}-evaluator")


@cache
def regression_cases() -> frozenset[str]:
    """The cases of the shipped regression suite: those that the declared metric is judged on."""
    return frozenset(case.case_id for case in cases_of(shipped("regression")))


@cache
def situations() -> Mapping[str, str]:
    """Every shipped case in words. A case of an older suite is not here; its family and seed still say what it was."""
    return {case.case_id: _words(case) for name in ("regression", "safety") for case in cases_of(shipped(name))}


def _words(case: Case) -> str:
    situation = case.situation
    outside = [
        lazy_gettext(
            "{resource} held by somebody else for {seconds} s", resource=word(one.kind), seconds=f"{one.for_s:g}"
        )
        for one in situation.outside
    ]
    return listed((situation.template, *situation.faults, *outside))


def _grouped(count: int) -> str:
    return f"{count:,}".replace(",", " ")
