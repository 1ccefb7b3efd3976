"""Missions whose evidence comes from the robot's topics and not from the program that drives it, in the robot's own
time."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
import yaml

from tests.builders.shops import TOKEN, Shop, regen, running
from tests.builders.topic_servers import TOPICS, DdsWriter, FoxgloveServer, Rosbridge, TopicServer, bridged

SERVERS: dict[str, Callable[[], Any]] = {
    "rosbridge": Rosbridge,
    "foxglove": lambda: FoxgloveServer("cdr"),
    "dds": DdsWriter,
}


@pytest.fixture(scope="module")
def admitted(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    shop = Shop(tmp_path_factory.mktemp("sites") / "shop")
    code, answer, said = shop.admit()
    assert code == 0, (answer, said)
    return shop


@pytest.fixture
def folder(admitted: Shop, tmp_path: Path) -> Path:
    return copytree(admitted.folder, tmp_path / "shop")


@contextmanager
def evidence(folder: Path, kind: str) -> Iterator[TopicServer]:
    """A server of topics, named in the site's robots.yaml as the robot's evidence."""
    with closing(SERVERS[kind]()) as server:
        file = folder / "robots.yaml"
        text = yaml.safe_load(file.read_text())
        topics = {role: TOPICS[role] for role in ("pose", "odometry", "battery")}
        text["robots"][0]["evidence"] = {"kind": kind, "address": server.address, "topics": topics}
        file.write_text(yaml.safe_dump(text))
        yield server


def went(folder: Path) -> tuple[int, Any, str]:
    return regen("mission", "run", "go-to-place", "--site", str(folder))


@pytest.mark.parametrize("kind", SERVERS)
def test_a_mission_is_verified_on_the_robots_topics(admitted: Shop, folder: Path, kind: str) -> None:
    with (
        evidence(folder, kind) as server,
        running(admitted.port, lockstep=False),
        bridged(admitted.address, TOKEN, server),
    ):
        code, outcome, said = went(folder)
        assert code == 0, said
        assert (outcome["status"], outcome["goal_verdict"]) == ("succeeded", "satisfied")


def test_without_its_topics_the_robot_is_not_connected(admitted: Shop, folder: Path) -> None:
    with evidence(folder, "rosbridge"), running(admitted.port, lockstep=False):
        code, _, said = went(folder)
    assert code == 1 and "Nothing came on the robot's topics" in said
