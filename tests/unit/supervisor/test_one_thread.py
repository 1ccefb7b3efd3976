"""Robots of this process are stepped by one thread; none of them waits for another's robot or for its questions."""

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from threading import Event, Thread
from threading import enumerate as threads

from experiments.benchmarks.noop import NoopHarness, noop_harness
from harness.contracts.ids import MissionId, RobotId
from harness.supervisor.supervisor import Supervisor

PATIENCE_S = 60.0
FIRST, SECOND = RobotId("noop-0"), RobotId("noop-1")


def until(true: Callable[[], bool]) -> None:
    latest_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < latest_s, "the missions did not get there"
        time.sleep(0.005)


def ended(noop: NoopHarness, mission_id: MissionId) -> bool:
    return noop.runtime.mission(mission_id).status == "succeeded"


def test_one_thread_runs_the_missions_of_all_robots_of_this_process_in_turns(tmp_path: Path) -> None:
    with noop_harness(tmp_path, robots=3) as noop:
        begun = [noop.begin(robot_id) for robot_id in noop.providers for _ in range(2)]
        before = threads()
        noop.supervisor.serve()
        serving = [one.name for one in threads() if one not in before]
        assert [name for name in serving if name.startswith("robot ")] == ["robot noop-0 noop-1 noop-2"]
        until(lambda: all(ended(noop, mission_id) for mission_id in begun))
        dispatched = [event.stream for event in noop.runtime.log(0, 10_000) if event.kind == "DispatchIntended"]
    robots = {f"mission/{mission_id}": number % 3 for number, mission_id in enumerate(begun)}
    assert len(dispatched) == 42 and len(robots) == 6
    assert len(set(dispatched[:9])) == 3, "each robot had its turn before any had its fourth"


def test_a_robot_that_a_person_keeps_busy_does_not_hold_up_the_others(tmp_path: Path) -> None:
    with noop_harness(tmp_path, robots=2) as noop:
        first, second = noop.begin(FIRST), noop.begin(SECOND)
        answering, answered = Event(), Event()

        def answer() -> None:
            with noop.supervisor._turn_of(FIRST):
                answering.set()
                assert answered.wait(PATIENCE_S)

        person = Thread(target=answer)
        person.start()
        assert answering.wait(PATIENCE_S)
        noop.supervisor.serve()
        until(lambda: ended(noop, second))
        assert not noop.runtime.mission(first).ended
        answered.set()
        person.join()
        until(lambda: ended(noop, first))


def test_a_mission_that_begins_later_is_found_by_the_same_thread(tmp_path: Path) -> None:
    with noop_harness(tmp_path, robots=2) as noop, closing(noop.supervisor):
        noop.supervisor.serve()
        for robot_id in (FIRST, SECOND, FIRST):
            mission_id = noop.begin(robot_id)
            until(lambda mission_id=mission_id: ended(noop, mission_id))  # type: ignore[misc]
        assert isinstance(noop.supervisor, Supervisor)
