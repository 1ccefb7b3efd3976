"""Derives the facts that a satisfied verdict would establish. Pure: it proposes; only the gate commits (R29, R113)."""

from collections.abc import Sequence
from typing import Any

from harness.contracts import effects
from harness.contracts.evidence import CommittedFact, DeclaredEffect, EvidencePacket
from harness.contracts.protocol import ProposedFact
from harness.contracts.rules import FIRST_RULES, LINEAGE, RulesVersion
from harness.contracts.tasks import Node
from harness.contracts.values import Count
from harness.contracts.verdicts import ConditionResult, NodeVerdict
from harness.projections.proposals import proposed, written_by_harness


def facts_of(
    verdict: NodeVerdict,
    *,
    packet: EvidencePacket,
    node: Node,
    k: Count,
    proposals: Sequence[ProposedFact] = (),
    rules: RulesVersion = FIRST_RULES,
) -> tuple[CommittedFact, ...]:
    """One fact per satisfied condition that a provider proposed, with the values that later nodes bind.

    The values are those that were tested, never the provider's. In a packet of a release whose harness wrote the
    proposals itself, every condition counts as proposed.

    From the rules on that trace levels, each fact keeps the level that it was accepted at.

    panorama: frames, yaws_rad (index, heading in map), position, heading_rad. analysis_of: report, frames, text (the
    harness's own words from the report's numbers). passage_checked: the same, and region_m.
    delivered, message_stored: frames, images (how many), text_digest.
    pictured: images. same_image: images (the one that both share), report. transcript: digest. played: sound.
    heard, outcome_heard: sound, recognition.
    arrival, circuit: frame, map_version, target_m, tolerance_m.
    """
    declared = {
        condition.condition_id: condition
        for condition in node.success_conditions
        if written_by_harness(packet) or proposed(condition, proposals)
    }
    return tuple(
        CommittedFact(
            name=declared[result.condition_id].effect.predicate,
            kind=declared[result.condition_id].fact,
            node_id=node.node_id,
            condition_id=result.condition_id,
            packet_id=packet.identity.packet_id,
            k=k,
            at_s=packet.terminal_s,
            arguments=_arguments(declared[result.condition_id], result),
            measured=result.measured,
            independence=result.independence if rules >= LINEAGE else None,
        )
        for result in verdict.results
        if result.verdict == "satisfied" and result.condition_id in declared
    )


def declared_effects_of(
    verdict: NodeVerdict, *, packet: EvidencePacket, node: Node, proposals: Sequence[ProposedFact] = ()
) -> tuple[DeclaredEffect, ...]:
    """The effects that the node's evidence policy lets stand on the provider's word, where only that word shows them.

    Nothing that was refuted, nothing that lacks mandatory evidence, and nothing that the provider did not propose:
    where it gave no word there is none to stand on (D52).
    """
    conditions = {
        one.condition_id: one
        for one in node.success_conditions
        if one.condition_id in node.declared and (written_by_harness(packet) or proposed(one, proposals))
    }
    return tuple(
        DeclaredEffect(
            name=condition.effect.predicate,
            node_id=node.node_id,
            condition_id=result.condition_id,
            text=condition.text,
            packet_id=packet.identity.packet_id,
            at_s=packet.terminal_s,
            arguments=_arguments(condition, result),
            measured=result.measured,
        )
        for result in verdict.results
        if (condition := conditions.get(result.condition_id)) is not None
        if result.verdict == "ambiguous" and result.short is True
    )


def finding_in_words(measured: dict[str, float]) -> str:
    """Describes what an analysis found, from its numbers only: no provider's prose enters a fact."""
    count = round(measured["obstructions"])
    if not measured["blocked"]:
        return "The passage is clear: nothing stands on its floor."
    shares = [f"{measured[name]:.0%}" for name in sorted(measured) if name.startswith("share_")]
    things = "one thing stands" if count == 1 else f"{count} things stand"
    return f"The passage is obstructed: {things} on its floor, taking {' and '.join(shares)} of its width."


def _arguments(condition: effects.Condition, result: ConditionResult) -> dict[str, Any]:
    match condition.effect:
        case effects.Metric() as effect:
            return {
                "frame": effect.frame,
                "map_version": effect.map_version,
                "target_m": list(effect.target_m),
                "tolerance_m": effect.tolerance_m,
            }
        case effects.Visual(predicate="panorama"):
            return _panorama(result)
        case effects.Visual(predicate="pictured"):
            return {"images": list(result.evidence)}
        case effects.Visual():
            return {"report": result.evidence[0], "frames": list(result.evidence[1:])}
        case effects.Relational(predicate="same_image" | "kept_picture") as effect:
            image, report = result.evidence
            return {"subject": effect.subject, "object": effect.object, "images": [image], "report": report}
        case effects.Relational(predicate="passage_checked") as effect:
            report, *rest = result.evidence
            named = {"subject": effect.subject, "object": effect.object, "report": report, "frames": rest[:-1]}
            region_m = [list(point) for point in effect.region_m]
            return {**named, "text": finding_in_words(result.measured), "region_m": region_m}
        case effects.Relational() as effect if effect.predicate != "analysis_of":
            return {"relation": effect.relation, "subject": effect.subject, "object": effect.object}
        case effects.Relational() as effect:
            report, *frames = result.evidence
            bound = {"subject": effect.subject, "object": effect.object, "report": report, "frames": list(frames)}
            return {**bound, "text": finding_in_words(result.measured)}
        case effects.Symbolic() as effect:
            return _symbolic(effect, result)
        case effects.Temporal() as effect:
            return {"interval_s": effect.interval_s, "bound": effect.bound}


def _panorama(result: ConditionResult) -> dict[str, Any]:
    measured, frames = result.measured, list(result.evidence)
    if "heading_rad" not in measured:
        return {"frames": frames}
    headings = [[float(index), measured[f"yaw_{index}_rad"]] for index in range(len(frames))]
    return {
        "frames": frames,
        "yaws_rad": headings,
        "position": [measured["x_m"], measured["y_m"]],
        "heading_rad": measured["heading_rad"],
    }


def _symbolic(effect: effects.Symbolic, result: ConditionResult) -> dict[str, Any]:
    match effect.predicate:
        case "delivered" | "message_stored":
            *images, text = result.evidence
            return {"frames": images, "images": len(images), "text_digest": text}
        case "transcript" | "recorded_request":
            return {"digest": result.evidence[0]}
        case "heard" | "outcome_heard":
            sound, recognition = result.evidence
            return {**effect.arguments, "sound": sound, "recognition": recognition}
        case "played":
            return {"sound": result.evidence[0]}
        case _:
            return dict(effect.arguments)
