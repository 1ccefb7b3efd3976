"""The review desk as people reach it: every word is checked, signed with who asks, and put in the trail."""

from typing import Any

import msgspec

from app.guard import VISITOR, Trail
from app.permissions import NotPermitted, Permission, Visitor
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, MissionId, RobotId, StreamId
from harness.contracts.ports import Record
from harness.runtime import Runtime
from rsi_reviews.contracts import ReleasePolicy
from rsi_reviews.desk import Desk, Say, Seen
from rsi_reviews.growth import GROWTH

WORDS: dict[str, Permission] = {
    "ProposeCandidate": "propose",
    "OpenReview": "propose",
    "RecallReview": "propose",
    "AddComment": "propose",
    "WithdrawCandidate": "propose",
    "RequestChanges": "review",
    "ApproveCandidate": "review",
    "RejectCandidate": "review",
    "AdjudicateCanaryMission": "review",
    "AuthoriseRelease": "release",
    "BeginCanary": "release",
    "RollBack": "release",
    "SavePolicy": "people",
    "AddCase": "dispute",
}
"""What a person's word at the desk needs, by its name. Whose own candidate it is, the desk itself asks."""


class GuardedDesk(Desk):
    """The same desk, with every word in the name and the one role of the visitor who gives it.

    What the desk does by its own rule (a canary that ends, a rollback that pauses missions) stays the desk's.
    """

    def __init__(self, runtime: Runtime, trail: Trail) -> None:
        super().__init__(runtime)
        self._trail = trail

    def release(self, candidate: Digest, say: Say, seen: Seen, *, robot_id: RobotId) -> Accepted[Any] | Refused:
        """Raises NotPermitted before an authorisation that is over is marked so."""
        _allowed("BeginCanary")
        return super().release(candidate, say, seen, robot_id=robot_id)

    def add_case(self, mission_id: MissionId, say: Say) -> Accepted[Any] | Refused:
        actor = _allowed("AddCase")
        decision = super().add_case(mission_id, Say(actor=actor, reason=say.reason, key=say.key))
        self._told("AddCase", actor, GROWTH, decision)
        return decision

    def save_policy(
        self, policy: ReleasePolicy, say: Say, *, reviewers: tuple[str, ...], releasers: tuple[str, ...]
    ) -> Accepted[Any] | Refused:
        actor = _allowed("SavePolicy")
        signed = Say(actor=actor, reason=say.reason, key=say.key)
        decision = super().save_policy(policy, signed, reviewers=reviewers, releasers=releasers)
        self._told("SavePolicy", actor, "release/pointer", decision)
        return decision

    def _decided(
        self, candidate: Digest, command: Any, others: list[tuple[StreamId, Any]], *records: Record
    ) -> Accepted[Any] | Refused:
        actor, given = _allowed(type(command).__name__), command.actor
        companions = [(stream, _signed(one, given, actor)) for stream, one in others]
        decision = super()._decided(candidate, _signed(command, given, actor), companions, *records)
        self._told(type(command).__name__, actor, f"candidate/{candidate}", decision)
        return decision

    def _told(self, word: str, actor: Actor, subject: str, decision: Accepted[Any] | Refused) -> None:
        outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
        self._trail(_visitor(), actor, word, subject, outcome)


def _signed(command: Any, given: Actor, actor: Actor) -> Any:
    """In the visitor's name, if it was asked in the name that came with the word; the desk's own stays its own."""
    return msgspec.structs.replace(command, actor=actor) if getattr(command, "actor", None) == given else command


def _allowed(word: str) -> Actor:
    """The visitor in the role that allows it. Raises NotPermitted."""
    permission = WORDS.get(word)
    if permission is None:
        raise NotPermitted(f"{word} is the evaluator's or the desk's own", do="ask for what you want decided")
    return _visitor().acting(permission)


def _visitor() -> Visitor:
    try:
        return VISITOR.get()
    except LookupError:
        raise NotPermitted("Nobody is known to ask for this", do="sign in, or use a token") from None
