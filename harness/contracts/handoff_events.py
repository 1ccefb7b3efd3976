"""What happens at a handoff, in the past tense, and exactly what a person is shown and decides on."""

from typing import Literal

from harness.contracts.actors import Actor, Event
from harness.contracts.capabilities import Risk
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.ids import ConditionId, Digest, HandoffId, InvocationId, MissionId, NodeId, ProviderId, RobotId
from harness.contracts.places import Otherwise
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, Name, Value

NoAnswer = Literal["hold", "lie_down", "retreat"]
EscalationLevel = Literal["sound", "next_person", "outside"]


class ProposedAction(Value):
    """Exactly what an approval would let run, once. Its canonical bytes are what the person sees and digests."""

    mission_id: MissionId
    node_id: NodeId
    attempt: Count
    action: RecoveryAction
    provider_id: ProviderId
    provider_version: str
    parameters: Parameters
    configuration: Digest
    graph_revision: Count
    limits: dict[str, float]
    spends: Count


class Snapshot(Value):
    """What the robot looked like when the person looked: bound into the approval (D28)."""

    at_s: float
    taken_at_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    static: bool
    results: Digest
    image: Digest | None


class HandoffOpened(Event, tag=True):
    """`limit_at_s`: how far "on my way" can move the deadline; None in logs that know no extension.

    `choices`: what else of the ladder could be proposed instead. `safe_place`: where a retreat would go, by its name,
    and `otherwise` what the robot does where it cannot go there; both empty without one.
    """

    handoff_id: HandoffId
    mission_id: MissionId
    robot_id: RobotId
    node_id: NodeId
    k: Count
    cycle: Count
    failure: FailureClass
    reason: Explanation
    risk: Risk
    proposal: ProposedAction | None
    subject: Digest
    snapshot: Snapshot
    evidence: Digest
    no_answer: NoAnswer
    opened_at_s: float
    deadline_at_s: float
    limit_at_s: float | None = None
    choices: tuple[RecoveryAction, ...] = ()
    safe_place: str = ""
    otherwise: Otherwise | Literal[""] = ""


class HandoffRefreshed(Event, tag=True):
    """Observed again (cycle+1): a new snapshot, and the proposal as it would run now; `actor` asked for it."""

    cycle: Count
    k: Count
    proposal: ProposedAction | None
    subject: Digest
    snapshot: Snapshot
    evidence: Digest
    choices: tuple[RecoveryAction, ...] = ()
    actor: Actor | None = None


class HandoffClaimed(Event, tag=True):
    """This person answers it, until `until_at_s`; a renewal is the same token again."""

    actor: Actor
    claim: Name
    at_s: float
    until_at_s: float


class HandoffReleased(Event, tag=True):
    """The claim is gone: given up, or lapsed (channel timeout). `deadline_at_s`: the one that runs on."""

    actor: Actor
    reason: Explanation
    at_s: float
    deadline_at_s: float


class HandoffExtended(Event, tag=True):
    """ "On my way": the one extension."""

    actor: Actor
    reason: str
    at_s: float
    deadline_at_s: float


class HandoffEscalated(Event, tag=True):
    """Still unclaimed: at once a sound, after a minute the next person, after three a channel outside (D27)."""

    level: EscalationLevel
    at_s: float


class HandoffTakenOver(Event, tag=True):
    """A person drives the robot from `device`. The deadline pauses with `left_s` to go."""

    actor: Actor
    claim: Name
    device: str
    reason: str
    key: Name
    left_s: float
    at_s: float


class HandoffHandedBack(Event, tag=True):
    """The robot is the harness's again, as `fresh` shows it; one look without motion follows."""

    actor: Actor
    reason: str
    key: Name
    k: Count
    fresh: Snapshot
    at_s: float


class HandoffClosed(Event, tag=True):
    """A person keeps the robot: the mission ends handed off."""

    actor: Actor
    reason: str
    key: Name
    at_s: float


class HandoffApproved(Event, tag=True):
    """`fresh`: what was observed at that moment and compared with what was seen; `shown`: the bytes on the screen."""

    actor: Actor
    reason: str
    key: Name
    cycle: Count
    subject: Digest
    evidence: Digest
    at_s: float
    fresh: Snapshot | None = None
    shown: Digest | None = None


class HandoffRejected(Event, tag=True):
    actor: Actor
    reason: str
    key: Name
    cycle: Count
    subject: Digest
    at_s: float


class HandoffAttested(Event, tag=True):
    """A person said what they saw of one condition. It lets one look without motion happen; it satisfies nothing."""

    actor: Actor
    reason: str
    key: Name
    cycle: Count
    condition_id: ConditionId
    at_s: float


class HandoffVoided(Event, tag=True):
    """The approval did not reach its dispatch: something it was bound to changed. Nothing was sent."""

    reason: Explanation
    at_s: float


class HandoffExpired(Event, tag=True):
    at_s: float


class NoAnswerTaken(Event, tag=True):
    """What the robot did because nobody answered; `done` only where `measured` or its own word shows it."""

    action: NoAnswer
    done: bool
    measured: dict[str, float]
    reason: Reason
    at_s: float


class HandoffSuperseded(Event, tag=True):
    reason: Explanation


class HandoffDispatched(Event, tag=True):
    invocation_id: InvocationId


class HandoffEffectObserved(Event, tag=True):
    """What became of the one dispatch: confirmed by the gate, failed, or unknown. Never assumed."""

    outcome: Literal["confirmed", "failed", "unknown"]
    reason: Explanation


HandoffEvent = (
    HandoffOpened
    | HandoffRefreshed
    | HandoffClaimed
    | HandoffReleased
    | HandoffExtended
    | HandoffEscalated
    | HandoffTakenOver
    | HandoffHandedBack
    | HandoffClosed
    | HandoffApproved
    | HandoffRejected
    | HandoffAttested
    | HandoffVoided
    | HandoffExpired
    | NoAnswerTaken
    | HandoffSuperseded
    | HandoffDispatched
    | HandoffEffectObserved
)
