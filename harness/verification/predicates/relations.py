"""Conditions over several nodes, which no node tests by itself (D20): linked, in_order, reported."""

from collections.abc import Sequence
from itertools import pairwise

from harness.contracts.effects import AnyEffect, Relational, Symbolic, Temporal
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import NodeId
from harness.contracts.judging import CommittedNode
from harness.contracts.tasks import Goal
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.predicates.analysis import AnalysisReport
from harness.verification.reading import Evidence, read

SUPERVISOR = "supervisor"
FACTS = "accepted facts"
OBSTRUCTED = ("obstruct", "block")
CLEAR = ("is clear", "is free", "no obstruction", "not obstructed", "not blocked")


def in_order(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The named nodes ended, and were accepted, in this order, by the supervisor's own record."""
    if not isinstance(effect, Temporal) or len(effect.nodes) < 2:
        raise Undecidable("in_order is a temporal effect over at least two nodes")
    known = {node.node_id: node for node in evidence.nodes}
    missing = [name for name in effect.nodes if name not in known]
    if missing:
        return ambiguous(f"not accepted yet: {', '.join(missing)}", accepted=float(len(known)))
    nodes = [known[name] for name in effect.nodes]
    late = [
        f"{b.node_id} did not end and count after {a.node_id}"
        for a, b in pairwise(nodes)
        if not (a.terminal_s <= b.terminal_s and a.committed_k < b.committed_k)
    ]
    return Finding(
        verdict="violated" if late else "satisfied",
        reason="; ".join(late) or f"{len(nodes)} nodes ended in their order",
        measured={"nodes": float(len(nodes)), "out_of_order": float(len(late))},
        bounds={"nodes": float(len(effect.nodes)), "out_of_order": 0.0},
        sources=(SUPERVISOR,),
    )


def linked(effect: AnyEffect, evidence: Evidence) -> Finding:
    """One chain of identifiers: delivered images within analysed frames within the panorama, one mission, one goal."""
    if not isinstance(effect, Relational):
        raise Undecidable("linked is a relational effect")
    nodes = {node.node_id: node for node in evidence.nodes}
    strangers = [name for name in (effect.subject, effect.object) if name not in nodes]
    if strangers:
        return ambiguous(f"not accepted: {', '.join(strangers)}")
    frames = tuple(evidence.fact("panorama").arguments["frames"])
    analysed = evidence.fact("analysis_of")
    sent = evidence.fact("delivered")
    said = evidence.fact("transcript")
    record = evidence.context.one("goal")
    if record is None:
        return ambiguous("the goal is not in the context")
    problems = [
        *_within("analysed", analysed, frames, "panorama"),
        *_within("delivered", sent, tuple(analysed.arguments["frames"]), "analysis"),
        *([] if said.arguments["digest"] == read(record, Goal).digest else ["the transcript is not of this goal"]),
        *_one_mission(evidence, nodes),
    ]
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason="; ".join(problems) or "transcript, frames, analysis and delivery belong together",
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
        raise Undecidable("reported is a symbolic effect")
    analysis = evidence.fact("analysis_of", node_id=effect.arguments.get("analysis", ""))
    spoken = evidence.fact("played", node_id=effect.arguments.get("report", ""))
    text = evidence.bytes_of(evidence.fact("delivered").arguments["text_digest"]).decode(errors="replace").lower()
    report = evidence.decoded(analysis.arguments["report"], AnalysisReport)
    problems = [] if names_finding(text, blocked=report.blocked) else ["the delivered text does not name the finding"]
    speaker = next((node for node in evidence.nodes if node.node_id == spoken.node_id), None)
    requests = speaker.requests if speaker else ()
    played = [one for one in evidence.receipts if one.kind == "playback" and one.blob == spoken.arguments["sound"]]
    own = [one for one in played if one.request_id in requests]
    problems += [] if own else ["the playback does not belong to the reporting node"]
    problems += ["the report was spoken before the analysis"] if own and own[-1].at_s < analysis.at_s else []
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason="; ".join(problems) or "the finding was delivered in words, and a report was spoken after it",
        measured={"blocked": float(report.blocked), "obstructions": float(len(report.findings))},
        sources=(FACTS, RECEIPTS),
        evidence=(analysis.arguments["report"], spoken.arguments["sound"]),
    )


def names_finding(text: str, *, blocked: bool) -> bool:
    """Whether a text (lower case) says of the passage what the analysis found, and not its contrary."""
    clear = any(words in text for words in CLEAR)
    return any(words in text for words in OBSTRUCTED) and not clear if blocked else clear


def _within(what: str, fact: CommittedFact, frames: Sequence[str], whole: str) -> list[str]:
    foreign = set(fact.arguments["frames"]) - set(frames)
    return [f"{len(foreign)} {what} images are not of the {whole}"] if foreign else []


def _one_mission(evidence: Evidence, nodes: dict[NodeId, CommittedNode]) -> list[str]:
    mission = evidence.context.mission_id
    foreign = [node.node_id for node in nodes.values() if node.identity.mission_id != mission]
    unknown = sorted({fact.node_id for fact in evidence.facts} - nodes.keys())
    requests = {request for node in nodes.values() for request in node.requests}
    strays = sum(receipt.request_id not in requests for receipt in evidence.receipts)
    problems = [f"of another mission: {', '.join(foreign)}"] if foreign else []
    problems += [f"facts of nodes that were not accepted: {', '.join(unknown)}"] if unknown else []
    return problems + ([f"{strays} receipts answer no request of this mission"] if strays else [])
