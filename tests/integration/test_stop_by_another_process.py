"""Another process stops or pauses a mission at any moment of a step: it is met before anything starts."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from random import Random

import pytest

from experiments.benchmarks.noop import OPERATOR, NoopHarness, log_url, noop_harness, template
from harness.adapters.clock import LockstepClock
from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.commands import MissionCommand, PauseMission, StopMission
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId, RobotId, mission_stream
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.gate.commit import CommandEnvelope, Gate
from harness.gate.decide import DECIDER

ROUNDS = 1000
ROBOT = RobotId("noop-0")
WHY = because("stopped_by", actor="ada", reason="now")
ORDERS: tuple[Callable[[], MissionCommand], ...] = (
    lambda: StopMission(actor=OPERATOR, reason=WHY),
    lambda: PauseMission(actor=OPERATOR, reason=WHY),
)


class Interruption:
    """Lets another process write at the n-th time that the harness asks for the time: between any two of its acts."""

    def __init__(self) -> None:
        self.left = -1
        self.write: Callable[[], bool] = lambda: False
        self.done = False

    def plan(self, moment: int, write: Callable[[], bool]) -> None:
        self.left, self.write, self.done = moment, write, False

    def tick(self) -> None:
        self.left -= 1
        if self.left == 0:
            self.done = self.write()


@contextmanager
def interrupted(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[NoopHarness, Interruption, list[bool]]]:
    """A no-op harness with an interruption; the list holds, for each start, whether the order stood in the log."""
    interruption, starts = Interruption(), list[bool]()
    now = LockstepClock.now

    def ticking(clock: LockstepClock) -> Moment:
        interruption.tick()
        return now(clock)

    monkeypatch.setattr(LockstepClock, "now", ticking)
    with noop_harness(folder, began=lambda: starts.append(interruption.done)) as noop:
        yield noop, interruption, starts


def other_gate(store: SqlEventStore) -> Gate:
    """The gate of another process, with folds of its own."""
    return Gate(store=store, clock=LockstepClock(lambda until_s: until_s, at_s=0.0), deciders={"mission": DECIDER})


def ordered(gate: Gate, mission_id: MissionId, command: MissionCommand) -> bool:
    """Whether the order now stands in the log: a mission that has not begun, or is over, is not paused or stopped."""
    return isinstance(gate.commit([CommandEnvelope(mission_stream(mission_id), command, None)]), Accepted)


def test_in_a_thousand_races_nothing_starts_after_an_order_stands_in_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chance, met = Random(15), 0
    with (
        interrupted(tmp_path, monkeypatch) as (noop, interruption, starts),
        closing(SqlEventStore(log_url(tmp_path))) as theirs,
    ):
        gate, short = other_gate(theirs), template(ROBOT, stages=1)
        for _ in range(ROUNDS):
            mission_id, command = noop.begin(ROBOT, shape=short), chance.choice(ORDERS)()
            starts.clear()
            interruption.plan(chance.randint(1, 60), partial(ordered, gate, mission_id, command))
            noop.supervisor.run(mission_id)
            assert not any(starts), "a start after the order stood in the log"
            kinds = [event.kind for event in theirs.load(mission_stream(mission_id))]
            asked = [number for number, kind in enumerate(kinds) if kind in ("StopRequested", "MissionPaused")]
            met += bool(asked)
            assert not asked or "DispatchIntended" not in kinds[asked[0] :]
            interruption.plan(-1, lambda: False)
            if "MissionPaused" in kinds:
                noop.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason=WHY))
                noop.supervisor.run(mission_id)
    assert met > ROUNDS // 4
