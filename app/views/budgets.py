"""Pure: recovery budgets as meters: what was spent and what is left, per action, per node, per mission."""

from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import word
from harness.contracts.configuration import SPENDING
from harness.contracts.ids import NodeId
from harness.projections.mission import Mission, Spend


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
    contract = mission.contract
    if contract is None or node_id not in mission.nodes:
        return Budget(node_id=node_id, meters=(), tries=())
    node, state = contract.node(NodeId(node_id)), mission.of(NodeId(node_id))
    actions = [_meter(word(action), state.spent(action), getattr(node.recovery, action)) for action in SPENDING]
    totals = [
        _meter(N_("this stage"), state.spent_total, node.recovery.total),
        _meter(N_("whole mission"), mission.spent_total, contract.recovery_total),
    ]
    return Budget(node_id=node_id, meters=(*totals, *actions), tries=state.spends)


def _meter(name: str, used: int, limit: int) -> Meter:
    return Meter(name=name, used=used, limit=limit, tight=limit > 0 and used * 2 > limit)
