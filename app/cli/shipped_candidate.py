"""Puts an evaluated candidate in review into a new data folder, for `regen up --start`."""

from pathlib import Path
from typing import Any

from app.cli import output
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContractInvalid
from rsi_reviews.held_out import Looks
from rsi_reviews.release_service import ReleaseService, SignedBy
from rsi_reviews.shipped_evaluation import ShippedEvaluation, shipped_evaluation

STARTING = Actor(name="regen up", role="operator", channel="policy")


def put_in_review(releases: ReleaseService, folder: Path, found: ShippedEvaluation | None = None) -> None:
    """Propose it, fix its terms, hand in its results, ask for review; the release service judges them itself.

    It was measured against one baseline: where new missions run under another, its results mean nothing and it is not
    shown. Nothing happens where anything was proposed or looked at before. What the predicate does not accept any more
    is listed with that answer, and no review is asked for. `folder` is the evaluator's: looks at the held-out suite
    that were taken for it are counted there, so that the next one has a number and an alpha of its own.
    A candidate that today's rules would not let be proposed is not shown either: they became stricter since it was
    measured. Raises ContractInvalid with the rule of a later refusal.
    """
    if releases.pointer().version or len(Looks(folder)):
        return
    shipped = found or shipped_evaluation()
    if shipped.candidate.manifest.baseline != releases.current() or releases.refusals(shipped.candidate):
        return
    name = shipped.candidate.candidate_id
    plain = "ships with the program"
    _taken(releases.propose(shipped.candidate, _signed("propose", plain)))
    _taken(releases.begin(shipped.terms, _signed("begin", plain)))
    _counted(folder, shipped)
    _taken(releases.submit_results(shipped.judged_on(), _signed("results", plain)))
    _taken(releases.comment(name, _signed("label", shipped.label)))
    if releases.review(name).status == "accepted":
        _taken(releases.submit(name, _signed("submit", "every clause that can be answered before a release passes")))


def _counted(folder: Path, shipped: ShippedEvaluation) -> None:
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    looks = Looks(folder)
    for one in shipped.looks:
        opened = looks.open(one.candidate, one.manifest)
        if one.answer is not None:
            looks.close(opened, one.answer)


def _signed(word: str, reason: str) -> SignedBy:
    return SignedBy(STARTING, reason, f"shipped:{word}")


def _taken(decision: Accepted[Any] | Refused) -> None:
    if isinstance(decision, Refused):
        raise ContractInvalid(output.refusal(decision), where="the candidate that ships")
