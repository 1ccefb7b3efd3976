"""Derives spatial memory: map versions, places and regions, poses, relations and sightings (R137). Pure."""

import math
from collections.abc import Iterator, Sequence

import msgspec

from harness.contracts import events, memory
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import Digest
from harness.contracts.places import Passage, Place, Route
from harness.contracts.revision_events import GraphRevised
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Point
from harness.contracts.verdicts import ConditionResult
from harness.memory.draft import SUPERVISOR, Key, MemoryDraft, MissionStep, confidence_of, configured, provenance
from harness.projections.memory import VerifiedAttempt, bound, judgement

SIGHTING_HOLDS_S = 12 * 3600.0
"""How long a sighting speaks for the world it saw: a shift. After that it is expired, and another look is needed."""
BINDING = ("frames", "foreign")
SIGHTINGS = ("analysis_of", "passage_checked")
"""Facts that say what stands in a passage."""
"""Measured names of an analysis that speak of its binding to the images, not of what they show."""


def spatial(step: MissionStep) -> Iterator[MemoryDraft]:
    """What one event adds to spatial memory."""
    match step.event:
        case events.ContractCompiled() | events.ContractRecompiled() as event:
            yield from _configured(step, event.contract)
        case events.EpochChanged() as event:
            yield from _epoch(step, event)
        case events.DispatchIntended(moves=True) as event:
            yield from _departed(step, event)
        case events.NodeCommitted() as event:
            yield from _committed(step, event)
        case GraphRevised(contract=TaskContract() as contract):
            yield from _configured(step, contract)
        case _:
            return


def contradiction(one: memory.Sighting, other: memory.Sighting) -> str:
    """The first state on which two sightings differ; empty if they agree. Shares agree within a tenth."""
    for name in sorted(one.states.keys() & other.states.keys()):
        bound_by = 0.1 if name.startswith("share") else 0.0
        if abs(one.states[name] - other.states[name]) > bound_by:
            return name
    return ""


def _configured(step: MissionStep, contract: TaskContract) -> Iterator[MemoryDraft]:
    yield configured(
        step,
        role="spatial",
        subject=f"map/{step.before.robot_id}/{contract.frame}",
        knowledge=memory.MapEpoch(frame=contract.frame, map_version=contract.map_version),
    )
    for place in bound(contract, Place):
        where = _box(place.region_m or (place.approach_m,), frame=place.frame, map_version=place.map_version)
        yield configured(
            step,
            role="spatial",
            subject=f"place/{place.place_id}",
            knowledge=memory.KnownPlace(place=place),
            where=where,
        )
    for passage in bound(contract, Passage):
        where = _box(passage.floor_m, frame=passage.frame, map_version=contract.map_version)
        yield configured(
            step,
            role="spatial",
            subject=f"passage/{passage.passage_id}",
            knowledge=memory.KnownRegion(floor_m=passage.floor_m),
            where=where,
        )
    for route in bound(contract, Route):
        leads = memory.KnownRelation(relation="leads_to", one=f"place/{route.start}", other=f"place/{route.end}")
        where = _box(route.waypoints_m, frame=route.frame, map_version=route.map_version)
        yield configured(step, role="spatial", subject=f"route/{route.name}", knowledge=leads, where=where)


def _epoch(step: MissionStep, event: events.EpochChanged) -> Iterator[MemoryDraft]:
    contract = step.before.contract
    if contract is None:
        return
    yield MemoryDraft(
        role="spatial",
        subject=f"map/{step.before.robot_id}/{contract.frame}",
        knowledge=memory.MapEpoch(frame=contract.frame, map_version=event.map_version),
        verification="observed",
        provenance=provenance(step, sources=("localiser",)),
        valid_from_s=step.stored.mission_s,
    )


def _departed(step: MissionStep, event: events.DispatchIntended) -> Iterator[MemoryDraft]:
    """The body's position is unknown from here on, until one is measured and accepted again."""
    robot, place = step.before.robot_id, step.before.place(event.node_id)
    towards = f"place/{place}" if place else f"node/{event.node_id}"
    moves = memory.KnownRelation(relation="moves_to", one=f"robot/{robot}", other=towards)
    entries: tuple[tuple[str, memory.AnyKnowledge], ...] = (
        (f"robot/{robot}", memory.KnownPose(robot_id=robot)),
        (f"robot/{robot}/at", moves),
    )
    for subject, knowledge in entries:
        yield MemoryDraft(
            role="spatial",
            subject=subject,
            knowledge=knowledge,
            verification="observed",
            provenance=provenance(step, sources=(SUPERVISOR,), node_id=event.node_id),
            valid_from_s=event.dispatched_s,
        )


def _committed(step: MissionStep, event: events.NodeCommitted) -> Iterator[MemoryDraft]:
    """One record per thing: the last one, where several conditions concern it."""
    closed = judgement(step.before, event)
    if closed is not None:
        accepted = {draft.key: draft for fact in event.facts for draft in _accepted(step, fact, closed)}
        yield from accepted.values()


def _accepted(step: MissionStep, fact: CommittedFact, closed: VerifiedAttempt) -> Iterator[MemoryDraft]:
    robot = step.before.robot_id
    pose = _pose(step, fact)
    if pose is not None and pose.point_m is not None:
        where = _around(pose.point_m, pose.within_m or 0.0, step)
        yield _measured(step, fact, closed, subject=f"robot/{robot}", knowledge=pose, where=where)
        if pose.place:
            at = memory.KnownRelation(relation="at", one=f"robot/{robot}", other=f"place/{pose.place}")
            yield _measured(step, fact, closed, subject=f"robot/{robot}/at", knowledge=at, where=where)
    if fact.name in SIGHTINGS:
        yield _sighted(step, fact, closed)


def _pose(step: MissionStep, fact: CommittedFact) -> memory.KnownPose | None:
    """Where a fact places the body: at a target, within what was measured, or at a measured position."""
    arguments, robot_id = fact.arguments, step.before.robot_id
    if "target_m" in arguments and "distance_m" in fact.measured:
        point = msgspec.convert(arguments["target_m"], Point)
        place = step.before.place(fact.node_id)
        return memory.KnownPose(robot_id=robot_id, point_m=point, within_m=fact.measured["distance_m"], place=place)
    if "position" in arguments and "heading_rad" in arguments:
        point, yaw_rad = msgspec.convert(arguments["position"], Point), float(arguments["heading_rad"])
        return memory.KnownPose(
            robot_id=robot_id, point_m=point, yaw_rad=yaw_rad, place=step.before.place(fact.node_id)
        )
    return None


def _measured(
    step: MissionStep,
    fact: CommittedFact,
    closed: VerifiedAttempt,
    *,
    subject: str,
    knowledge: memory.AnyKnowledge,
    where: memory.FloorBox,
) -> MemoryDraft:
    """What the gate accepted of the body's position: verified, by the sources that its condition rests on."""
    return MemoryDraft(
        role="spatial",
        subject=subject,
        knowledge=knowledge,
        verification="verified",
        provenance=provenance(
            step,
            sources=_result(closed, fact).sources or (closed.packet.identity.provider_id,),
            node_id=fact.node_id,
            packet_id=fact.packet_id,
            blobs=[one.blob for one in closed.packet.estimates],
        ),
        valid_from_s=fact.at_s,
        confidence=confidence_of(closed.packet),
        where=where,
    )


def _sighted(step: MissionStep, fact: CommittedFact, closed: VerifiedAttempt) -> MemoryDraft:
    """What an analysis saw. The gate accepted its binding to the images; no other source confirms that it is right."""
    contract = step.before.contract
    passage = next(iter(bound(contract, Passage)), None) if contract else None
    seen = next((one for one in step.before.facts.values() if one.node_id == fact.arguments.get("object")), fact)
    report = Digest(str(fact.arguments.get("report", ""))) or None
    where = None
    if passage is not None and contract is not None:
        where = _box(passage.floor_m, frame=passage.frame, map_version=contract.map_version)
    return MemoryDraft(
        role="spatial",
        subject=_sighting_subject(step, fact),
        knowledge=memory.Sighting(states={n: v for n, v in fact.measured.items() if n not in BINDING}, report=report),
        verification="observed",
        provenance=provenance(
            step,
            sources=("camera", closed.acting.provider_id),
            node_id=fact.node_id,
            packet_id=fact.packet_id,
            blobs=[Digest(digest) for digest in (*((report,) if report else ()), *fact.arguments.get("frames", ()))],
        ),
        valid_from_s=seen.at_s,
        valid_until_s=seen.at_s + SIGHTING_HOLDS_S,
        confidence=confidence_of(closed.packet),
        where=where,
        compared=True,
    )


def keys_of(step: MissionStep, fact: CommittedFact) -> tuple[Key, ...]:
    """What spatial memory holds because of a fact."""
    if _pose(step, fact) is not None:
        robot = f"robot/{step.before.robot_id}"
        return ("pose", robot), ("relation", f"{robot}/at")
    return (("sighting", _sighting_subject(step, fact)),) if fact.name in SIGHTINGS else ()


def _sighting_subject(step: MissionStep, fact: CommittedFact) -> str:
    contract = step.before.contract
    passage = next(iter(bound(contract, Passage)), None) if contract else None
    return f"passage/{passage.passage_id}" if passage else f"place/{step.before.place(fact.node_id) or 'unknown'}"


def _result(closed: VerifiedAttempt, fact: CommittedFact) -> ConditionResult:
    return next(result for result in closed.verdict.results if result.condition_id == fact.condition_id)


def _around(point: Point, within_m: float, step: MissionStep) -> memory.FloorBox:
    contract = step.before.contract
    frame, version = (contract.frame, contract.map_version) if contract else ("unknown", "unknown")
    return memory.FloorBox(
        frame=frame,
        map_version=version,
        x_min_m=point[0] - within_m,
        y_min_m=point[1] - within_m,
        x_max_m=point[0] + within_m,
        y_max_m=point[1] + within_m,
    )


def _box(points: Sequence[Point], *, frame: str, map_version: str) -> memory.FloorBox:
    xs, ys = [x for x, _ in points] or [math.nan], [y for _, y in points] or [math.nan]
    return memory.FloorBox(
        frame=frame, map_version=map_version, x_min_m=min(xs), y_min_m=min(ys), x_max_m=max(xs), y_max_m=max(ys)
    )
