"""Events that change a mission's graph, limits and accepted facts (R4, D21, D29)."""

from typing import Literal

from harness.contracts.actors import Actor, Event
from harness.contracts.configuration import FailureClass
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import ConditionId, HandoffId, NodeId, PacketId
from harness.contracts.reasons import Explanation
from harness.contracts.tasks import Constraints, TaskContract
from harness.contracts.values import Count, Name


class GraphRevised(Event, tag=True):
    """(k+1) The graph was revised; goal, completion conditions and committed history stay (R4, D29).

    `reopened` stages, `responsible` first, begin again; their earlier results are kept as superseded. `contract` is the
    revised one, none if only stages were reopened. It costs `responsible` one local_replan; with cause recovery the
    step in the same commit paid for it.
    """

    revision: Count
    cause: Literal["goal", "planner", "recovery"]
    responsible: NodeId
    reopened: tuple[NodeId, ...]
    reason: Explanation
    failure: FailureClass = "violated"
    condition_id: ConditionId | None = None
    contract: TaskContract | None = None
    proposed_by: str = ""
    left_node: Count = 0
    left_mission: Count = 0


class ConstraintsTightened(Event, tag=True):
    """(k+1) A layer added a restriction; `constraints` are the contract's from now on, the tightest of both (R172)."""

    layer: Name
    reason: Explanation
    constraints: Constraints


class AttestationRecorded(Event, tag=True):
    """(k+1) A person's own observation of one condition: evidence of origin human, never an approval (D17)."""

    handoff_id: HandoffId
    node_id: NodeId
    condition_id: ConditionId
    actor: Actor
    reference: EvidenceReference


class CompletionDisputed(Event, tag=True):
    """(k+1) A person says that an accepted fact is wrong. It counts as a false completion; nothing is deleted (D21).

    `dependents` are the accepted facts of stages that build on it; they are marked, not counted.
    """

    condition_id: ConditionId
    packet_id: PacketId
    node_id: NodeId
    actor: Actor
    reason: str
    dependents: tuple[ConditionId, ...] = ()
