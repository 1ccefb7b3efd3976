"""Pure: what a visitor may do with a candidate now, and why not, told before the click by the release rules."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.auth.command_permissions import required_permission
from app.auth.permissions import MEANING, OF_ACCOUNTS
from app.i18n.catalogues import N_
from app.i18n.messages import reasoned
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.ids import RobotId
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from rsi_reviews import commands
from rsi_reviews.deciders import decide
from rsi_reviews.pointer_rules import decide as pointing
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import Review

KEY = "asked-before-the-click"


@dataclass(frozen=True)
class OfferedAction:
    """One act: its verb, what its button says, and the sentence of the rule that would refuse it."""

    verb: str
    title: str
    why_not: str
    hold: bool
    danger: bool


@dataclass(frozen=True)
class _Button:
    verb: str
    becomes: type[commands.ReviewCommand]
    title: str
    hold: bool = False
    danger: bool = False


APPROVE = _Button("approve", commands.ApproveCandidate, N_("Hold to approve"), hold=True)
AUTHORISE = _Button("authorise", commands.AuthoriseRelease, N_("Hold to authorise the release"), hold=True)
REJECT = _Button("reject", commands.RejectCandidate, N_("Reject"), danger=True)
RELEASE = _Button("release", commands.BeginCanary, N_("Hold to release"), hold=True)
REQUEST_CHANGES = _Button("request-changes", commands.RequestChanges, N_("Request changes"))
RECALL = _Button("recall", commands.RecallReview, N_("Withdraw"))
ROLL_BACK = _Button("rollback", commands.RollBack, N_("Roll back"), danger=True)
SUBMIT = _Button("submit", commands.OpenReview, N_("Ask for review"))
WITHDRAW = _Button("withdraw", commands.WithdrawCandidate, N_("Withdraw"), danger=True)
BUTTONS: Mapping[str, Sequence[_Button]] = {
    "draft": (WITHDRAW,),
    "inconclusive": (WITHDRAW,),
    "accepted": (SUBMIT, WITHDRAW),
    "in_review": (APPROVE, AUTHORISE, REQUEST_CHANGES, RECALL, REJECT),
    "authorised": (RELEASE, WITHDRAW),
    "canary": (ROLL_BACK, WITHDRAW),
    "current": (ROLL_BACK,),
}
"""By the candidate's status, in the order in which they are usually pressed."""
STILL = (commands.OpenReview, commands.ApproveCandidate, commands.AuthoriseRelease, commands.BeginCanary)
"""What counts only while the pointer stands as the candidate found it."""


def offers(
    review: Review, pointer: Pointer, actor: Actor, *, now_s: float, robot: str, invited: bool = False
) -> tuple[OfferedAction, ...]:
    """The acts that the candidate's status asks for. `invited`: whoever came by the first link and has no account."""
    now = Moment(mission_s=0.0, wall_s=now_s)
    found = []
    for button in BUTTONS.get(review.status, ()):
        decision: Any = decide(review, _command(button.becomes, review, pointer, actor, robot=robot), now)
        if not isinstance(decision, Refused) and button.becomes in STILL:
            policy = None if button.becomes is commands.OpenReview else pointer.policy
            confirm = commands.Confirm(baseline=review.baseline, policy=policy, configuration=review.configuration)
            decision = pointing(pointer, confirm, now)
        why_not = reasoned(decision.reason) if isinstance(decision, Refused) else ""
        needed = required_permission(button.becomes)
        if invited and needed in OF_ACCOUNTS and pointer.policy.kind == "two_person":
            why_not = reasoned(because("account_needed", meaning=MEANING[needed]))
        found.append(OfferedAction(button.verb, button.title, why_not, hold=button.hold, danger=button.danger))
    return tuple(found)


def _command(kind: type[commands.ReviewCommand], review: Review, pointer: Pointer, actor: Actor, *, robot: str) -> Any:
    """The command as the release service would make it of this page."""
    rollback = review.manifest.rollback if review.manifest else review.baseline
    known: dict[str, Any] = {
        "actor": actor,
        "reason": "asked",
        "key": KEY,
        "cycle": review.cycle,
        "subject": review.subject_digest,
        "policy": pointer.policy,
        "rollback": rollback,
        "proven": rollback,
        "robot_id": RobotId(robot),
    }
    return kind(**{name: known[name] for name in kind.__struct_fields__ if name in known})
