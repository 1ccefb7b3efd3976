"""What happens at a handoff, in the past tense, and exactly what a person is shown and decides on."""

from typing import Literal

from harness.contracts.actors import Actor, Event
from harness.contracts.capabilities import Risk
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.ids import ConditionId, Digest, HandoffId, InvocationId, MissionId, NodeId, ProviderId, RobotId
from harness.contracts.protocol import Parameters
from harness.contracts.values import Count, Name, Value


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
    handoff_id: HandoffId
    mission_id: MissionId
    robot_id: RobotId
    node_id: NodeId
    k: Count
    cycle: Count
    failure: FailureClass
    reason: str
    risk: Risk
    proposal: ProposedAction | None
    subject: Digest
    snapshot: Snapshot
    evidence: Digest
    no_answer: Literal["hold", "lie_down", "retreat"]
    opened_at_s: float
    deadline_at_s: float


class HandoffRefreshed(Event, tag=True):
    """Observed again (cycle+1): a new snapshot, and the proposal as it would run now."""

    cycle: Count
    k: Count
    proposal: ProposedAction | None
    subject: Digest
    snapshot: Snapshot
    evidence: Digest


class HandoffApproved(Event, tag=True):
    actor: Actor
    reason: str
    key: Name
    cycle: Count
    subject: Digest
    evidence: Digest
    at_s: float


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


class HandoffExpired(Event, tag=True):
    at_s: float


class HandoffSuperseded(Event, tag=True):
    reason: str


class HandoffDispatched(Event, tag=True):
    invocation_id: InvocationId


class HandoffEffectObserved(Event, tag=True):
    """What became of the one dispatch: confirmed by the gate, failed, or unknown. Never assumed."""

    outcome: Literal["confirmed", "failed", "unknown"]
    reason: str


HandoffEvent = (
    HandoffOpened
    | HandoffRefreshed
    | HandoffApproved
    | HandoffRejected
    | HandoffAttested
    | HandoffExpired
    | HandoffSuperseded
    | HandoffDispatched
    | HandoffEffectObserved
)
