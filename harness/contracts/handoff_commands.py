"""What is asked at a handoff beside its decision: whose question it is, how long it waits, who has control."""

from harness.contracts.actors import Actor, Command
from harness.contracts.configuration import RecoveryAction
from harness.contracts.handoff_events import EscalationLevel, NoAnswer, Snapshot
from harness.contracts.reasons import Explanation, Reason
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
    """Handed back by a person. The harness adds what it sees afresh, and the state version `k` it is seen at."""

    actor: Actor
    claim: Name
    key: Name
    reason: Name
    k: Count | None = None
    fresh: Snapshot | None = None


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
    reason: Reason


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

# asked by a person, for the harness to look first ---------------------------------------------------------------------


class LookAgain(Command, tag=True):
    """Observe without motion and show the handoff as it is now: becomes a RefreshHandoff of what was seen."""

    actor: Actor


class ChooseAction(Command, tag=True):
    """Propose another action of the ladder instead: becomes a RefreshHandoff, approved on its own digest."""

    actor: Actor
    action: RecoveryAction
    cycle: Count
    claim: str = ""
