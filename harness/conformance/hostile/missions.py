"""Runs one mission against one lie and counts what it did: completions, motions, tracebacks, what stays held."""

import traceback
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import urlencode

from harness.adapters.clock import LockstepClock, SystemClock
from harness.adapters.ids import SystemIds
from harness.adapters.providers.http.exchange import BLOB_BYTES, Exchanges
from harness.adapters.providers.http.robot import HttpRobot
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.assembly import Harness, NullSignals, Parts, assemble, local_services
from harness.bootstrap import camera_of
from harness.conformance.hostile.lies import Mode
from harness.conformance.hostile.proxy import Answer, Ask, Forward, LocalRobotWire, LyingProxy, listening
from harness.conformance.hostile.truth import read_truth, untrue
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, HarnessError, ProviderFailed
from harness.contracts.events import DispatchIntended, InvocationEnded, MissionEvent, NodeCommitted, PacketRetained
from harness.contracts.ids import MissionId, ResourceId, RobotId
from harness.contracts.measurements import Sound
from harness.contracts.protocol import TERMINAL, PhysicalStart
from harness.contracts.reasons import because, plain
from harness.contracts.simulation import InProcessRobot, Simulator, TruePosition
from harness.contracts.values import Value, decode, encode
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from harness.provider_protocol import wire
from harness.provider_protocol.operations import Names, Operation, provider_operations
from harness.runtime import Start
from harness.settings import HarnessSettings

KIT = Actor(name="hostile provider kit", role="harness")
TOKEN = "hostile-provider-kit"
"""Of a loopback port of this process, open for one mission."""
SIMULATION_S = 120.0
LONGEST_S = 300.0
"""A mission of the kit that runs longer, wall seconds, hangs."""
TOKENS_A_SECOND = 100
"""More than a mission of the kit takes."""
REST_S = 10.0
"""Mission time in which a body that was stopped comes to rest."""
ROBOT = RobotId("vbot-1")


TruthOf = Callable[[MissionId], Sequence[TruePosition]]
"""Where the body truly was in a mission."""


class MissionUnderLie(Value):
    """What became of one mission under one lie.

    `ended`: its status, or the code of the error that kept it from beginning. `completed`: it succeeded.
    `false_completion`: it succeeded although the lie took its effects away, or something was accepted that was not so
    in the simulated world; `untrue` says what, and `against_truth` whether that was looked at.
    `second_motions`: motions begun while an earlier one was of unknown outcome or still had the body, and starts beyond
    the first of a request.
    `held`: it ended or waits with a lease neither free nor in quarantine.
    """

    mode: str
    group: str
    text: str
    ended: str
    why: str
    committed: tuple[str, ...]
    completed: bool
    false_completion: bool
    epistemic: bool
    untrue: str
    against_truth: bool
    motions: int
    second_motions: int
    hang: bool
    traceback: str
    held: tuple[str, ...]
    wall_s: float
    peak_mib: int

    @property
    def harmless(self) -> bool:
        """Whether the harness did nothing that it must not do."""
        return not (self.false_completion or self.second_motions or self.hang or self.traceback or self.held)


class _Course:
    """One mission on its way; filled in by the thread that runs it."""

    def __init__(self) -> None:
        self.harness: Harness | None = None
        self.mission: Mission | None = None
        self.refused: Any = None
        self.traceback = ""


def met(mode: Mode, simulator: Simulator, *, seed: int = 3) -> MissionUnderLie:
    """One mission against a simulated robot in this process, over HTTP, through the lie."""
    made = simulator.robot(ROBOT, seed=seed, fidelity="kinematic")
    return _met(mode, LocalRobotWire(_operations(made)), seed=seed, truth=lambda _: made.truth())


def met_at(mode: Mode, url: str, token: str, *, seed: int = 3, folder: Path | None = None) -> MissionUnderLie:
    """The same against the simulator at an address, which must run in lockstep; `folder` is where it writes the truth.

    Raises ProviderFailed for an address that serves no simulation: nothing is ever forwarded to a physical robot.
    """
    upstream = ForwardedRequests(url, token, raised_by=int(TOKENS_A_SECOND * _wall_s()))
    check_simulated(upstream, url)
    put_to_rest(upstream)
    return _met(
        mode,
        upstream,
        seed=seed,
        truth=(lambda mission_id: read_truth(folder, mission_id)) if folder is not None else None,
    )


class ForwardedRequests:
    """Requests passed on to a robot at an address. `raised_by` is added to the fencing tokens of starts: a log that is
    new counts from 1 again, and the robot refuses what is older than the tokens of the mission before.
    """

    def __init__(self, url: str, token: str, *, raised_by: int = 0) -> None:
        self._exchanges, self._raised_by = Exchanges(url, token, SIMULATION_S), raised_by

    def __call__(self, ask: Ask) -> Answer:
        query, body = f"?{urlencode(ask.query)}" if ask.query else "", ask.body
        if ask.kind == "start" and self._raised_by:
            start = ask.json()
            body = encode({**start, "fencing": {name: one + self._raised_by for name, one in start["fencing"].items()}})
        reply = self._exchanges.ask(ask.method, f"{ask.path}{query}", body, most_bytes=BLOB_BYTES)
        return Answer(status=reply.status, body=reply.body, content_type=reply.kind or "application/octet-stream")


def check_simulated(upstream: Forward, url: str) -> None:
    """Raises ProviderFailed unless a simulation in lockstep answers there."""
    struck, clock = upstream(Ask("GET", "/simulation/struck", {}, b"")), upstream(Ask("GET", "/clock", {}, b""))
    if not struck.ok or not clock.ok or clock.json()["speed"]:
        raise ProviderFailed(because("no_simulation_there", url=url))


def _met(mode: Mode, upstream: Forward, *, seed: int, truth: TruthOf | None) -> MissionUnderLie:
    course, began_s = _Course(), _wall_s()
    cards = upstream(Ask("GET", "/providers", {}, b"")).json()
    moving = frozenset(str(card["provider_id"]) for card in cards if card["moves"])
    with ExitStack() as stack:
        proxy = LyingProxy(upstream, mode.lie, moving=moving)
        url = stack.enter_context(listening(proxy))
        thread = Thread(target=_guarded, args=(course, mode, url, proxy, stack, seed), daemon=True)
        thread.start()
        thread.join(LONGEST_S)
        hang = thread.is_alive()
        proxy.armed = False
        starts = decode(upstream(Ask("GET", "/starts", {}, b"")).body, list[PhysicalStart])
        return _counted(mode, course, proxy, starts, truth=truth, hang=hang, wall_s=_wall_s() - began_s)


def put_to_rest(upstream: Forward) -> None:
    """Stop what an earlier mission left under way, so that the next one at the same simulation can move."""
    starts = decode(upstream(Ask("GET", "/starts", {}, b"")).body, list[PhysicalStart])
    for request in dict.fromkeys(one.request_id for one in starts if one.moves):
        found = upstream(Ask("GET", f"/requests/{request}", {}, b""))
        if found.ok and found.json()["status"] not in TERMINAL:
            upstream(Ask("POST", f"/invocations/{found.json()['handle']}/stop", {}, b""))
    at_s = float(upstream(Ask("GET", "/clock", {}, b"")).json()["at_s"])
    upstream(Ask("POST", "/simulation/advance", {}, encode(wire.Advance(until_s=at_s + REST_S))))


def _guarded(course: _Course, mode: Mode, url: str, proxy: LyingProxy, stack: ExitStack, seed: int) -> None:
    try:
        _run(course, mode, url, proxy, stack, seed)
    except HarnessError as error:
        course.refused = error
    except Exception:  # noqa: BLE001 - an untyped error is what the kit looks for
        course.traceback = traceback.format_exc()


def _run(course: _Course, mode: Mode, url: str, proxy: LyingProxy, stack: ExitStack, seed: int) -> None:
    robot, simulation = HttpRobot(url, TOKEN, mode.patience_s), HttpRobot(url, TOKEN, SIMULATION_S)
    stack.callback(robot.close)
    stack.callback(simulation.close)
    parts = Parts(
        store=MemoryEventStore(),
        blobs=MemoryBlobStore(),
        spool=MemorySpool(),
        ids=SystemIds(),
        clock=LockstepClock(simulation.advance, at_s=simulation.clock().at_s),
        signals=NullSignals(),
    )
    beside = local_services(parts, camera=camera_of(robot), folder=None, room=simulation)
    course.harness = harness = assemble(
        stack,
        HarnessSettings(speed=0, fidelity="kinematic", robot_id=ROBOT),
        parts,
        robot=robot,
        local=beside.providers,
        sources=beside.sources,
        configure=lambda mission: simulation.configure(mission.mission_id, mission.seed),
    )
    if mode.second:
        harness.supervisor.run(_started(harness, mode, seed=seed))
    mission_id = _started(harness, mode, seed=seed + mode.second)
    proxy.armed = True
    course.mission = harness.supervisor.run(mission_id)


def _started(harness: Harness, mode: Mode, *, seed: int) -> MissionId:
    before = {one.mission_id for one in harness.runtime.missions()}
    decision = harness.runtime.start(Start(actor=KIT, robot_id=ROBOT, template=mode.template, seed=seed))
    if isinstance(decision, Refused):
        raise ContractInvalid(decision.reason)
    return next(one.mission_id for one in harness.runtime.missions() if one.mission_id not in before)


def _counted(
    mode: Mode,
    course: _Course,
    proxy: LyingProxy,
    starts: list[PhysicalStart],
    *,
    truth: TruthOf | None,
    hang: bool,
    wall_s: float,
) -> MissionUnderLie:
    mission, harness = course.mission, course.harness
    completed = mission is not None and mission.status == "succeeded"
    untrue = _untrue(harness, mission, truth)
    false = (completed and not mode.may_succeed) or bool(untrue)
    why = mission.reason if mission is not None else course.refused.reason if course.refused else ""
    ended = mission.status if mission is not None else course.refused.code if course.refused else "none"
    mine = [one for one in starts if mission is not None and one.mission_id == mission.mission_id and one.moves]
    return MissionUnderLie(
        mode=mode.name,
        group=mode.group,
        text=mode.text,
        ended="hang" if hang else ended,
        why=plain(why)[:300],
        committed=_committed(harness, mission),
        completed=completed,
        false_completion=false and not mode.undetectable,
        epistemic=false and mode.undetectable,
        untrue=untrue,
        against_truth=truth is not None,
        motions=len(mine),
        second_motions=len(mine)
        - len({one.request_id for one in mine})
        + proxy.seen.overlapping
        + after_unknown(_events(harness, mission)),
        hang=hang,
        traceback=course.traceback,
        held=_open_leases(harness, mission),
        wall_s=round(wall_s, 2),
        peak_mib=peak_memory_mib(),
    )


def _untrue(harness: Harness | None, mission: Mission | None, truth: TruthOf | None) -> str:
    if truth is None or mission is None or mission.contract is None:
        return ""
    return "; ".join(untrue(mission.contract, _events(harness, mission), truth(mission.mission_id)))


def peak_memory_mib() -> int:
    """The most memory that this process held since its program began, MiB; what started it does not count."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:"))) >> 10


def _wall_s() -> float:
    return SystemClock().now().wall_s


def _events(harness: Harness | None, mission: Mission | None) -> list[MissionEvent]:
    if harness is None or mission is None:
        return []
    return [DECIDER.codec.decode(event) for event in harness.runtime.events(mission.mission_id)]


def _committed(harness: Harness | None, mission: Mission | None) -> tuple[str, ...]:
    return tuple(event.node_id for event in _events(harness, mission) if isinstance(event, NodeCommitted))


def after_unknown(events: Sequence[MissionEvent]) -> int:
    """Motions that were authorised while another one's outcome was unknown: until its end was reported after all."""
    unknown, found = False, 0
    for event in events:
        found += unknown and isinstance(event, DispatchIntended) and event.moves
        unknown = unknown and not isinstance(event, PacketRetained)
        unknown = unknown or (isinstance(event, InvocationEnded) and event.status == "outcome_unknown")
    return found


def _open_leases(harness: Harness | None, mission: Mission | None) -> tuple[str, ...]:
    """Leases that nobody uses any more and that are neither free nor in quarantine."""
    if harness is None or mission is None:
        return ()
    streams = harness.runtime.streams("lease/")
    leases = [harness.runtime.lease(ResourceId(stream.partition("/")[2])) for stream in streams]
    return tuple(str(one.resource) for one in leases if one.status == "held")


def _operations(made: InProcessRobot) -> tuple[Operation, ...]:
    """What a simulated robot serves that runs in lockstep in this process."""
    reached = [made.at_s]

    def clock(names: Names, body: None) -> wire.ClockReading:
        return wire.ClockReading(at_s=reached[0], speed=0.0, monotonic_s=_wall_s())

    def advance(names: Names, body: wire.Advance) -> wire.Done:
        reached[0] = made.advance_to(body.until_s)
        return wire.Done(at_s=reached[0])

    def configure(names: Names, body: wire.MissionSettings) -> wire.Done:
        made.configure(body.mission_id, body.seed, body.faults)
        return wire.Done(at_s=reached[0])

    def play(names: Names, body: Sound) -> wire.Done:
        made.room.play(body)
        return wire.Done(at_s=reached[0])

    def recording(names: Names, body: None) -> bytes:
        return made.room.recording(float(names["from_s"]), float(names["until_s"]))

    return (
        *provider_operations(made.robot),
        Operation("GET", "/clock", "Mission time", wire.ClockReading, clock),
        Operation("POST", "/simulation/advance", "Run on", wire.Done, advance, body=wire.Advance),
        Operation("POST", "/simulation/configure", "Begin", wire.Done, configure, body=wire.MissionSettings),
        Operation("POST", "/simulation/room/sound", "A loudspeaker plays", wire.Done, play, body=Sound),
        Operation("GET", "/simulation/room/recording", "What is heard", bytes, recording),
    )
