"""Pure: what a visitor may say about a candidate now, and why not, told before the click by the desk's own rules."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from app.i18n.catalogues import N_
from app.i18n.messages import reasoned
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.ids import RobotId
from harness.contracts.values import Moment
from rsi_reviews import commands
from rsi_reviews.deciders import decide
from rsi_reviews.pointer_rules import decide as pointing
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import Review

KEY = "asked-before-the-click"


@dataclass(frozen=True)
class OfferedAction:
    """One word: what its button says, whether it counts now, and the desk's sentence where it would not."""

    word: str
    title: str
    why_not: str
    hold: bool
    danger: bool


def offers(review: Review, pointer: Pointer, actor: Actor, *, now_s: float, robot: str) -> tuple[OfferedAction, ...]:
    """The words that the candidate's status asks for, in the order in which they are usually said."""
    now = Moment(mission_s=0.0, wall_s=now_s)
    found = []
    for word, title, hold, danger in _asked(review.status):
        command = _command(word, review, pointer, actor, robot=robot)
        decision: Any = decide(review, command, now)
        if not isinstance(decision, Refused) and (rest := _rests_on(word, review, pointer)) is not None:
            decision = pointing(pointer, rest, now)
        why_not = reasoned(decision.reason) if isinstance(decision, Refused) else ""
        found.append(OfferedAction(word=word, title=title, why_not=why_not, hold=hold, danger=danger))
    return tuple(found)


def _asked(status: str) -> Sequence[tuple[str, str, bool, bool]]:
    """(word, title, press and hold, danger)."""
    match status:
        case "accepted":
            return (("submit", N_("Ask for review"), False, False), ("withdraw", N_("Withdraw"), False, True))
        case "in_review":
            return (
                ("approve", N_("Hold to approve"), True, False),
                ("authorise", N_("Hold to authorise the release"), True, False),
                ("request-changes", N_("Request changes"), False, False),
                ("recall", N_("Withdraw"), False, False),
                ("reject", N_("Reject"), False, True),
            )
        case "authorised":
            return (("release", N_("Hold to release"), True, False), ("withdraw", N_("Withdraw"), False, True))
        case "canary":
            return (("rollback", N_("Roll back"), False, True), ("withdraw", N_("Withdraw"), False, True))
        case "current":
            return (("rollback", N_("Roll back"), False, True),)
        case "draft" | "inconclusive":
            return (("withdraw", N_("Withdraw"), False, True),)
        case _:
            return ()


def _command(word: str, review: Review, pointer: Pointer, actor: Actor, *, robot: str) -> commands.CandidateCommand:
    fields: dict[str, Any] = {"actor": actor, "reason": "asked", "key": KEY}
    seen: dict[str, Any] = {"cycle": review.cycle, "subject": review.subject_digest}
    policy = pointer.policy
    rollback = review.manifest.rollback if review.manifest else review.baseline
    match word:
        case "submit":
            return commands.OpenReview(**fields)
        case "approve":
            return commands.ApproveCandidate(policy=policy, **seen, **fields)
        case "authorise":
            return commands.AuthoriseRelease(policy=policy, rollback=rollback, proven=rollback, **seen, **fields)
        case "request-changes":
            return commands.RequestChanges(**seen, **fields)
        case "recall":
            return commands.RecallReview(**fields)
        case "reject":
            return commands.RejectCandidate(**seen, **fields)
        case "release":
            return commands.BeginCanary(robot_id=RobotId(robot), policy=policy, **seen, **fields)
        case "rollback":
            return commands.RollBack(**fields)
        case _:
            return commands.WithdrawCandidate(**fields)


def _rests_on(word: str, review: Review, pointer: Pointer) -> Any:
    """What the pointer would be asked to confirm with this word; None where it is asked nothing."""
    match word:
        case "submit":
            return commands.Confirm(baseline=review.baseline, configuration=review.configuration)
        case "approve" | "authorise" | "release":
            return commands.Confirm(baseline=review.baseline, policy=pointer.policy, configuration=review.configuration)
        case _:
            return None
