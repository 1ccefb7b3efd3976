"""Shapes the proposals that a rule refused: a list beside the candidates, and a page for each."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.i18n.messages import reasoned
from app.views.shell import Shell
from rsi_reviews.contracts import RestrictionViolation
from rsi_reviews.difference import CandidateDifference
from rsi_reviews.refused_proposals import ProposalRefused


@dataclass(frozen=True)
class RefusedRow:
    """One refused proposal with its first reason; `more` rules were broken beside it."""

    refused: ProposalRefused
    reason: str
    more: int


@dataclass(frozen=True)
class RefusedPage:
    """`stale`: what it was made from is no longer current, so a draft of it begins from what is."""

    shell: Shell
    refused: ProposalRefused
    broken: tuple[RestrictionViolation, ...]
    changes: CandidateDifference
    stale: bool


def refused_rows(found: Sequence[ProposalRefused], words: str) -> tuple[RefusedRow, ...]:
    """Those that hold every word that is searched for."""
    terms = words.lower().split()
    return tuple(
        RefusedRow(refused=one, reason=reasoned(one.violations[0].reason), more=len(one.violations) - 1)
        for one in found
        if all(each in _text(one) for each in terms)
    )


def refused_page(shell: Shell, refused: ProposalRefused, changes: CandidateDifference, *, current: str) -> RefusedPage:
    return RefusedPage(
        shell=shell,
        refused=refused,
        broken=refused.violations,
        changes=changes,
        stale=refused.manifest.baseline != current,
    )


def _text(one: ProposalRefused) -> str:
    return f"{one.candidate} {one.manifest.reason} {one.manifest.intended_effect} {one.actor.name}".lower()
