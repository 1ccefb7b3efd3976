"""Loads the evaluated candidate that ships with the program: the candidate, the terms and every result, as an example.

It was measured by `regen rsi evaluate` like any other. Its bytes are checked against their digest, and the present
acceptance predicate judges it again wherever it is used.
"""

import gzip
from importlib.resources import files
from importlib.resources.abc import Traversable

import msgspec

from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import sha256
from harness.contracts.reasons import because
from harness.contracts.values import Name, Value
from rsi_reviews.acceptance import Evaluation
from rsi_reviews.contracts import Candidate, EvaluationTerms, ResultSet
from rsi_reviews.held_out import Look
from rsi_reviews.regression.cases import cases_of
from rsi_reviews.regression.suite import shipped

SUMS = "SHA256SUMS"


class ShippedEvaluation(Value):
    """One evaluation with the UTC instants between which it ran; `note` gives further facts for the reader.

    `looks`: the held-out looks that its evaluator took up to this one, oldest first; they stay counted.
    """

    begun: Name
    ended: Name
    note: str
    candidate: Candidate
    terms: EvaluationTerms
    results: ResultSet
    looks: tuple[Look, ...]

    @property
    def label(self) -> str:
        """The date, the evaluator and the number of cases, in one sentence beside the figures."""
        return (
            f"Evaluated from {self.begun} to {self.ended} with {self.terms.suite_version}: {self.terms.cases} cases "
            f"under both configurations, evaluator {self.terms.evaluator}. {self.note} "
            "It ships with the program; `regen rsi evaluate` measures any candidate the same way."
        )

    def judged_on(self) -> Evaluation:
        """The inputs of the acceptance predicate, on the suites as they ship now."""
        return Evaluation(
            terms=self.terms,
            manifest=self.candidate.manifest,
            regression=cases_of(shipped("regression")),
            safety=cases_of(shipped("safety")),
            results=self.results,
        )


def shipped_evaluation(folder: Traversable | None = None) -> ShippedEvaluation:
    """The newest shipped evaluation. Raises ContractInvalid if it is missing, damaged or cannot be read."""
    place = folder or files("rsi_reviews").joinpath("evaluated")
    try:
        digest, name = place.joinpath(SUMS).read_text(encoding="utf-8").splitlines()[-1].split()
        body = place.joinpath(name).read_bytes()
    except (OSError, ValueError, IndexError) as error:
        raise ContractInvalid(
            because("no_shipped_evaluation", error=str(error)), where="rsi_reviews/evaluated"
        ) from error
    if sha256(body) != digest:
        raise ContractInvalid(because("shipped_evaluation_changed"), where=name)
    try:
        return msgspec.json.decode(gzip.decompress(body), type=ShippedEvaluation)
    except (OSError, EOFError, msgspec.MsgspecError) as error:
        raise ContractInvalid(because("shipped_evaluation_unreadable", error=str(error)), where=name) from error
