"""Pure: the parts of a mission that nothing verified, for everybody who is told how it ended (D17, D47)."""

from typing import Literal

from harness.contracts.ids import ConditionId, NodeId
from harness.contracts.tasks import order
from harness.contracts.values import Value
from harness.projections.mission import Mission, declared_goals

WhyUnverified = Literal["declared", "rests_on_declared", "failed"]


class UnverifiedPart(Value):
    """One part: an effect that only its provider declares, a completion condition that rests on one (no stage), or a
    stage that failed without ending the mission (no condition)."""

    text: str
    why: WhyUnverified
    node_id: NodeId | None = None
    condition_id: ConditionId | None = None


def failed_parts(mission: Mission) -> tuple[UnverifiedPart, ...]:
    """The stages that failed for good, in graph order; whoever is told of the mission is told of them."""
    contract = mission.contract
    if contract is None:
        return ()
    nodes = (contract.node(name) for name in order(contract) if mission.of(name).status == "failed")
    return tuple(UnverifiedPart(text=node.subgoal, why="failed", node_id=node.node_id) for node in nodes)


def unverified_parts(mission: Mission) -> tuple[UnverifiedPart, ...]:
    """What is declared, what rests on that, and what failed; empty where every part was verified, or none was tested
    yet."""
    declared = (
        UnverifiedPart(text=one.text, why="declared", node_id=one.node_id, condition_id=one.condition_id)
        for one in mission.declared
    )
    results = mission.goal_verdict.results if mission.goal_verdict else ()
    undecided = {one.condition_id for one in results if one.verdict == "ambiguous"}
    resting = (
        UnverifiedPart(text=one.text, why="rests_on_declared", condition_id=one.condition_id)
        for one in declared_goals(mission)
        if one.condition_id in undecided
    )
    return (*declared, *resting, *failed_parts(mission))
