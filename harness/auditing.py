"""Replay for an auditor: fold again, verify again, decide again, and say what differs. Touches no robot (R145)."""

from typing import Any

import msgspec

from harness.contracts.commands import CompleteNode
from harness.contracts.contexts import Context
from harness.contracts.decisions import Accepted
from harness.contracts.events import CommitRejected, NodeCommitted, PacketRetained, VerdictRecorded
from harness.contracts.ids import Digest, MissionId
from harness.contracts.values import Count, Moment, Value, decode, digest
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.verification.verdict import verify


class ReplayReport(Value):
    """What was derived again. `state` is the digest of the folded mission."""

    events: Count
    verdicts: Count
    decisions: Count
    k: Count
    state: Digest
    differences: tuple[str, ...]


def replay_mission(runtime: Runtime, mission_id: MissionId) -> ReplayReport:
    """Reconstruct progress from the log and re-derive every verdict and gate decision from what was stored.

    Raises UnknownName for a mission that does not exist.
    """
    live = runtime.mission(mission_id)
    mission, differences = Mission(), list[str]()
    verdicts = decisions = 0
    stored = runtime.events(mission_id)
    events = [DECIDER.codec.decode(event) for event in stored]
    for index, event in enumerate(events):
        if isinstance(event, PacketRetained):
            judged = events[index + 1]
            if isinstance(judged, VerdictRecorded):
                verdicts += 1
                decisions += 1
                where = f"position {stored[index].position}"
                differences += _verdict(runtime, judged, where)
                differences += _decision(mission, event, judged, events[index + 2], where)
        mission = DECIDER.apply(mission, event)
    if digest(mission) != digest(live):
        differences.append("the folded state differs from the live one")
    return ReplayReport(
        events=len(events),
        verdicts=verdicts,
        decisions=decisions,
        k=mission.k,
        state=digest(mission),
        differences=tuple(differences),
    )


def _verdict(runtime: Runtime, judged: VerdictRecorded, where: str) -> list[str]:
    context = decode(runtime.record(judged.verdict.context).body, Context)
    again = verify(context, runtime.blob)
    if digest(again) == digest(judged.verdict):
        return []
    return [f"{where}: the verdict was {judged.verdict.verdict}; derived again it is {again.verdict}"]


def _decision(mission: Mission, retained: PacketRetained, judged: VerdictRecorded, then: Any, where: str) -> list[str]:
    command = CompleteNode(packet=retained.packet, verdict=judged.verdict)
    moment = Moment(mission_s=retained.packet.collected_s, wall_s=0.0)
    again = DECIDER.decide(mission, command, moment)
    outcome = again.events[2] if isinstance(again, Accepted) else None
    if isinstance(then, NodeCommitted | CommitRejected) and outcome == then:
        return []
    return [f"{where}: the gate's decision differs: {msgspec.json.encode(then)!r} against {outcome}"]
