"""Compares what a provider proposed with what a node was to bring about (R33). Pure: a proposal changes nothing."""

from collections.abc import Iterable, Sequence
from typing import Any

import msgspec
from msgspec import UNSET

from harness.contracts.effects import AnyEffect, Condition, Symbolic, Temporal
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import ConditionId
from harness.contracts.protocol import ProposedFact
from harness.contracts.tasks import Node
from harness.contracts.verdicts import NodeVerdict


def written_by_harness(packet: EvidencePacket) -> bool:
    """Whether the packet is of a release whose harness wrote a proposal for each condition itself."""
    return packet.protocol is UNSET


def proposals_for(packet: EvidencePacket, earlier: Iterable[EvidencePacket]) -> tuple[ProposedFact, ...]:
    """What was proposed for a node: by this execution, and for a look also by the executions that it looks at."""
    cited = [one for one in earlier if packet.verify_only and one.identity.packet_id in packet.cites]
    return tuple(fact for one in (packet, *cited) for fact in one.proposed)


def proposed(condition: Condition, proposals: Iterable[ProposedFact]) -> ProposedFact | None:
    """The proposal of this condition's effect, or None."""
    return next((one for one in proposals if matches(one, condition.effect)), None)


def matches(fact: ProposedFact, effect: AnyEffect) -> bool:
    """Whether a proposal is about this effect: its predicate, and nothing that contradicts what the effect states."""
    if fact.name != effect.predicate:
        return False
    stated = _stated(effect)
    return all(_same(value, stated[name]) for name, value in fact.arguments.items() if name in stated)


def must_be_proposed(condition: Condition) -> bool:
    """Whether the gate accepts the condition only with a proposal.

    What holds over time is measured whoever acts: a voice knows nothing of the body that must stand while it speaks.
    """
    return not isinstance(condition.effect, Temporal)


def unproposed(node: Node, proposals: Sequence[ProposedFact]) -> tuple[ConditionId, ...]:
    """The conditions of a node that a provider had to propose and did not."""
    return tuple(
        one.condition_id
        for one in node.success_conditions
        if must_be_proposed(one) and proposed(one, proposals) is None
    )


def tested(fact: ProposedFact, node: Node, verdict: NodeVerdict | None) -> str:
    """The verdict on the condition that a proposal is about; empty where nothing tested it."""
    about = {one.condition_id for one in node.success_conditions if matches(fact, one.effect)}
    results = verdict.results if verdict else ()
    return next((one.verdict for one in results if one.condition_id in about), "")


def _stated(effect: AnyEffect) -> dict[str, Any]:
    if isinstance(effect, Symbolic):
        return dict(effect.arguments)
    fields: dict[str, Any] = msgspec.to_builtins(effect)
    unset = {"predicate", "type", "bounds", "inner"}
    return {name: value for name, value in fields.items() if name not in unset and value not in ("", [])}


def _same(proposal: object, stated: object) -> bool:
    """Equal values; a text and a number state different things and contradict nothing."""
    plain = msgspec.to_builtins(proposal)
    number, text = isinstance(plain, int | float), isinstance(stated, str)
    return plain == stated or (text and number) or (isinstance(plain, list) and not isinstance(stated, list))
