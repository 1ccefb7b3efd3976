"""What is asked at a handoff beside its decision: whose question it is, how long it waits, who has control."""

from typing import Literal

from harness.contracts.actors import Actor, Command
from harness.contracts.configuration import RecoveryAction
from harness.contracts.handoff_events import EscalationLevel, NoAnswer, Snapshot
from harness.contracts.ids import ConditionId, Digest, HandoffId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name

# asked of the gate, by the desk ---------------------------------------------------------------------------------------


class TakeClaim(Command, tag=True):
    """Mine to answer for a minute; the same token again renews it. `claim` is made by the claimant's page."""

    actor: Actor
    claim: Name


class DropClaim(Command, tag=True):
    """Given up by its holder, or by the clock (channel timeout) once it lapsed."""

    actor: Actor
    claim: Name
    reason: Explanation


class ExtendDeadline(Command, tag=True):
    """ "On my way": once, within the zone's limit."""

    actor: Actor
    reason: Name


class Escalate(Command, tag=True):
    """Nobody has claimed it for so long: the level that is due now."""

    level: EscalationLevel


class TakeControl(Command, tag=True):
    """A person drives the robot from `device`: the deadline pauses, and a claim must stay alive."""

    actor: Actor
    claim: Name
    device: Name
    key: Name
    reason: Name


class ReturnControl(Command, tag=True):
    """Handed back, with what was seen afresh. `k` is the state version it was seen at."""

    actor: Actor
    claim: Name
    key: Name
    reason: Name
    k: Count
    fresh: Snapshot


class CloseQuestion(Command, tag=True):
    """Closed without handing back: the mission ends handed off."""

    actor: Actor
    claim: Name
    key: Name
    reason: Name


class VoidApproval(Command, tag=True):
    """Something changed between the decision and the dispatch: nothing is sent (D28)."""

    reason: Explanation


class RecordNoAnswer(Command, tag=True):
    """What the robot really did because nobody answered, and what shows it."""

    action: NoAnswer
    done: bool
    measured: dict[str, float]
    reason: Explanation


HandoffTurn = (
    TakeClaim
    | DropClaim
    | ExtendDeadline
    | Escalate
    | TakeControl
    | ReturnControl
    | CloseQuestion
    | VoidApproval
    | RecordNoAnswer
)

# asked by a person ----------------------------------------------------------------------------------------------------


class DecideHandoff(Command, tag=True):
    """A person's answer at a handoff, on exactly what they saw. The supervisor observes again before it counts."""

    handoff_id: HandoffId
    decision: Literal["approve", "reject"]
    actor: Actor
    reason: Name
    key: Name
    cycle: Count
    subject: Digest
    evidence: Digest
    shown: Digest | None = None
    claim: str = ""


class LookAgain(Command, tag=True):
    """Observe without motion and show the handoff as it is now."""

    handoff_id: HandoffId
    actor: Actor


class AttestCondition(Command, tag=True):
    """A person says what they saw of one condition at a handoff; the supervisor then looks without motion (D17)."""

    handoff_id: HandoffId
    condition_id: ConditionId
    actor: Actor
    statement: Name
    key: Name
    cycle: Count
    claim: str = ""


class ClaimHandoff(Command, tag=True):
    """I answer this one. Others see it and cannot decide while the claim lives."""

    handoff_id: HandoffId
    actor: Actor
    claim: Name


class ReleaseHandoff(Command, tag=True):
    """Somebody else may answer after all."""

    handoff_id: HandoffId
    actor: Actor
    claim: Name


class OnMyWay(Command, tag=True):
    """I am walking there: wait longer, once, as long as the zone allows."""

    handoff_id: HandoffId
    actor: Actor
    reason: Name


class ChooseAction(Command, tag=True):
    """Propose another action of the ladder instead: a new cycle, approved on its own digest."""

    handoff_id: HandoffId
    actor: Actor
    action: RecoveryAction
    cycle: Count
    claim: str = ""


class TakeOver(Command, tag=True):
    """I drive it myself from this device."""

    handoff_id: HandoffId
    actor: Actor
    claim: Name
    device: Name
    key: Name
    reason: Name


class HandBack(Command, tag=True):
    """The robot is the harness's again; it looks, without motion, at what it finds."""

    handoff_id: HandoffId
    actor: Actor
    claim: Name
    key: Name
    reason: Name


class CloseHandoff(Command, tag=True):
    """I keep it: the mission ends here."""

    handoff_id: HandoffId
    actor: Actor
    claim: Name
    key: Name
    reason: Name


PersonCommand = (
    DecideHandoff
    | LookAgain
    | AttestCondition
    | ClaimHandoff
    | ReleaseHandoff
    | OnMyWay
    | ChooseAction
    | TakeOver
    | HandBack
    | CloseHandoff
)
