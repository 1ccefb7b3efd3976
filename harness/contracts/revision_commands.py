"""Commands that change a mission's graph, limits or accepted facts."""

from harness.contracts.actors import Actor, Command
from harness.contracts.ids import ConditionId, Digest, HandoffId, NodeId
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.tasks import Constraints, TaskContract
from harness.contracts.values import Name, Value


class ReviseContract(Command, tag=True):
    """A planner's request for another graph, paid for by one stage. The harness admits or refuses it."""

    node_id: NodeId
    contract: TaskContract
    planner: Name
    reason: Explanation


class ReviseToRecover(Command, tag=True):
    """A recovery step that changes what failed: another route, or a view from elsewhere. It is paid for as proposed.

    `reopened` stages begin again, since what they saw is to be seen anew; `context` is the C4 it was proposed from.
    """

    node_id: NodeId
    contract: TaskContract
    reopened: tuple[NodeId, ...]
    proposal: RecoveryProposal
    signature: Signature
    context: Digest
    planner: Name
    reason: Explanation


class RevisedPlan(Value):
    """Another plan that a person may approve with the first start on it. `node_id` is the stage that pays for it."""

    node_id: NodeId
    contract: TaskContract
    reopened: tuple[NodeId, ...]
    planner: Name
    reason: Explanation


class PassOverStep(Command, tag=True):
    """A recovery step that can change nothing here is paid for as proposed, and the failure stands again with `reason`.

    `context` is the C4 it was proposed from; `at_s` is mission time.
    """

    node_id: NodeId
    proposal: RecoveryProposal
    signature: Signature
    context: Digest
    reason: Reason
    at_s: float


class TightenConstraints(Command, tag=True):
    """A plugin's, planner's or person's further restriction. There is no command that removes one (R172)."""

    layer: Name
    constraints: Constraints
    reason: Explanation


class DisputeCompletion(Command, tag=True):
    """A person disputes an accepted fact, during or after the mission (D21)."""

    condition_id: ConditionId
    actor: Actor
    reason: Name


class WithdrawMission(Command, tag=True):
    """A person withdraws a mission that has not begun: it waits for its robot, and nothing was dispatched."""

    actor: Actor
    reason: Name


class RecordAttestation(Command, tag=True):
    """A person's own observation of one condition, at `seen_s` (mission time). Committed with a dispatch."""

    handoff_id: HandoffId
    node_id: NodeId
    condition_id: ConditionId
    actor: Actor
    statement: Name
    seen_s: float
    blob: Digest
