"""Commands at a handoff besides its decision: claims, deadlines, escalation and control of the robot."""

from harness.contracts.actors import Actor, Command
from harness.contracts.configuration import RecoveryAction
from harness.contracts.handoff_events import EscalationLevel, NoAnswer, Snapshot
from harness.contracts.ids import PlaceId
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, Name, NonNegative, Positive

# decided by the gate, sent by the handoff service ---------------------------------------------------------------------


class TakeClaim(Command, tag=True):
    """Claim the question for a minute; the same token again renews it. `claim` is made by the claimant's page."""

    actor: Actor
    claim: Name


class DropClaim(Command, tag=True):
    """Drop a claim: given up by its holder, or lapsed (channel timeout)."""

    actor: Actor
    claim: Name
    reason: Explanation


class ExtendDeadline(Command, tag=True):
    """Extend the deadline ("On my way") once, within the zone's limit."""

    actor: Actor
    reason: Name


class Escalate(Command, tag=True):
    """Escalate an unclaimed question to the level that is due now."""

    level: EscalationLevel


class AskColleague(Command, tag=True):
    """Ask the next person now: the escalation does not wait for its time. A claim stays whose it is."""

    actor: Actor
    reason: Name


class TakeControl(Command, tag=True):
    """Take control of the robot from `device`: the deadline pauses, and a claim must stay alive."""

    actor: Actor
    claim: Name
    device: Name
    key: Name
    reason: Name


class ReturnControl(Command, tag=True):
    """Return control. The harness adds a fresh observation and the state version `k` it was made at."""

    actor: Actor
    claim: Name
    key: Name
    reason: Name
    k: Count | None = None
    fresh: Snapshot | None = None


class CloseQuestion(Command, tag=True):
    """Close the question without handing back: the mission ends handed off."""

    actor: Actor
    claim: Name
    key: Name
    reason: Name


class VoidApproval(Command, tag=True):
    """Void an approval because something changed between decision and dispatch: nothing is sent (D28)."""

    reason: Explanation


class RecordNoAnswer(Command, tag=True):
    """Record what the robot did because nobody answered, and what shows it."""

    action: NoAnswer
    done: bool
    measured: dict[str, float]
    reason: Reason


HandoffTurn = (
    TakeClaim
    | DropClaim
    | ExtendDeadline
    | Escalate
    | AskColleague
    | TakeControl
    | ReturnControl
    | CloseQuestion
    | VoidApproval
    | RecordNoAnswer
)

# sent by a person; the harness observes before the gate decides -------------------------------------------------------


class LookAgain(Command, tag=True):
    """Observe without motion and show the current handoff: becomes a RefreshHandoff with the new observation."""

    actor: Actor


class ChooseAction(Command, tag=True):
    """Propose another action of the ladder instead: becomes a RefreshHandoff, approved on its own digest.

    `wait_s`: how long the start waits after its approval. `speed_cap_mps`: a lower speed limit for this one start.
    `waiting_place`: go to this place first and stand there for `wait_s` instead.
    """

    actor: Actor
    action: RecoveryAction
    cycle: Count
    claim: str = ""
    wait_s: NonNegative = 0.0
    speed_cap_mps: Positive | None = None
    waiting_place: PlaceId | None = None
