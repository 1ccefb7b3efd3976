"""Shapes recovery budgets as meters: what was spent and what is left, per action, node and mission."""

from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import word
from harness.contracts.configuration import SPENDING
from harness.contracts.ids import NodeId
from harness.projections.mission import Mission, Spend

TOTALS = {"stage": N_("this stage"), "mission": N_("whole mission")}


@dataclass(frozen=True)
class Meter:
    """One budget. `tight` marks one that is more than half spent."""

    name: str
    used: int
    limit: int
    tight: bool


@dataclass(frozen=True)
class Budget:
    """A stage's own budgets, the mission's total, and what was tried."""

    node_id: str
    meters: tuple[Meter, ...]
    tries: tuple[Spend, ...]


def budget(mission: Mission, node_id: str) -> Budget:
    """Meters of one node, its total and the mission's; empty before the contract is compiled."""
    found = spent_of_limits(mission, node_id)
    if not found:
        return Budget(node_id=node_id, meters=(), tries=())
    meters = tuple(_meter(TOTALS.get(name) or word(name), used, limit) for name, used, limit in found)
    return Budget(node_id=node_id, meters=meters, tries=mission.of(NodeId(node_id)).spends)


def spent_of_limits(mission: Mission, node_id: str) -> tuple[tuple[str, int, int], ...]:
    """Whose budget, what was spent of it, and its limit: totals first; empty before the contract is compiled."""
    contract = mission.contract
    if contract is None or node_id not in mission.nodes:
        return ()
    node, state = contract.node(NodeId(node_id)), mission.of(NodeId(node_id))
    totals = (
        ("stage", state.spent_total, node.recovery.total),
        ("mission", mission.spent_total, contract.recovery_total),
    )
    return (*totals, *((action, state.spent(action), getattr(node.recovery, action)) for action in SPENDING))


def _meter(name: str, used: int, limit: int) -> Meter:
    return Meter(name=name, used=used, limit=limit, tight=limit > 0 and used * 2 > limit)
