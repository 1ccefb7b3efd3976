"""Lets sixteen people answer the same question at once, and checks that one answer is accepted, by events and by
physical starts.

There are two kinds of round. In `answer_rounds` a real mission waits at a handoff, on the SQL log, and threads answer
through the runtime. In `append_rounds` every responder has its own gate and connection on one file, as separate
processes would: only the log's expected version keeps them apart.
"""

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from msgspec.structs import replace

from harness.adapters.clock import LockstepClock
from harness.adapters.stores.sql import SqlEventStore
from harness.bootstrap import DECIDERS, Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.commands import ApproveHandoff, HandoffCommand, OpenHandoff, RefreshHandoff
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.handoff_events import ProposedAction, Snapshot
from harness.contracts.ids import Digest, HandoffId, MissionId, NodeId, ProviderId, RobotId, handoff_stream
from harness.contracts.reasons import plain
from harness.contracts.values import Value, digest
from harness.gate.commit import CommandEnvelope, Gate
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

T = TypeVar("T")
RESPONDERS = 16
PERSISTENT = "stale-pose:persistent"
NOW_S = 1_790_000_000.0
NOTHING = Digest("0" * 64)
JOIN_S = 60.0
PER_MISSION = 5
"""Rounds before the next mission: nobody approves the same failing stage a dozen times."""


class RaceReport(Value):
    """The result of the races. `effective`: rounds in which somebody's answer was accepted."""

    rounds: int
    effective: int
    responders: int
    offences: tuple[str, ...]


def races(*, answers: int, appends: int, seed: int) -> RaceReport:
    """Both kinds of rounds in one report."""
    first, second = answer_rounds(answers, seed=seed), append_rounds(appends)
    return RaceReport(
        rounds=first.rounds + second.rounds,
        effective=first.effective + second.effective,
        responders=RESPONDERS,
        offences=(*first.offences, *second.offences),
    )


def answer_rounds(rounds: int, *, seed: int) -> RaceReport:
    """Each round is a handoff of a mission whose localiser stays stale; an approval starts exactly one attempt."""
    offences: list[str] = []
    effective = 0
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="races-")))
        store = SqlEventStore(f"sqlite:///{folder / 'log.db'}")
        stack.callback(store.close)
        harness = stack.enter_context(
            simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=seed, store=store)
        )
        mission_id: MissionId | None = None
        for number in range(rounds):
            if mission_id is None or number % PER_MISSION == 0 or harness.runtime.mission(mission_id).ended:
                mission_id = _start_mission(harness, seed + number)
            harness.supervisor.run(mission_id)
            wrong, taken = _answered(harness, mission_id)
            effective += taken
            offences += [f"answer round {number}: {sentence}" for sentence in wrong]
    return RaceReport(rounds=rounds, effective=effective, responders=RESPONDERS, offences=tuple(offences))


def append_rounds(rounds: int) -> RaceReport:
    """Each round is a fresh handoff; every third one was asked again meanwhile, so that old answers must be refused."""
    offences: list[str] = []
    effective = 0
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="races-")))
        gates = opened_gates(stack, folder)
        for number in range(rounds):
            wrong, taken = _appended(gates, number)
            effective += taken
            offences += [f"append round {number}: {sentence}" for sentence in wrong]
    return RaceReport(rounds=rounds, effective=effective, responders=RESPONDERS, offences=tuple(offences))


def opened_gates(stack: ExitStack, folder: Path, *, wall_s: Sequence[float] = (NOW_S,)) -> list[Gate]:
    """One gate with its own connection for every responder, as separate processes would have.

    `wall_s`: the readings of their clocks, in turn.
    """
    gates = []
    for number in range(RESPONDERS):
        store = SqlEventStore(f"sqlite:///{folder / 'log.db'}")
        stack.callback(store.close)
        now_s = wall_s[number % len(wall_s)]
        clock = LockstepClock(lambda until_s: until_s, at_s=now_s, wall=partial(_same, now_s))
        gates.append(Gate(store=store, clock=clock, deciders=DECIDERS))
    return gates


def _same(now_s: float) -> float:
    """A clock that stands still."""
    return now_s


def _start_mission(harness: Harness, seed: int) -> MissionId:
    start = Start(
        actor=person(0), robot_id=RobotId("vbot-1"), template="circuit", seed=seed, labels={"faults": PERSISTENT}
    )
    decision = harness.runtime.start(start)
    if isinstance(decision, Refused):
        raise RuntimeError(plain(decision.reason))
    return harness.runtime.missions()[0].mission_id


def _answered(harness: Harness, mission_id: MissionId) -> tuple[list[str], bool]:
    """One round at a waiting mission: what went wrong, and whether any answer was accepted."""
    mission = harness.runtime.mission(mission_id)
    if mission.handoff_id is None:
        return [f"the mission is {mission.status} and asks nobody"], False
    handoff = harness.runtime.handoff(mission.handoff_id)
    before = len(harness.starts(mission_id))

    def answer(number: int) -> Any:
        opened = handoff.opened
        return harness.supervisor.answer(
            handoff.handoff_id,
            ApproveHandoff(
                actor=person(number),
                reason="go on",
                key=f"key-{number}",
                cycle=handoff.cycle,
                subject=opened.subject if opened else NOTHING,
                evidence=opened.evidence if opened else NOTHING,
            ),
        )

    winners = [decision for decision in together(answer) if isinstance(decision, Accepted) and decision.events]
    harness.supervisor.run(mission_id)
    started = len(harness.starts(mission_id)) - before
    kinds = [
        event.kind
        for event in harness.runtime.log(limit=1_000_000)
        if event.stream == handoff_stream(handoff.handoff_id)
    ]
    wrong = [] if len(winners) == 1 else [f"{len(winners)} answers were taken"]
    wrong += [] if kinds.count("HandoffApproved") == 1 else [f"{kinds.count('HandoffApproved')} approvals in the log"]
    moved = started - _recovery_starts(harness, mission_id, before)
    wrong += [] if moved == 1 else [f"the approval led to {moved} physical starts"]
    return wrong, bool(winners)


def _recovery_starts(harness: Harness, mission_id: MissionId, before: int) -> int:
    """Starts after the round that no approval paid for: observing steps of the ladder."""
    return sum(not start.moves for start in harness.starts(mission_id)[before:])


def _appended(gates: Sequence[Gate], number: int) -> tuple[list[str], bool]:
    handoff_id = HandoffId(f"hof_race_{number}")
    handoff = opening(handoff_id)
    gates[0].commit([CommandEnvelope(handoff_stream(handoff_id), handoff, None)])
    if number % 3 == 0:
        again = RefreshHandoff(
            k=handoff.k, proposal=handoff.proposal, snapshot=handoff.snapshot, evidence=handoff.evidence
        )
        gates[1].commit([CommandEnvelope(handoff_stream(handoff_id), again, None)])

    def approve(responder: int) -> Any:
        old = number % 3 == 0 and responder % 2 == 0
        command = approval(handoff, responder, cycle=1 if number % 3 or old else 2)
        return gates[responder].commit([CommandEnvelope(handoff_stream(handoff_id), command, None)])

    decisions = together(approve)
    winners = [at for at, decision in enumerate(decisions) if isinstance(decision, Accepted) and decision.events]
    wrong = [] if len(winners) == 1 else [f"{len(winners)} answers were taken"]
    if number % 3 == 0 and any(winner % 2 == 0 for winner in winners):
        wrong.append("an answer to a question that had changed was taken")
    state = gates[0].state(handoff_stream(handoff_id))
    wrong += [] if state.status == "approved" else [f"the handoff ends {state.status}"]
    return wrong, bool(winners)


def together(act: Callable[[int], T]) -> list[T]:
    """The result of each responder, all released at the same moment. Raises what one of them raised."""
    barrier = threading.Barrier(RESPONDERS)
    got: dict[int, T] = {}
    broken: list[BaseException] = []

    def one(number: int) -> None:
        try:
            barrier.wait(JOIN_S)
            got[number] = act(number)
        except BaseException as error:  # noqa: BLE001 - carried to the caller's thread
            broken.append(error)

    threads = [threading.Thread(target=one, args=(number,)) for number in range(RESPONDERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(JOIN_S)
    if broken:
        raise broken[0]
    return [got[number] for number in range(RESPONDERS)]


def person(number: int) -> Actor:
    """One of the responders."""
    return Actor(name=f"responder-{number}", role="operator")


def opening(handoff_id: HandoffId) -> OpenHandoff:
    """A question like any other."""
    mission_id, node_id = MissionId("mis_race"), NodeId("go")
    proposal = ProposedAction(
        mission_id=mission_id,
        node_id=node_id,
        attempt=2,
        action="retry",
        provider_id=ProviderId("route-follower"),
        provider_version="1.0.0",
        parameters={},
        configuration=NOTHING,
        graph_revision=0,
        limits={},
        spends=0,
    )
    snapshot = Snapshot(
        at_s=NOW_S, taken_at_s=NOW_S, x_m=0.0, y_m=0.0, yaw_rad=0.0, static=True, results=NOTHING, image=None
    )
    return OpenHandoff(
        handoff_id=handoff_id,
        mission_id=mission_id,
        robot_id=RobotId("vbot-1"),
        node_id=node_id,
        k=3,
        failure="violated",
        reason="it did not arrive",
        risk="medium",
        proposal=proposal,
        snapshot=snapshot,
        evidence=NOTHING,
        no_answer="hold",
        deadline_at_s=NOW_S + 900.0,
    )


def approval(handoff: OpenHandoff, responder: int, *, cycle: int) -> HandoffCommand:
    """This responder's approval of the question, on what was shown in that cycle."""
    return ApproveHandoff(
        actor=person(responder),
        reason="go on",
        key=f"key-{responder}",
        cycle=cycle,
        subject=digest(handoff.proposal),
        evidence=handoff.evidence,
        k=handoff.k,
        fresh=replace(handoff.snapshot),
    )
