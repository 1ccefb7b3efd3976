"""Computes which level of independence a robot's installed sources can give a condition, before anything moves. Pure.

The levels are those of the verifier: the same function is asked, with the sources that a predicate's answer rests on.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from harness.contracts.capabilities import Capability, CapabilityCard
from harness.contracts.effects import AnyEffect, Condition, Temporal
from harness.contracts.ids import ConditionId, NodeId
from harness.contracts.predicates import PinnedPredicate
from harness.contracts.reasons import Reason, because
from harness.contracts.tasks import Node, TaskContract, named_nodes, order, stages_behind
from harness.contracts.verifier_inputs import origins_of
from harness.verification.finding import BOOKKEEPING, FACTS, RECEIPTS, SUPERVISOR
from harness.verification.independence import Lineage, derived_independence, not_apart

RESTS_ON: Mapping[str, tuple[str, ...]] = {
    "analysis_of": (RECEIPTS,),
    "arrival": ("localiser", "odometry"),
    "arrival_without_target": ("localiser", "odometry"),
    "circuit": ("localiser", "odometry"),
    "covered": ("lidar", "localiser"),
    "delivered": (RECEIPTS,),
    "explored": (FACTS, "localiser", RECEIPTS),
    "facing": ("lidar",),
    "heard": ("room microphone", "recogniser"),
    "in_order": (SUPERVISOR,),
    "inside": ("localiser",),
    "kept_picture": ("archive read path",),
    "linked": (FACTS, SUPERVISOR, RECEIPTS),
    "message_stored": ("message read path",),
    "one_chain": (FACTS, SUPERVISOR),
    "one_image": (FACTS,),
    "one_subject": (FACTS,),
    "outcome_heard": ("room microphone", "recogniser"),
    "panorama": ("camera", "odometry", RECEIPTS),
    "passage_checked": ("lidar", "localiser", "camera", RECEIPTS),
    "pictured": ("camera", "odometry", RECEIPTS),
    "played": (RECEIPTS,),
    "recorded_request": ("request",),
    "reported": (FACTS, RECEIPTS),
    "same_image": (FACTS, RECEIPTS),
    "shows": ("camera", "picture reading"),
    "sighted": (RECEIPTS,),
    "static_body": ("odometry",),
    "stayed_out": ("localiser",),
    "transcript": (RECEIPTS,),
}
"""The sources that each predicate's answer rests on where it is satisfied; `stable` rests on those of what it holds."""
BUILDS_ON: Mapping[str, tuple[str, ...]] = {
    "analysis_of": ("panorama",),
    "delivered": ("analysis_of", "panorama"),
    "heard": ("passage_checked", "heard"),
    "kept_picture": ("pictured",),
    "message_stored": ("passage_checked", "analysis_of"),
    "one_chain": ("panorama", "passage_checked", "message_stored", "recorded_request"),
    "outcome_heard": ("arrival", "circuit", "stable", "outcome_heard"),
    "passage_checked": ("panorama",),
    "same_image": ("pictured",),
    "shows": ("pictured",),
    "sighted": ("panorama",),
}
"""The accepted facts of other stages that a predicate reads, by their names: its answer is no better than they are."""
HIGHEST = 2
SPEECH = ("heard", "outcome_heard")
"""Predicates whose recording is judged once more for the goal, and not made again."""


@dataclass(frozen=True)
class RobotSources:
    """What one connected robot can be judged by: what its independent sources are able to measure, which objects they
    can find in a picture, who serves it, and the process or address behind each provider and each source.
    """

    measures: frozenset[str] = frozenset()
    objects: frozenset[str] = frozenset()
    cards: Sequence[CapabilityCard] = ()
    origins: Mapping[str, str] = field(default_factory=dict)

    def serving(self, capabilities: Sequence[Capability]) -> list[CapabilityCard]:
        """The providers that can be asked for a stage."""
        return [card for card in self.cards if card.capability in capabilities]


def world_sources() -> frozenset[str]:
    """Every source of the world that a predicate reads: what a site may vouch for."""
    return frozenset(one for sources in RESTS_ON.values() for one in sources) - {RECEIPTS, *BOOKKEEPING}


def rests_on_sources(
    effect: AnyEffect, pinned: Mapping[str, PinnedPredicate] = MappingProxyType({})
) -> tuple[str, ...] | None:
    """The sources of this effect's predicate; None where its predicate is not known here.

    `pinned`: the installed predicates of its contract, which declare theirs.
    """
    if effect.predicate in pinned:
        return pinned[effect.predicate].installed.sources
    if isinstance(effect, Temporal) and effect.predicate == "stable" and effect.inner is not None:
        return rests_on_sources(effect.inner)
    return RESTS_ON.get(effect.predicate)


@dataclass(frozen=True)
class Reachable:
    """The best levels that conditions of one contract can reach at one robot; `vouched` as its site says (D17)."""

    contract: TaskContract
    robot: RobotSources
    vouched: Sequence[str] = ()

    def of_stage(self, condition: Condition, node: Node) -> int | None:
        """Of a stage's condition, over the providers that could do the stage.

        None where nothing is known of it: no provider of that capability is connected, or nobody knows the predicate. A
        person's attestation, where the evidence policy takes one, supplies whatever is missing.
        """
        sources = rests_on_sources(condition.effect, self.contract.pinned)
        serving = self.robot.serving(node.capabilities)
        if sources is None or not serving:
            return None
        if node.evidence.attestation:
            return HIGHEST
        lineage = Lineage({ConditionId("stages"): level for level in self._built_on(condition.effect, node.node_id)})
        origins = [origins_of(self.robot.origins, vouched=self.vouched, card=card) for card in serving]
        return max(
            derived_independence(sources, provider=card.sources or None, origins=one, lineage=lineage)
            for card, one in zip(serving, origins, strict=True)
        )

    def of_goal(self, condition: Condition) -> int | None:
        """Of a completion condition: of what is measured then, and of the stages it rests on.

        What is measured then must be apart from every provider that did a stage of the condition. Of a condition
        without such a stage nobody knows whom to be apart from: it has level 1.
        """
        sources = rests_on_sources(condition.effect, self.contract.pinned)
        if sources is None:
            return None
        named = [node for node in self.contract.nodes if node.node_id in named_nodes(condition.effect)]
        stages = [self.of_stage(one, node) for node in named for one in node.success_conditions]
        levels = [level for level in stages if level is not None]
        already_there = condition.effect.predicate in SPEECH and bool(named)
        if not already_there and set(sources) - {FACTS, SUPERVISOR, RECEIPTS}:
            behind = stages_behind(condition.effect, self.contract.nodes)
            levels.append(1 if not behind or self.lacking(condition, behind) else HIGHEST)
        return min((*levels, *self._built_on(condition.effect, None)), default=HIGHEST)

    def lacking(self, condition: Condition, stages: Sequence[Node]) -> tuple[Reason, ...]:
        """What keeps the condition's own sources from being apart from whoever does these stages; empty if nothing.

        Of each stage, the provider that lacks least.
        """
        found: list[Reason] = []
        for node in stages:
            of_each = [tuple(self._lacks(condition, card)) for card in self.robot.serving(node.capabilities)]
            least = min(of_each, key=len, default=[because("stage_without_provider", node_id=node.node_id)])
            found += least
        return tuple(one for place, one in enumerate(found) if one not in found[:place])

    def _lacks(self, condition: Condition, card: CapabilityCard) -> Iterator[Reason]:
        origins = origins_of(self.robot.origins, vouched=self.vouched, card=card)
        name = card.provider_id
        if not card.sources or not origins.provider:
            yield because("provider_names_no_sources", provider_id=name)
            return
        own = (RECEIPTS, *BOOKKEEPING)
        measured = [one for one in rests_on_sources(condition.effect, self.contract.pinned) or () if one not in own]
        for source, why in not_apart(measured, provider=card.sources, origins=origins).items():
            if why == "provider":
                yield because("source_of_provider", source=source, provider_id=name)
            else:
                yield because("source_of_same_origin", source=source, provider_id=name)

    def _built_on(self, effect: AnyEffect, own: NodeId | None) -> Iterator[int]:
        """One level, the lowest over the kinds of facts that are read; each kind is as good as its best stage."""
        levels = []
        for name in BUILDS_ON.get(effect.predicate, ()):
            found = [
                self.of_stage(one, node)
                for node in self._before(own)
                for one in node.success_conditions
                if one.effect.predicate == name
            ]
            levels += [max(level for level in found if level is not None)] if any(map(_known, found)) else []
        yield from [min(levels)] if levels else []

    def _before(self, own: NodeId | None) -> list[Node]:
        names = order(self.contract)
        earlier = names[: names.index(own)] if own is not None else names
        return [self.contract.node(name) for name in earlier]


def _known(level: int | None) -> bool:
    return level is not None
