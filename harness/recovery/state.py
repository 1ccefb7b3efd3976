"""Recovery state of a failed node: steps tried, budget left, and whether new observations came in. Pure."""

from harness.contracts.configuration import SPENDING, FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.reasons import Reason, because
from harness.contracts.tasks import RecoveryLimits
from harness.contracts.values import Count, Value
from harness.projections.mission import Mission, Spend, pointless_steps, required_contract

OBSERVING: tuple[RecoveryAction, ...] = ("re_perceive", "adjust_view")
"""Spending actions that run an observing skill, never the node's motion (D24)."""
VERIFY_ONLY: tuple[RecoveryAction, ...] = (*OBSERVING, "verify_again")
"""Actions whose invocation observes without actuation and is judged with the earlier packets (D3)."""


class RecoveryState(Value):
    """A failure and everything that bounds the answer to it. Same for C4 and for the gate.

    `pointless`: steps of the ladder that cannot change what failed.
    """

    failure: FailureClass
    failed_s: float
    spends: tuple[Spend, ...]
    left: dict[RecoveryAction, int]
    left_node: int
    left_mission: int
    news_s: float | None = None
    pointless: tuple[RecoveryAction, ...] = ()

    def tried(self) -> tuple[RecoveryAction, ...]:
        """Steps authorised for this failure class on this node, oldest first; free ones count."""
        return tuple(spend.action for spend in self.spends if spend.failure == self.failure)

    @property
    def news(self) -> bool:
        """Whether a sensor has reported anything since the failure (D25)."""
        return self.news_s is not None and self.news_s > self.failed_s


class LadderStep(Value):
    """The next step, its place on the ladder, and the steps skipped to reach it, each with its reason."""

    action: RecoveryAction
    refused: tuple[Reason, ...] = ()


def standing_of(mission: Mission, node_id: NodeId) -> RecoveryState:
    """The node's recovery state, from the mission's own state. Raises ContractInvalid if it has no open failure."""
    contract, state = required_contract(mission), mission.of(node_id)
    if state.failure is None:
        raise ContractInvalid(because("no_failure_to_recover", node_id=node_id), where=mission.mission_id)
    limits = contract.node(node_id).recovery
    return RecoveryState(
        failure=state.failure.failure,
        failed_s=state.failure.at_s,
        spends=state.spends,
        left=left_of(limits, state.spends),
        left_node=limits.total - state.spent_total,
        left_mission=contract.recovery_total - mission.spent_total,
        news_s=_newest_sensor_s(mission, node_id),
        pointless=pointless_steps(mission, node_id),
    )


def over_budget(mission: Mission, node_id: NodeId, action: RecoveryAction) -> Reason | None:
    """Why no budget pays for this action at this node now, failure or not, its code the rule; None if one does."""
    left_node, left_mission = left_now(mission, node_id)
    state, limits = mission.of(node_id), required_contract(mission).node(node_id).recovery
    standing = RecoveryState(
        failure="violated",
        failed_s=0.0,
        spends=state.spends,
        left=left_of(limits, state.spends),
        left_node=left_node,
        left_mission=left_mission,
    )
    return unaffordable(action, standing)


def left_now(mission: Mission, node_id: NodeId) -> tuple[int, int]:
    """What is left of the node's total budget and of the mission's, never below zero."""
    contract, state = required_contract(mission), mission.of(node_id)
    left_node = contract.node(node_id).recovery.total - state.spent_total
    return max(0, left_node), max(0, contract.recovery_total - mission.spent_total)


def left_of(limits: RecoveryLimits, spends: tuple[Spend, ...]) -> dict[RecoveryAction, int]:
    """What is left of each spending action's own counter (R127); never below zero."""
    given: dict[RecoveryAction, Count] = {action: getattr(limits, action) for action in SPENDING}
    return {
        action: max(0, count - sum(spend.cost for spend in spends if spend.action == action))
        for action, count in given.items()
    }


def cost_of(action: RecoveryAction) -> int:
    """1 for a spending action; waiting, reattaching, verifying again, stopping and people cost nothing (D24)."""
    return 1 if action in SPENDING else 0


def unaffordable(action: RecoveryAction, standing: RecoveryState) -> Reason | None:
    """Why no budget pays for this action, its code the rule; None if it is free or paid for (R127, R132)."""
    if cost_of(action) == 0:
        return None
    if standing.left_mission < 1:
        return because("over_mission_budget")
    if standing.left_node < 1:
        return because("over_node_budget")
    if standing.left.get(action, 0) < 1:
        return because("over_action_budget", action=action)
    return None


def repeated(
    action: RecoveryAction, standing: RecoveryState, *, provider_id: ProviderId | None = None
) -> Reason | None:
    """Why this action would repeat a failure with no new observation (D25), or None. Free actions may repeat."""
    if cost_of(action) == 0 or standing.news:
        return None
    same = [spend for spend in standing.spends if (spend.action, spend.failure) == (action, standing.failure)]
    doers = {spend.signature.provider_id for spend in same if spend.signature}
    another = provider_id is not None and bool(doers) and provider_id not in doers
    if not same or another:
        return None
    return because("repeats_without_news", action=action, failure=standing.failure)


def pointless(action: RecoveryAction, standing: RecoveryState) -> Reason | None:
    """Why this action cannot change what failed, or None (D49)."""
    if action not in standing.pointless:
        return None
    return because("look_changes_nothing") if action in OBSERVING else because("route_frees_nothing")


def ladder_of(failure: FailureClass, policy: RecoveryPolicy) -> tuple[RecoveryAction, ...]:
    """The ordered ladder of this failure class; a class without one goes to a person at once."""
    return policy.ladders.get(failure, ("human",))


def climbed(ladder: tuple[RecoveryAction, ...], tried: tuple[RecoveryAction, ...]) -> int:
    """How many steps are done: the place after the last one that was authorised."""
    place = 0
    for action in tried:
        if action in ladder[place:]:
            place = ladder.index(action, place) + 1
    return place


def _newest_sensor_s(mission: Mission, node_id: NodeId) -> float | None:
    after = (reference for packet in mission.of(node_id).packets for reference in packet.after)
    times = [reference.until_s for reference in (*mission.observed, *after) if reference.origin == "sensor"]
    return max(times, default=None)
