"""Acts on handoffs: everything a person can do with a waiting question."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field

from app.acts import base
from app.i18n.catalogues import N_
from app.views.forms import Wrong
from harness.contracts import commands, handoff_commands
from harness.contracts.configuration import RecoveryAction
from harness.contracts.handoff_events import LONGEST_WAIT_S
from harness.contracts.reasons import because


class LookAgainAct(base.Act):
    """Observe again without motion."""

    becomes = handoff_commands.LookAgain


class ClaimHandoffAct(base.Act):
    """Claim the question for a minute. `claim` is a token of your choice; the same token again extends the claim."""

    becomes = handoff_commands.TakeClaim
    claim: base.Slug


class ReleaseHandoffAct(base.Act):
    """Release your claim, so that somebody else can answer."""

    becomes = handoff_commands.DropClaim
    claim: base.Slug

    def fields(self) -> dict[str, Any]:
        """The reason is the act itself."""
        return {"claim": self.claim, "reason": because("claim_released")}


class ExtendDeadlineAct(base.Act):
    """Extend the deadline because you are on your way: once, as far as the zone allows."""

    becomes = handoff_commands.ExtendDeadline
    reason: base.Reason = N_("on my way")


class ChooseActionAct(base.Act):
    """Propose another action of the recovery ladder instead; it needs an approval of its own digest.

    `wait_s`: how many seconds the start waits after the approval. `speed_cap_mps`: drive this slowly, this once.
    `waiting_place`: go to this place first, stand there for `wait_s`, then go on; it is another plan (`local_replan`).
    """

    becomes = handoff_commands.ChooseAction
    sentences: ClassVar[Mapping[str, str]] = {
        "wait_s": N_("A start waits 0 to 90 seconds."),
        "speed_cap_mps": N_("A speed is a number of metres per second above 0."),
    }
    action: RecoveryAction
    cycle: base.Count
    claim: base.Text = ""
    wait_s: Annotated[float, Field(ge=0, le=LONGEST_WAIT_S)] = 0.0
    speed_cap_mps: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    waiting_place: base.Slug | None = None


class AskColleagueAct(base.Act):
    """Ask the next person now, without waiting for the escalation's time."""

    becomes = handoff_commands.AskColleague
    reason: base.Reason = N_("I would like a colleague to look at it")


class _DecisionAct(base.Act):
    """A decision on exactly what was shown: cycle and digests come from the handoff as it stood on the page."""

    reason: base.Reason
    key: base.Key
    cycle: base.Count
    subject: base.Sha256
    evidence: base.Sha256
    shown: base.Sha256 | None = None
    claim: base.Text = ""


class ApproveHandoffAct(_DecisionAct):
    """Let the shown action start once. Makes nothing satisfied: the stage is verified again afterwards."""

    becomes = commands.ApproveHandoff
    decision: Literal["approve"]

    def fields(self) -> dict[str, Any]:
        """Everything but the word itself."""
        return {name: value for name, value in self if name != "decision"}

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """Where nothing failed the page says why a yes is asked for, and the person may leave it at that."""
        return super().from_form({**typed, "reason": typed.get("reason", "").strip() or typed.get("unsaid", "")})


class RejectHandoffAct(_DecisionAct):
    """Refuse the shown action: the mission ends safely stopped."""

    becomes = commands.RejectHandoff
    decision: Literal["reject"]

    def fields(self) -> dict[str, Any]:
        """A rejection holds whatever the evidence looked like."""
        return {name: value for name, value in self if name not in ("decision", "evidence", "shown")}


class AttestHandoffAct(base.Act):
    """State what you saw of one condition, where the stage's policy allows it. The harness then looks again itself."""

    becomes = commands.AttestHandoff
    condition_id: base.Slug
    statement: base.Reason
    key: base.Key
    cycle: base.Count
    claim: base.Text = ""

    def fields(self) -> dict[str, Any]:
        """The statement stands in the log as the reason."""
        return {"reason" if name == "statement" else name: value for name, value in self}

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """On a page the statement is typed in the field every act has for its reason."""
        return super().from_form({"statement": typed.get("reason", ""), **typed})


class _HolderAct(base.Act):
    """An act of whoever holds the claim."""

    reason: base.Reason
    key: base.Key
    claim: base.Slug


class TakeControlAct(_HolderAct):
    """Take control of the robot from `device`: the deadline pauses as long as the claim is extended."""

    becomes = handoff_commands.TakeControl
    device: base.Slug


class HandBackAct(_HolderAct):
    """Hand the robot back to the harness, which observes again without motion."""

    becomes = handoff_commands.ReturnControl


class CloseHandoffAct(_HolderAct):
    """Keep the robot: the mission ends as handed off."""

    becomes = handoff_commands.CloseQuestion


Decision = Annotated[ApproveHandoffAct | RejectHandoffAct, Field(discriminator="decision")]
DECISIONS: Mapping[str, type[base.Act]] = {"approve": ApproveHandoffAct, "reject": RejectHandoffAct}
ACTS: Mapping[str, type[base.Act]] = {
    "look": LookAgainAct,
    "claim": ClaimHandoffAct,
    "release": ReleaseHandoffAct,
    "on-my-way": ExtendDeadlineAct,
    "choose": ChooseActionAct,
    "ask-colleague": AskColleagueAct,
    "attest": AttestHandoffAct,
    "take-over": TakeControlAct,
    "hand-back": HandBackAct,
    "close": CloseHandoffAct,
}
"""By the word in the address. A decision is one of two acts, named by the button."""


def act_of(word: str, typed: Mapping[str, str]) -> type[base.Act]:
    """The act that a form at this address asks for."""
    return DECISIONS.get(typed.get("decision", ""), ApproveHandoffAct) if word == "decision" else ACTS[word]
