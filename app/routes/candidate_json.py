"""A candidate as JSON, the same for the command line and the API."""

from typing import Any

import msgspec

from app.i18n.reasons import rendering as reasons
from rsi_reviews.candidate_queries import CandidateQueries
from rsi_reviews.clause_reasons import clause_reason
from rsi_reviews.projections import Review
from rsi_reviews.release_service import ReleaseService


def row(review: Review) -> dict[str, Any]:
    """One line of the list."""
    manifest = review.manifest
    return {
        "candidate": review.candidate,
        "status": review.status,
        "component": manifest.component if manifest else "",
        "metric": manifest.metric if manifest else "",
        "author": manifest.author.name if manifest else "",
        "cycle": review.cycle,
        "configuration": review.configuration,
        "baseline": review.baseline,
    }


def sheet(queries: CandidateQueries | ReleaseService, candidate: str) -> dict[str, Any]:
    """Everything of one candidate that a decision needs; `digest` and `cycle` are what it must name."""
    review = queries.review(candidate)
    return {
        **row(review),
        "digest": review.subject_digest,
        "manifest": msgspec.to_builtins(review.manifest),
        "authors": sorted(review.authors),
        "clauses": [
            msgspec.to_builtins(clause) | reasons.stated("sentence", clause_reason(clause, review))
            for clause in queries.clauses(candidate)
        ],
        "approvals": [approval.actor.name for approval in review.approvals],
        "said": [reasons.stating(record) for record in review.said],
        "canary": [reasons.stating(entry) for entry in review.canary],
        "canary_outcome": queries.canary_outcome(candidate) if review.status == "canary" else "",
        **reasons.stated("reason", review.ended_reason),
    }
