"""What may be asked about a mission's graph, limits and accepted facts while it stands, in the imperative."""

from harness.contracts.actors import Actor, Command
from harness.contracts.ids import ConditionId, Digest, HandoffId, NodeId
from harness.contracts.reasons import Explanation
from harness.contracts.tasks import Constraints, TaskContract
from harness.contracts.values import Name


class ReviseContract(Command, tag=True):
    """A planner's wish for another graph, for the sake of one stage that pays for it. The harness admits or refuses."""

    node_id: NodeId
    contract: TaskContract
    planner: Name
    reason: Explanation


class TightenConstraints(Command, tag=True):
    """A plugin's, planner's or person's further restriction. There is no command that removes one (R172)."""

    layer: Name
    constraints: Constraints
    reason: Explanation


class DisputeCompletion(Command, tag=True):
    """A person disputes an accepted fact, while the mission runs or after it (D21)."""

    condition_id: ConditionId
    actor: Actor
    reason: Name


class WithdrawMission(Command, tag=True):
    """A person takes back a mission that has not begun: it waits for its robot, and nothing of it ever moved."""

    actor: Actor
    reason: Name


class RecordAttestation(Command, tag=True):
    """What a person saw with their own eyes of one condition, at `seen_s` (mission time). Goes with a dispatch."""

    handoff_id: HandoffId
    node_id: NodeId
    condition_id: ConditionId
    actor: Actor
    statement: Name
    seen_s: float
    blob: Digest
