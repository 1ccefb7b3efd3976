"""A slow machine slows a mission, it does not fail it: the robot's process gets a fraction of the time it needs."""

import json
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import pytest

from tests.integration.runs import start, starts, until

STOPPED_S, RUNS_S = 0.12, 0.06


@contextmanager
def slowed(pid: int) -> Iterator[None]:
    """The process is stopped and let run in turn: as on a machine that has other things to do."""
    over = Event()

    def turns() -> None:
        while not over.is_set():
            for sign, seconds in ((signal.SIGSTOP, STOPPED_S), (signal.SIGCONT, RUNS_S)):
                try:
                    os.kill(pid, sign)
                except ProcessLookupError:
                    return
                time.sleep(seconds)

    thread = Thread(target=turns)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.long
def test_a_mission_at_four_times_real_time_succeeds_on_a_robot_that_cannot_reach_it(tmp_path: Path) -> None:
    fast = ("--speed", "4", "--fidelity", "kinematic", "--json")
    harness = start("mission", "run", "circuit", "--data", tmp_path, *fast)
    attachment = tmp_path / "robots" / "vbot-1" / "robot.json"
    until(lambda: attachment.exists() and attachment.read_text().endswith("}"), seconds=100, what="the robot's process")
    with slowed(json.loads(attachment.read_text())["pid"]):
        printed, told = harness.communicate(timeout=400)
    assert harness.returncode == 0, told
    outcome = json.loads(printed)
    assert outcome["status"] == "succeeded"
    assert (outcome["recovery"]["spent"], outcome["duplicate_starts"]) == (0, 0)
    assert len({line["request_id"] for line in starts(tmp_path)}) == len(starts(tmp_path))
