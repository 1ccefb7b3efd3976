"""relational one_chain: request, frames, analysis and delivery of one mission belong together."""

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import Digest
from harness.contracts.reasons import Reason, because, several
from harness.contracts.tasks import Goal
from harness.verification.finding import FACTS, SUPERVISOR, Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence, read


def one_chain(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Stored images within analysed frames within the panorama, of this mission and this goal.

    It rests on accepted facts only, and is as independent as the weakest of them.
    """
    if not isinstance(effect, Relational):
        raise Undecidable(because("effect_not_testable", predicate="one_chain"))
    nodes = {node.node_id: node for node in evidence.nodes}
    strangers = [name for name in (effect.subject, effect.object) if name not in nodes]
    if strangers:
        return ambiguous(because("stages_not_accepted", stages=tuple(strangers)))
    frames = tuple(evidence.fact("panorama").arguments["frames"])
    analysed = evidence.fact("passage_checked")
    stored = evidence.fact("message_stored", node_id=effect.subject)
    recorded = evidence.fact("recorded_request", node_id=effect.object)
    record = evidence.context.one("goal")
    if record is None:
        return ambiguous(because("goal_not_in_context"))
    problems = [
        *_within("analysed", analysed, set(frames), "panorama"),
        *_within("delivered", stored, set(analysed.arguments["frames"]), "analysis"),
        *([] if recorded.arguments["digest"] == read(record, Goal).digest else [because("transcript_of_another_goal")]),
    ]
    foreign = [one.node_id for one in nodes.values() if one.identity.mission_id != evidence.context.mission_id]
    problems += [because("of_another_mission", nodes=tuple(foreign))] if foreign else []
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("chain_belongs_together"),
        measured={"frames": float(len(frames)), "nodes": float(len(nodes)), "broken": float(len(problems))},
        bounds={"broken": 0.0},
        sources=(FACTS, SUPERVISOR),
        evidence=frames,
    )


def _within(what: str, fact: CommittedFact, whole: set[Digest], name: str) -> list[Reason]:
    foreign = set(fact.arguments["frames"]) - whole
    return [because("images_not_of_whole", images=len(foreign), what=what, whole=name)] if foreign else []
