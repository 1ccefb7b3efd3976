"""What `regen up --start` puts before people in a new data folder: a really evaluated candidate, in review."""

from typing import Any

from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContractInvalid
from rsi_reviews.desk import Desk, Say
from rsi_reviews.shipped_evaluation import Shipped, shipped_evaluation

STARTING = Actor(name="regen up", role="operator", channel="policy")


def put_in_review(desk: Desk, found: Shipped | None = None) -> None:
    """Propose it, fix its terms, hand in its results, ask for review; the desk judges them itself.

    Nothing happens where anything was proposed before. What the predicate does not accept (any more) is not asked
    about: it stands on the board with the answer. Raises ContractInvalid with the rule of a refusal.
    """
    if desk.pointer().version:
        return
    shipped = found or shipped_evaluation()
    name = shipped.candidate.candidate_id
    plain = "ships with the program"
    _taken(desk.propose(shipped.candidate, _say("propose", plain)))
    _taken(desk.begin(shipped.terms, _say("begin", plain)))
    _taken(desk.submit_results(shipped.judged_on(), _say("results", plain)))
    _taken(desk.comment(name, _say("label", shipped.label)))
    if desk.review(name).status == "accepted":
        _taken(desk.submit(name, _say("submit", "every clause that can be answered before a release passes")))


def _say(word: str, reason: str) -> Say:
    return Say(STARTING, reason, f"shipped:{word}")


def _taken(decision: Accepted[Any] | Refused) -> None:
    if isinstance(decision, Refused):
        raise ContractInvalid(f"{decision.message} ({decision.rule})", where="the candidate that ships")
