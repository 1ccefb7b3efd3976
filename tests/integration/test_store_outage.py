"""The database goes away in the middle of a leg: the robot stands, nothing is ended, and the mission goes on after."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from harness.bootstrap import Harness, open_harness
from harness.contracts.actors import Actor
from harness.contracts.ids import MissionId, RobotId
from harness.contracts.protocol import PhysicalStart
from harness.runtime import Start
from harness.settings import HarnessSettings
from tests.integration.runs import truth, until
from tools.postgres import PostgresServer, running_server

pytestmark = pytest.mark.xdist_group("postgres")


@pytest.fixture
def server() -> Iterator[PostgresServer]:
    with running_server() as server:
        yield server


def moving(data: Path) -> bool:
    return any(line["kind"] == "pose" and line["v_mps"] > 0.3 for line in truth(data)[-3:])


def begun(harness: Harness) -> MissionId:
    decision = harness.runtime.start(
        Start(actor=Actor(name="ada", role="operator"), robot_id=RobotId("vbot-1"), template="circuit", seed=1)
    )
    harness.supervisor.serve()
    return MissionId(decision.events[0].mission_id)  # type: ignore[union-attr]


@pytest.mark.long
def test_a_mission_outlives_its_database(tmp_path: Path, server: PostgresServer) -> None:
    settings = HarnessSettings(data_folder=tmp_path, speed=2.0, fidelity="kinematic", database=server.database())
    with open_harness(settings) as harness:
        mission_id = begun(harness)
        until(lambda: moving(tmp_path), seconds=100, what="the robot's motion")
        server.stop("immediate")
        until(lambda: not moving(tmp_path), seconds=60, what="the dead man's stop")
        server.start()
        until(lambda: harness.runtime.mission(mission_id).ended, seconds=150, what="the end of the mission")
        assert harness.runtime.mission(mission_id).status == "succeeded"
        starts: tuple[PhysicalStart, ...] = harness.starts(mission_id)
        assert len({start.request_id for start in starts}) == len(starts)
        assert harness.runtime.verify() == harness.runtime.head()
