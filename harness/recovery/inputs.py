"""Reads the records of C4 that the recovery role uses. Pure: nothing else in C4 affects recovery.

Kinds: `failure` what failed, `node` the node and who is given up for it, `attempts` the steps authorised so far,
`budget` what is left, `ladder` the pinned policy's steps, `alternative` one card per provider that may serve the node,
`observed` what sensors reported. Everything else in C4 is for people and models.
"""

from typing import TypeVar

import msgspec

from harness.contracts.capabilities import Capability, CapabilityCard
from harness.contracts.configuration import RecoveryAction
from harness.contracts.contexts import Context
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.reasons import because
from harness.projections.mission import Failure, Spend
from harness.recovery.state import RecoveryState

T = TypeVar("T")


class NodeFailure(msgspec.Struct, frozen=True):
    """The node that failed, who did it last, and who was given up.

    `pointless`: steps that cannot change what failed. Contexts of older releases do not name them.
    """

    node_id: NodeId
    capabilities: tuple[Capability, ...]
    provider_id: ProviderId | None = None
    excluded: tuple[ProviderId, ...] = ()
    moves: bool = False
    pointless: tuple[RecoveryAction, ...] = ()


class _BudgetLeft(msgspec.Struct, frozen=True):
    left: dict[RecoveryAction, int]
    left_node: int
    left_mission: int


class _LadderSteps(msgspec.Struct, frozen=True):
    rungs: tuple[RecoveryAction, ...]


def failed_node(context: Context) -> NodeFailure:
    """The node C4 is about; raises ContractInvalid without the record."""
    return _read(context, "node", NodeFailure)


def failure_of(context: Context) -> Failure:
    """The open failure; raises ContractInvalid without the record."""
    return _read(context, "failure", Failure)


def rungs_of(context: Context) -> tuple[RecoveryAction, ...]:
    """The ladder of this failure class; without one in the context, only a person."""
    record = context.one("ladder")
    return record.read(_LadderSteps).rungs if record else ("human",)


def standing_in(context: Context) -> RecoveryState:
    """The node's recovery state, as far as C4 shows it. Raises ContractInvalid without failure, attempts or budget."""
    failure, budget = failure_of(context), _read(context, "budget", _BudgetLeft)
    sensed_s = [record.at_s for record in context.all("observed") if record.origin == "sensor"]
    return RecoveryState(
        failure=failure.failure,
        failed_s=failure.at_s,
        spends=_read(context, "attempts", tuple[Spend, ...]),
        left=budget.left,
        left_node=budget.left_node,
        left_mission=budget.left_mission,
        news_s=max(sensed_s, default=None),
        pointless=failed_node(context).pointless,
    )


def alternatives_of(context: Context) -> tuple[CapabilityCard, ...]:
    """Cards of other providers, best first, that could do what the node wants and were not given up."""
    node = failed_node(context)
    cards = tuple(record.read(CapabilityCard) for record in context.all("alternative"))
    kept_out = {*node.excluded, node.provider_id}
    return tuple(card for card in cards if card.provider_id not in kept_out and card.capability in node.capabilities)


def _read(context: Context, kind: str, shape: type[T]) -> T:
    record = context.one(kind)
    if record is None:
        raise ContractInvalid(
            because("context_incomplete", kind=kind),
            where=because("at_role_context", role="C4", node_id=context.node_id or ""),
        )
    return record.read(shape)
