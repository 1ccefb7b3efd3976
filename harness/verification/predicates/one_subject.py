"""relational one_subject: what a stage did was done at the clause's place, and what was told is of that (D43)."""

from collections.abc import Iterator

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import Digest
from harness.contracts.reasons import Reason, because, several
from harness.contracts.values import Point
from harness.verification.finding import FACTS, Finding, Undecidable, ambiguous
from harness.verification.geometry import contains
from harness.verification.reading import Evidence

ARRIVED = ("arrival", "circuit")
IMAGES = ("panorama", "pictured")
ANALYSED = ("passage_checked", "analysis_of")
TOLD = ("message_stored", "delivered")


def one_subject(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Targets, places of images, analysed floor and told frames of the stage `subject`, all within `region_m`.

    An analysis is followed to the images that it is of, and to the messages of its clause. `evidence` = its report.
    """
    if not isinstance(effect, Relational) or len(effect.region_m) < 3:
        raise Undecidable(because("effect_not_testable", predicate="one_subject"))
    own = evidence.facts_of(node_id=effect.subject)
    if not own:
        return ambiguous(because("stages_not_accepted", stages=(effect.subject,)))
    seen = [*own, *(image for fact in own for image in _images_of(fact, evidence))]
    problems = [problem for fact in seen for problem in _elsewhere(fact, effect)]
    for analysis in (fact for fact in own if fact.name in ANALYSED):
        problems += _contradictions(analysis, evidence)
    places = [fact for fact in seen if fact.name in (*ARRIVED, *IMAGES, *ANALYSED)]
    if not places:
        return ambiguous(because("stage_tells_no_place", stage=effect.subject))
    reports = tuple(Digest(str(fact.arguments["report"])) for fact in own if "report" in fact.arguments)
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("done_at_its_place", place=effect.object),
        measured={"facts": float(len(places)), "elsewhere": float(len(problems))},
        bounds={"elsewhere": 0.0},
        sources=(FACTS,),
        evidence=reports,
    )


def _images_of(fact: CommittedFact, evidence: Evidence) -> Iterator[CommittedFact]:
    """The accepted images that an analysis is of."""
    if fact.name in ANALYSED:
        yield from evidence.facts_of(node_id=str(fact.arguments.get("object", "")), names=IMAGES)


def _elsewhere(fact: CommittedFact, effect: Relational) -> Iterator[Reason]:
    if fact.name in ARRIVED:
        x, y = fact.arguments["target_m"]
        frame = (fact.arguments.get("frame"), fact.arguments.get("map_version"))
        if frame != (effect.frame, effect.map_version) or not contains(effect.region_m, (x, y)):
            yield because("arrived_elsewhere", stage=fact.node_id, place=effect.object)
    if fact.name in IMAGES:
        if "x_m" not in fact.measured:
            raise Undecidable(because("images_without_place", stage=fact.node_id))
        if not contains(effect.region_m, (fact.measured["x_m"], fact.measured["y_m"])):
            yield because("images_of_elsewhere", stage=fact.node_id, place=effect.object)
    floor: list[Point] = [(x, y) for x, y in fact.arguments.get("region_m", ())] if fact.name in ANALYSED else []
    if any(not contains(effect.region_m, point) for point in floor):
        yield because("analysis_of_elsewhere", stage=fact.node_id, place=effect.object)


def _contradictions(analysis: CommittedFact, evidence: Evidence) -> Iterator[Reason]:
    """Messages of this clause that carry images of another analysis."""
    analysed = set(analysis.arguments.get("frames", ()))
    for fact in evidence.facts_of(names=TOLD):
        if not set(fact.arguments["frames"]) <= analysed:
            yield because("told_of_elsewhere", stage=fact.node_id, analysis=analysis.node_id)
