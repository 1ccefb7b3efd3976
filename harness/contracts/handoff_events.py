"""Events of a handoff, in the past tense, and exactly what a person is shown and decides on."""

from typing import Literal

from msgspec import UNSET, UnsetType

from harness.contracts import ids
from harness.contracts.actors import Actor, Event
from harness.contracts.capabilities import Risk
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.places import Otherwise
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, Name, Value

NoAnswer = Literal["hold", "lie_down", "retreat"]
EscalationLevel = Literal["sound", "next_person", "outside"]
LONGEST_WAIT_S = 90.0
"""How long an approved start may wait, mission time: less than an approval holds (D28)."""
SLOWEST_MPS = 0.1
"""No start is approved for a slower drive than this."""


class ProposedAction(Value):
    """Exactly what an approval would let run, once. Its canonical bytes are what the person sees and digests.

    `wait_s`: how long the start waits after the approval; with a `waiting_place`, how long the robot then stands there
    before it goes on. `plan`: the record of the revised plan that the start belongs to; approving takes both, or
    neither.
    """

    mission_id: ids.MissionId
    node_id: ids.NodeId
    attempt: Count
    action: RecoveryAction
    provider_id: ids.ProviderId
    provider_version: str
    parameters: Parameters
    configuration: ids.Digest
    graph_revision: Count
    limits: dict[str, float]
    spends: Count
    wait_s: float | UnsetType = UNSET
    plan: ids.Digest | UnsetType = UNSET
    waiting_place: ids.PlaceId | UnsetType = UNSET


class Snapshot(Value):
    """The robot's state when the person looked; bound into the approval (D28)."""

    at_s: float
    taken_at_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    static: bool
    results: ids.Digest
    image: ids.Digest | None


class HandoffOpened(Event, tag=True):
    """A handoff was opened. `limit_at_s`: how far the deadline can be extended; None in logs without extensions.

    `choices`: which other steps of the ladder could be proposed instead; `waiting_places`: where the robot could wait
    out of the way before it goes on. `safe_place`: the name of the place a retreat
    would go to, and `otherwise` what the robot does where it cannot go there; both empty without one.
    """

    handoff_id: ids.HandoffId
    mission_id: ids.MissionId
    robot_id: ids.RobotId
    node_id: ids.NodeId
    k: Count
    cycle: Count
    failure: FailureClass
    reason: Explanation
    risk: Risk
    proposal: ProposedAction | None
    subject: ids.Digest
    snapshot: Snapshot
    evidence: ids.Digest
    no_answer: NoAnswer
    opened_at_s: float
    deadline_at_s: float
    limit_at_s: float | None = None
    choices: tuple[RecoveryAction, ...] = ()
    safe_place: str = ""
    otherwise: Otherwise | Literal[""] = ""
    waiting_places: tuple[ids.PlaceId, ...] = ()


class HandoffRefreshed(Event, tag=True):
    """The robot was observed again (cycle+1): a new snapshot and the current proposal; `actor` asked for it."""

    cycle: Count
    k: Count
    proposal: ProposedAction | None
    subject: ids.Digest
    snapshot: Snapshot
    evidence: ids.Digest
    choices: tuple[RecoveryAction, ...] = ()
    actor: Actor | None = None
    waiting_places: tuple[ids.PlaceId, ...] = ()


class HandoffClaimed(Event, tag=True):
    """This person answers the handoff, until `until_at_s`; a renewal has the same token."""

    actor: Actor
    claim: Name
    at_s: float
    until_at_s: float


class HandoffReleased(Event, tag=True):
    """The claim was given up or lapsed (channel timeout). `deadline_at_s` is the deadline that runs on."""

    actor: Actor
    reason: Explanation
    at_s: float
    deadline_at_s: float


class HandoffExtended(Event, tag=True):
    """The deadline was extended ("On my way"); possible once."""

    actor: Actor
    reason: str
    at_s: float
    deadline_at_s: float


class HandoffEscalated(Event, tag=True):
    """Still unclaimed: a sound at once, the next person after a minute, an external channel after three (D27).

    `actor` asked a colleague before it was due; none where time did.
    """

    level: EscalationLevel
    at_s: float
    actor: Actor | None = None


class HandoffTakenOver(Event, tag=True):
    """A person took control of the robot from `device`. The deadline pauses with `left_s` left."""

    actor: Actor
    claim: Name
    device: str
    reason: str
    key: Name
    left_s: float
    at_s: float


class HandoffHandedBack(Event, tag=True):
    """The harness has control of the robot again, as `fresh` shows it; one look without motion follows."""

    actor: Actor
    reason: str
    key: Name
    k: Count
    fresh: Snapshot
    at_s: float


class HandoffClosed(Event, tag=True):
    """A person keeps control of the robot: the mission ends handed off."""

    actor: Actor
    reason: str
    key: Name
    at_s: float


class HandoffApproved(Event, tag=True):
    """The handoff was approved. `fresh`: the observation at that moment, compared with what the person saw; `shown`:
    the displayed bytes."""

    actor: Actor
    reason: str
    key: Name
    cycle: Count
    subject: ids.Digest
    evidence: ids.Digest
    at_s: float
    fresh: Snapshot | None = None
    shown: ids.Digest | None = None


class HandoffRejected(Event, tag=True):
    actor: Actor
    reason: str
    key: Name
    cycle: Count
    subject: ids.Digest
    at_s: float


class HandoffAttested(Event, tag=True):
    """A person attested one condition. It lets one look without motion happen; it satisfies nothing."""

    actor: Actor
    reason: str
    key: Name
    cycle: Count
    condition_id: ids.ConditionId
    at_s: float


class HandoffVoided(Event, tag=True):
    """The approval was void before its dispatch: something it was bound to changed. Nothing was sent."""

    reason: Explanation
    at_s: float


class HandoffExpired(Event, tag=True):
    at_s: float


class NoAnswerTaken(Event, tag=True):
    """What the robot did because nobody answered; `done` only where `measured` or its own report shows it."""

    action: NoAnswer
    done: bool
    measured: dict[str, float]
    reason: Reason
    at_s: float


class HandoffSuperseded(Event, tag=True):
    reason: Explanation


class HandoffDispatched(Event, tag=True):
    invocation_id: ids.InvocationId


class HandoffEffectObserved(Event, tag=True):
    """The result of the one dispatch: confirmed by the gate, failed, or unknown. Never assumed."""

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
