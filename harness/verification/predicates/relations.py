"""Predicates over several nodes, which no single node tests (D20): linked, in_order, reported."""

from collections.abc import Sequence
from itertools import pairwise

from harness.contracts.effects import AnyEffect, Relational, Symbolic, Temporal
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import NodeId
from harness.contracts.reasons import Reason, because, several
from harness.contracts.tasks import Goal
from harness.contracts.verifier_inputs import CommittedNode
from harness.verification.finding import FACTS, RECEIPTS, SUPERVISOR, Finding, Undecidable, ambiguous
from harness.verification.predicates.analysis import AnalysisReport
from harness.verification.reading import Evidence, read

OBSTRUCTED = ("obstruct", "block")
CLEAR = ("is clear", "is free", "no obstruction", "not obstructed", "not blocked")


def in_order(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The named nodes ended, and were accepted, in this order, by the supervisor's own record.

    That record is no source of the world: the order is as well shown as the acceptances in it.
    """
    if not isinstance(effect, Temporal) or len(effect.nodes) < 2:
        raise Undecidable(because("effect_not_testable", predicate="in_order"))
    known = {node.node_id: node for node in evidence.ended}
    missing = [name for name in effect.nodes if name not in known]
    evidence.build_on(effect.nodes)
    if missing:
        return ambiguous(because("not_accepted_yet", stages=tuple(missing)), accepted=float(len(known)))
    nodes = [known[name] for name in effect.nodes]
    late = [
        because("out_of_order", later=b.node_id, earlier=a.node_id)
        for a, b in pairwise(nodes)
        if not (a.terminal_s <= b.terminal_s and a.committed_k < b.committed_k)
    ]
    return Finding(
        verdict="violated" if late else "satisfied",
        reason=several(late) or because("in_their_order", nodes=len(nodes)),
        measured={"nodes": float(len(nodes)), "out_of_order": float(len(late))},
        bounds={"nodes": float(len(effect.nodes)), "out_of_order": 0.0},
        sources=(SUPERVISOR,),
    )


def linked(effect: AnyEffect, evidence: Evidence) -> Finding:
    """One chain of identifiers: delivered images within analysed frames within the panorama, one mission, one goal."""
    if not isinstance(effect, Relational):
        raise Undecidable(because("effect_not_testable", predicate="linked"))
    nodes = {node.node_id: node for node in evidence.nodes}
    strangers = [name for name in (effect.subject, effect.object) if name not in nodes]
    if strangers:
        return ambiguous(because("stages_not_accepted", stages=tuple(strangers)))
    frames = tuple(evidence.fact("panorama").arguments["frames"])
    analysed = evidence.fact("analysis_of")
    sent = evidence.fact("delivered")
    transcript = evidence.fact("transcript")
    record = evidence.context.one("goal")
    if record is None:
        return ambiguous(because("goal_not_in_context"))
    problems = [
        *_within("analysed", analysed, frames, "panorama"),
        *_within("delivered", sent, tuple(analysed.arguments["frames"]), "analysis"),
        *(
            []
            if transcript.arguments["digest"] == read(record, Goal).digest
            else [because("transcript_of_another_goal")]
        ),
        *_one_mission(evidence, nodes),
    ]
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("chain_belongs_together"),
        measured={"frames": float(len(frames)), "nodes": float(len(nodes)), "broken": float(len(problems))},
        bounds={"broken": 0.0},
        sources=(FACTS, SUPERVISOR, RECEIPTS),
        evidence=frames,
    )


def reported(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The finding reached people: the delivered text names what the accepted analysis found, and then it was spoken.

    The playback belongs to the reporting node's own request and comes after the analysis.
    """
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="reported"))
    analysis = evidence.newest_fact(("analysis_of", "passage_checked"), node_id=effect.arguments.get("analysis", ""))
    spoken = evidence.fact("played", node_id=effect.arguments.get("report", ""))
    sent = evidence.newest_fact(("delivered", "message_stored"))
    text = evidence.bytes_of(sent.arguments["text_digest"]).decode(errors="replace").lower()
    report = evidence.decoded(analysis.arguments["report"], AnalysisReport)
    problems = [] if names_finding(text, blocked=report.blocked) else [because("text_does_not_name_finding")]
    speaker = next((node for node in evidence.nodes if node.node_id == spoken.node_id), None)
    requests = speaker.requests if speaker else ()
    played = [one for one in evidence.receipts if one.kind == "playback" and one.blob == spoken.arguments["sound"]]
    own = [one for one in played if one.request_id in requests]
    problems += [] if own else [because("playback_of_another_node")]
    problems += [because("report_before_analysis")] if own and own[-1].at_s < analysis.at_s else []
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("finding_reported"),
        measured={"blocked": float(report.blocked), "obstructions": float(len(report.findings))},
        sources=(FACTS, RECEIPTS),
        evidence=(analysis.arguments["report"], spoken.arguments["sound"]),
    )


def names_finding(text: str, *, blocked: bool) -> bool:
    """Whether a text (lower case) states what the analysis found of the passage, and not its contrary."""
    clear = any(words in text for words in CLEAR)
    return any(words in text for words in OBSTRUCTED) and not clear if blocked else clear


def _within(what: str, fact: CommittedFact, frames: Sequence[str], whole: str) -> list[Reason]:
    foreign = set(fact.arguments["frames"]) - set(frames)
    return [because("images_not_of_whole", images=len(foreign), what=what, whole=whole)] if foreign else []


def _one_mission(evidence: Evidence, nodes: dict[NodeId, CommittedNode]) -> list[Reason]:
    mission = evidence.context.mission_id
    foreign = [node.node_id for node in nodes.values() if node.identity.mission_id != mission]
    unknown = sorted({fact.node_id for fact in evidence.facts} - nodes.keys())
    requests = {request for node in nodes.values() for request in node.requests}
    strays = sum(receipt.request_id not in requests for receipt in evidence.receipts)
    problems = [because("of_another_mission", nodes=tuple(foreign))] if foreign else []
    problems += [because("facts_of_unaccepted_nodes", nodes=tuple(unknown))] if unknown else []
    return problems + ([because("receipts_without_request", receipts=strays)] if strays else [])
