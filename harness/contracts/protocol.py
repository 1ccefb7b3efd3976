"""The provider protocol: the messages between supervisor and provider, on any transport.

Start is idempotent by `request_id`. Motion needs a keepalive at least every second; without one for 2 s the provider
stops by itself and reports `blocked` with the failure `keepalive_lost` (D12). A request with a fencing token older than
the newest that the provider has seen for the resource is refused. From version 1.1 on a request names the effects that
it is for, and a report proposes the facts that the provider believes it established (D52). From 1.2 on a robot may
also say what its own stack was given to do and how that ended, for a harness that only observes it.
"""

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, UnsetType

from harness.contracts import ids
from harness.contracts.effects import AnyEffect
from harness.contracts.observations import AnySample, Camera
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, MissionTime, Name, Point, Value

PROTOCOL = "1.1"
"""The version of the provider protocol that this release's providers speak; a card that names none speaks 1.0."""
STACK_PROTOCOL = "1.2"
"""The version of the whole protocol: with `GET /stack/goals`, which no provider's card depends on."""
PROPOSES_FROM = (1, 1)
MOST_PROPOSED = 64

ParameterValue = float | str | bool | tuple[float | str | Point, ...]
Parameters = dict[str, ParameterValue]
"""Numbers, names, flags; a point is two numbers, a route a tuple of points, a list of digests a tuple of names."""

InvocationStatus = Literal[
    "accepted", "queued", "running", "blocked", "succeeded", "failed", "cancelled", "stopping", "outcome_unknown"
]
KEEPALIVE_LOST = "keepalive_lost"
DRIVE_DEAD_MAN_S = 0.8
"""A teleoperated robot brakes by itself this long after the last order, by its own clock."""
TERMINAL: frozenset[str] = frozenset({"succeeded", "failed", "cancelled"})


class Receipt(Value):
    """A service's or controller's word for one finished act: declared, never measured."""

    receipt_id: Name
    kind: Literal[
        "rotation",
        "capture",
        "analysis",
        "delivery",
        "playback",
        "arrival",
        "disarm",
        "transcript",
        "keeping",
        "plan",
    ]
    at_s: float
    source: Name
    request_id: ids.RequestId
    text: str = ""
    blob: ids.Digest | None = None
    values: dict[str, float] = msgspec.field(default_factory=dict)


class InvocationIdentity(Value):
    """Whose report this is. The provider echoes it; the gate compares it (R94)."""

    mission_id: ids.MissionId
    node_id: ids.NodeId
    attempt: Count
    request_id: ids.RequestId
    provider_id: ids.ProviderId


class IntendedEffect(Value):
    """One effect that an invocation is to bring about, and the condition of the contract that states it (R22)."""

    condition_id: ids.ConditionId
    effect: AnyEffect


class ProposedFact(Value):
    """What a provider proposes to become a committed fact; nothing applies it by itself (R33, R98).

    `name` is the predicate of an intended effect. An argument that the effect has too must equal it, or the proposal
    is about something else; others (distances, digests of images) are the provider's own figures.
    """

    name: Name
    arguments: Annotated[Parameters, msgspec.Meta(max_length=MOST_PROPOSED)]


ProposedFacts = Annotated[tuple[ProposedFact, ...], msgspec.Meta(max_length=MOST_PROPOSED)]


class StartRequest(Value):
    """One invocation request. `deadline_s` is mission time; `fencing` maps each leased resource to its token.

    `intended` is absent where the provider's card names no protocol version, and where nothing is to be accepted.
    """

    identity: InvocationIdentity
    capability: Name
    parameters: Parameters
    k_ctx: Count
    configuration: ids.Digest
    deadline_s: float
    fencing: dict[str, int]
    blobs: tuple[ids.Digest, ...] = ()
    intended: tuple[IntendedEffect, ...] | UnsetType = UNSET


class Progress(Value):
    """Structured progress of a running invocation; metres and shares where they apply."""

    share: float
    text: Explanation = ""
    remaining_m: float | None = None


class InvocationReport(Value):
    """What a provider says of an invocation now. `declared` is its own word for the result, by name.

    `message` says the same to people: a reason by code, or text that is shown unchanged.
    `proposed_facts` come with the last report: what the provider believes to be true now. None is a proposal too.
    """

    handle: Name
    identity: InvocationIdentity
    status: InvocationStatus
    at_s: float
    progress: Progress
    failure: str = ""
    message: Explanation = ""
    declared: dict[str, float] = msgspec.field(default_factory=dict)
    receipts: tuple[Receipt, ...] = ()
    samples: tuple[int, ...] = ()
    blobs: tuple[ids.Digest, ...] = ()
    proposed_facts: ProposedFacts = ()


BodyPosture = Literal["standing", "lying", "moving", "fallen"]
"""What a robot says of its own body; a fallen one neither stands nor lies down by order."""


class RobotStatus(Value):
    """The robot's condition, for people and preconditions: all of it declared by the robot.

    `pose_age_s` is how old the robot's newest pose is by its own clock, None if it has none. `driven_by` names the
    session in which a person drives it by hand, if one does.
    """

    robot_id: Name
    at_s: MissionTime
    posture: BodyPosture
    armed: bool
    hardware_stop: bool
    charge: float
    localised: bool
    map_version: str
    camera: Camera | None = None
    pose_age_s: float | None = None
    driven_by: str = ""


class Picture(Value):
    """The current picture of the robot's camera, for people: not evidence. `at_s` is the mission time of the
    shutter."""

    at_s: float
    width_px: Count
    height_px: Count
    body: bytes
    media_type: Name = "image/jpeg"


class DriveOrder(Value):
    """One teleoperation order: the velocity to hold until the next order, for DRIVE_DEAD_MAN_S at most.

    `session` is who drives, `token` the fencing token of the base. The robot caps both velocities.
    """

    session: ids.RequestId
    token: Count
    v_mps: float = 0.0
    w_radps: float = 0.0
    until_s: float = 0.0


class DriveReport(Value):
    """The robot's answer to a drive order: whether it may move, and what it does. Declared by the robot."""

    session: ids.RequestId
    at_s: float
    status: Literal["driving", "standing", "ended"]
    v_mps: float = 0.0
    w_radps: float = 0.0
    reason: Explanation = ""


class PostureOrder(Value):
    """Lie down, or stand up again; the robot stands still first. `token`: the fencing token of the base."""

    posture: Literal["standing", "lying"]
    token: Count


class Observations(Value):
    """Samples after a sequence number, oldest first, at most `limit`. `next_seq` is where to go on."""

    samples: tuple[AnySample, ...]
    next_seq: int
    at_s: float


StackGoalStatus = Literal["active", "succeeded", "failed", "cancelled", "unknown"]
"""`unknown`: it is over, and the stack itself cannot say how it ended."""
GoalId = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
StackRun = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.:-]{1,80}$")]
MOST_CHANGES = 1000


class StackGoal(Value):
    """One change of a goal that the robot's own stack was given: declared by that stack, never measured.

    `seq` rises by one with each change since the stack started. `at_s` is the robot's own time of the change; of a goal
    that ended, when the stack said so. `target_m` counts in `frame` and says nothing without it; `map_version` is empty
    where the stack does not know it.
    """

    seq: Count
    goal_id: GoalId
    at_s: float
    status: StackGoalStatus
    target_m: Point | None = None
    frame: Annotated[str, msgspec.Meta(max_length=200)] = ""
    map_version: Annotated[str, msgspec.Meta(max_length=200)] = ""
    text: Annotated[str, msgspec.Meta(max_length=500)] = ""

    @property
    def ended(self) -> bool:
        """Whether the stack says that it is over."""
        return self.status != "active"


class StackGoals(Value):
    """Changes after a sequence number, oldest first. `run` names this start of the stack: after another one `seq`
    begins anew, and whatever was under way is not known to have ended.
    """

    stack: Name
    run: StackRun
    changes: Annotated[tuple[StackGoal, ...], msgspec.Meta(max_length=MOST_CHANGES)]
    next_seq: Count
    at_s: float


class PhysicalStart(Value):
    """One line of the robot's start journal: the only place where physical starts are counted (D10)."""

    request_id: ids.RequestId
    mission_id: ids.MissionId
    node_id: ids.NodeId
    attempt: Count
    provider_id: ids.ProviderId
    at_s: float
    moves: bool


def physical_start(identity: InvocationIdentity, *, at_s: float, moves: bool) -> PhysicalStart:
    """The line of the start journal for one request."""
    return PhysicalStart(**msgspec.structs.asdict(identity), at_s=at_s, moves=moves)


def version_of(protocol: str | UnsetType) -> str:
    """The protocol version of a card; one that names none speaks 1.0."""
    return "1.0" if protocol is UNSET else protocol


def proposes_facts(version: str | UnsetType) -> bool:
    """Whether a provider of this protocol version can propose facts; one that names no version cannot."""
    return version is not UNSET and tuple(map(int, version.split("."))) >= PROPOSES_FROM
