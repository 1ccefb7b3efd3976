"""Acts on handoffs: everything a person may say to a waiting question."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field

from app.acts.base import Act, Count, Key, Reason, Sha256, Slug, Text
from app.i18n.catalogues import N_
from app.views.forms import Wrong
from harness.contracts import commands, handoff_commands
from harness.contracts.configuration import RecoveryAction
from harness.contracts.reasons import because


class LookAgainAct(Act):
    """Observe again without motion."""

    becomes = handoff_commands.LookAgain


class ClaimHandoffAct(Act):
    """Take the question: yours to answer for a minute. `claim` is a token of your making, the same again renews it."""

    becomes = handoff_commands.TakeClaim
    claim: Slug


class ReleaseHandoffAct(Act):
    """Give your claim up: somebody else may answer."""

    becomes = handoff_commands.DropClaim
    claim: Slug

    def fields(self) -> dict[str, Any]:
        """The reason is the act itself."""
        return {"claim": self.claim, "reason": because("claim_released")}


class ExtendDeadlineAct(Act):
    """Let it wait longer because you are on your way: once, as long as the zone allows."""

    becomes = handoff_commands.ExtendDeadline
    reason: Reason = N_("on my way")


class ChooseActionAct(Act):
    """Propose another action of the ladder, on the question as it stood in this cycle."""

    becomes = handoff_commands.ChooseAction
    action: RecoveryAction
    cycle: Count
    claim: Text = ""


class _DecisionAct(Act):
    """A decision on exactly what was shown: cycle and digests come from the handoff as it stood on the page."""

    reason: Reason
    key: Key
    cycle: Count
    subject: Sha256
    evidence: Sha256
    shown: Sha256 | None = None
    claim: Text = ""


class ApproveHandoffAct(_DecisionAct):
    """Let the shown action start once. Makes nothing satisfied: the stage is verified again afterwards."""

    becomes = commands.ApproveHandoff
    decision: Literal["approve"]

    def fields(self) -> dict[str, Any]:
        """Everything but the word itself."""
        return {name: value for name, value in self if name != "decision"}


class RejectHandoffAct(_DecisionAct):
    """Refuse the shown action: the mission ends safely stopped."""

    becomes = commands.RejectHandoff
    decision: Literal["reject"]

    def fields(self) -> dict[str, Any]:
        """A rejection holds whatever the evidence looked like."""
        return {name: value for name, value in self if name not in ("decision", "evidence", "shown")}


class AttestHandoffAct(Act):
    """State what you saw of one condition with your own eyes. It opens one look and satisfies nothing by itself."""

    becomes = commands.AttestHandoff
    condition_id: Slug
    statement: Reason
    key: Key
    cycle: Count
    claim: Text = ""

    def fields(self) -> dict[str, Any]:
        """The statement stands in the log as the reason."""
        return {"reason" if name == "statement" else name: value for name, value in self}

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """On a page the statement is typed in the field every act has for its reason."""
        return super().from_form({"statement": typed.get("reason", ""), **typed})


class _HolderAct(Act):
    """An act of whoever holds the claim."""

    reason: Reason
    key: Key
    claim: Slug


class TakeControlAct(_HolderAct):
    """Drive the robot yourself from `device`: the deadline pauses as long as the claim is renewed."""

    becomes = handoff_commands.TakeControl
    device: Slug


class HandBackAct(_HolderAct):
    """Give the robot back: the harness looks afresh, without motion."""

    becomes = handoff_commands.ReturnControl


class CloseHandoffAct(_HolderAct):
    """Keep the robot: the mission ends handed off."""

    becomes = handoff_commands.CloseQuestion


Decision = Annotated[ApproveHandoffAct | RejectHandoffAct, Field(discriminator="decision")]
DECISIONS: Mapping[str, type[Act]] = {"approve": ApproveHandoffAct, "reject": RejectHandoffAct}
ACTS: Mapping[str, type[Act]] = {
    "look": LookAgainAct,
    "claim": ClaimHandoffAct,
    "release": ReleaseHandoffAct,
    "on-my-way": ExtendDeadlineAct,
    "choose": ChooseActionAct,
    "attest": AttestHandoffAct,
    "take-over": TakeControlAct,
    "hand-back": HandBackAct,
    "close": CloseHandoffAct,
}
"""By the word in the address. A decision is one of two acts, named by the button."""


def act_of(word: str, typed: Mapping[str, str]) -> type[Act]:
    """The act that a form at this address asks for."""
    return DECISIONS.get(typed.get("decision", ""), ApproveHandoffAct) if word == "decision" else ACTS[word]
