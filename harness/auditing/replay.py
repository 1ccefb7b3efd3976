"""Replays missions for an auditor: folds, derives and decides again, and lists every difference. Moves no robot (R145).

Every decision is made again from the command that was stored with it. In a log from before commands were stored they
are inferred from the events, and the report says how many. Randomness has no part in a decision; a model's output is
read from storage, never sampled again (R146).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec
from msgspec.structs import replace

from harness.auditing import legacy, legacy_neighbours
from harness.auditing.commands import CommandUnreadable, command_at, tokens_in
from harness.auditing.outcomes import OutcomeLog
from harness.auditing.prose import is_old, same
from harness.auditing.roles import RoleReplay
from harness.contracts import ids, values
from harness.contracts.commands import HandoffCommand, LeaseCommand, MissionCommand
from harness.contracts.decider import Decider
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.errors import ContractInvalid, LogDamaged
from harness.contracts.events import ContractCompiled, MissionEvent
from harness.contracts.ports import StoredEvent
from harness.contracts.reasons import Reason, because
from harness.contracts.stored_commands import command_of
from harness.gate.decide import DECIDER
from harness.gate.handoffs import DECIDER as HANDOFF
from harness.gate.leases import DECIDER as LEASE
from harness.projections.mission import Mission
from harness.runtime import Runtime


class ReplayReport(values.Value):
    """What was derived again, counted, and every difference with its position. `state`: digest of the folded mission.

    `unanswered` verdicts were given by nobody and cannot be derived; `decisions` are the gate's on the mission,
    `leases` and `handoffs` those on its resources and questions; `targets` and `maps` are those of an exploration.
    `reconstructed`: how many of these decisions had no stored command, so that it was inferred from their events.
    `erased`: how many verdicts cannot be derived again, because voice or photographs that they rest on were erased.
    """

    mission_id: ids.MissionId
    events: values.Count
    plans: values.Count
    routings: values.Count
    skills: values.Count
    verdicts: values.Count
    unanswered: values.Count
    recoveries: values.Count
    goals: values.Count
    decisions: values.Count
    leases: values.Count
    handoffs: values.Count
    k: values.Count
    state: ids.Digest
    differences: tuple[Reason, ...]
    targets: values.Count = 0
    maps: values.Count = 0
    reconstructed: values.Count = 0
    erased: values.Count = 0


@dataclass
class _Replay:
    """One mission being derived again."""

    runtime: Runtime
    differences: list[Reason] = field(default_factory=list)
    old: bool = False
    reconstructed: int = 0
    storing: set[ids.StreamId] = field(default_factory=set)

    def differ(self, stored: StoredEvent, difference: Reason) -> None:
        self.differences.append(
            because(
                "audit_difference",
                position=stored.position,
                stream=stored.stream,
                kind=stored.kind,
                difference=difference,
            )
        )

    def compare(self, stream: ids.StreamId, folded: Any, live: Any) -> None:
        """Report a stream whose folded state is not the live one."""
        if values.encode(folded) != values.encode(live):
            difference = because("audited_state_differs")
            self.differences.append(because("audit_difference_of_stream", stream=stream, difference=difference))

    def command(self, tail: Sequence[StoredEvent], union: Any, tokens: Iterable[str] = ()) -> tuple[bool, Any]:
        """Whether these events name the command they answered, and the command; None where it cannot be read."""
        first = tail[0]
        try:
            command = command_at(self.runtime, tail, union, tokens=tokens)
        except CommandUnreadable as unreadable:
            self.differ(first, unreadable.reason)
            return True, None
        if command is not None:
            self.storing.add(first.stream)
            return True, command
        if first.stream in self.storing:
            self.differ(first, because("audited_command_missing"))
            return True, None
        self.reconstructed += 1
        return False, None


def outcomes_of(runtime: Runtime) -> OutcomeLog:
    """The outcomes of the whole log, read as far as they are asked for."""
    return OutcomeLog(
        read=runtime.log,
        stream=runtime.stream,
        same_contract=runtime.memory.of_same_contract,
    )


def replay_mission(
    runtime: Runtime, mission_id: ids.MissionId, *, outcomes: OutcomeLog | None = None, alone: bool = False
) -> ReplayReport:
    """Reconstruct progress from the log and derive again every decision from what was stored with it.

    `outcomes`: those of the log, where several missions are replayed. `alone`: the log holds this mission only, so that
    what its providers achieved in others cannot be derived. Raises UnknownName for a mission that does not exist.
    """
    live = runtime.mission(mission_id)
    replay = _Replay(runtime)
    roles = RoleReplay(runtime, outcomes=None if alone else outcomes or outcomes_of(runtime))
    stored = runtime.events(mission_id)
    mission, decisions = _mission(replay, roles, stored)
    replay.compare(ids.mission_stream(mission_id), mission, live)
    leases = sum(_leases(replay, stream, mission_id) for stream in runtime.streams("lease/"))
    handoffs = sum(_handoff(replay, stream, mission_id) for stream in runtime.streams("handoff/"))
    return ReplayReport(
        mission_id=mission_id,
        events=len(stored),
        **roles.derived,
        decisions=decisions,
        leases=leases,
        handoffs=handoffs,
        k=mission.k,
        state=values.digest(mission),
        differences=tuple(replay.differences),
        reconstructed=replay.reconstructed,
    )


def replay_all(runtime: Runtime) -> Iterator[ReplayReport]:
    """Every mission of the log, oldest first."""
    outcomes = outcomes_of(runtime)
    for stream in runtime.streams("mission/"):
        yield replay_mission(runtime, ids.MissionId(stream.partition("/")[2]), outcomes=outcomes)


def _mission(replay: _Replay, roles: RoleReplay, stored: Sequence[StoredEvent]) -> tuple[Mission, int]:
    """The mission folded from zero, and how many of the gate's decisions were made again."""
    mission, decisions = Mission(), 0
    replay.old = roles.old = is_old(one.body for one in stored)
    events = _decoded(replay, DECIDER, stored)
    expected: list[MissionEvent] = []
    differing = False
    for index, event in enumerate(events):
        if expected and command_of(stored[index]) is not None:
            replay.differ(stored[index], because("audited_event_not_stored", event=type(expected[0]).__name__))
            expected = []
        if not expected:
            expected, differing = _decided(replay, mission, events[index:], stored[index:]), False
            decisions += 1
        derived = _as_written(expected.pop(0), stored[index]) if expected else None
        if derived is not None and not differing and not same(derived, event, old=replay.old):
            difference = because("audited_gate_differs", derived=_short(derived), stored=_short(event))
            replay.differ(stored[index], difference)
            differing = True
        for difference in roles.differences(mission, event):
            replay.differ(stored[index], difference)
        mission = DECIDER.apply(mission, event)
    for left in expected:
        replay.differ(stored[-1], because("audited_last_event_not_stored", event=type(left).__name__))
    return mission, decisions


class _ContractBody(msgspec.Struct):
    contract: msgspec.Raw


def _as_written(derived: MissionEvent, stored: StoredEvent) -> MissionEvent:
    """A contract's digest covers the bytes as they were written: an earlier release may have written fewer fields."""
    if not isinstance(derived, ContractCompiled) or stored.kind != type(derived).__name__:
        return derived
    written = ids.sha256(bytes(msgspec.json.decode(stored.body, type=_ContractBody).contract))
    return replace(derived, contract_digest=written)


def _decided(
    replay: _Replay, mission: Mission, tail: Sequence[MissionEvent], stored_tail: Sequence[StoredEvent]
) -> list[MissionEvent]:
    """The events of the gate's new decision on the command that these events answered."""
    stored = stored_tail[0]
    present, command = replay.command(stored_tail, MissionCommand)
    if not present:
        command = legacy.guessed_command(tail)
        if command is None:
            replay.differ(stored, because("audited_event_unexplained"))
    if command is None:
        return []
    now = values.Moment(mission_s=stored.mission_s, wall_s=stored.recorded_s)
    try:
        decision = DECIDER.decide(mission, command, now)
    except (ContractInvalid, KeyError, ValueError) as error:
        what = error.located if isinstance(error, ContractInvalid) else str(error)
        replay.differ(stored, because("audited_gate_undecided", command=type(command).__name__, error=what))
        return []
    return _accepted(replay, decision, stored)


def _accepted(replay: _Replay, decision: Decision[Any], stored: StoredEvent) -> list[Any]:
    match decision:
        case Refused():
            replay.differ(stored, because("audited_gate_refuses", rule=decision.rule, reason=decision.reason))
            return []
        case Accepted():
            return list(decision.events)


def _leases(replay: _Replay, stream: ids.StreamId, mission_id: ids.MissionId) -> int:
    """The lease decisions on one resource; counts and reports those about this mission."""
    lease, decisions = LEASE.initial, 0
    stored = replay.runtime.stream(stream)
    for index, event in enumerate(_decoded(replay, LEASE, stored)):
        after, one = LEASE.apply(lease, event), stored[index]
        if after.mission_id == mission_id:
            present, command = replay.command(stored[index:], LeaseCommand)
            command = command if present else legacy_neighbours.asked_of_lease(event)
            decisions += 1
            now = values.Moment(mission_s=one.mission_s, wall_s=one.recorded_s)
            if command is not None:
                _same(replay, _accepted(replay, LEASE.decide(lease, command, now), one), event, one)
        lease = after
    replay.compare(stream, lease, replay.runtime.lease(ids.ResourceId(stream.partition("/")[2])))
    return decisions


def _handoff(replay: _Replay, stream: ids.StreamId, mission_id: ids.MissionId) -> int:
    """The decisions at one handoff, if it is this mission's."""
    live = replay.runtime.handoff(ids.HandoffId(stream.partition("/")[2]))
    if live.opened is None or live.opened.mission_id != mission_id:
        return 0
    handoff, decisions = HANDOFF.initial, 0
    stored = replay.runtime.stream(stream)
    for index, event in enumerate(_decoded(replay, HANDOFF, stored)):
        one = stored[index]
        tokens = [*tokens_in(event), *([handoff.claim.claim] if handoff.claim else [])]
        present, command = replay.command(stored[index:], HandoffCommand, tokens)
        wall_s: float | None = one.recorded_s
        if not present:
            command, wall_s = legacy_neighbours.asked_of_handoff(handoff, event) or (None, None)
        decisions += 1
        now = values.Moment(mission_s=one.mission_s, wall_s=one.recorded_s if wall_s is None else wall_s)
        if command is not None:
            _same(replay, _accepted(replay, HANDOFF.decide(handoff, command, now), one), event, one)
        handoff = HANDOFF.apply(handoff, event)
    replay.compare(stream, handoff, live)
    return decisions


def _same(replay: _Replay, derived: list[Any], event: Any, stored: StoredEvent) -> None:
    if derived and (len(derived) != 1 or not same(derived[0], event, old=replay.old)):
        difference = because("audited_event_differs", derived=_short(derived[0]), stored=_short(event))
        replay.differ(stored, difference)


def _decoded(replay: _Replay, decider: Decider[Any, Any, Any], stored: Sequence[StoredEvent]) -> list[Any]:
    """The events up to the first that cannot be read."""
    events = []
    for one in stored:
        try:
            events.append(decider.codec.decode(one))
        except LogDamaged as error:
            replay.differ(one, because("audited_event_unreadable", reason=error.located))
            break
    return events


def _short(event: Any) -> str:
    return values.encode(event).decode()[:160]
