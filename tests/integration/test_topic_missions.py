"""Missions whose evidence comes from the robot's topics and not from the program that drives it, in the robot's own
time."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
import yaml
from msgspec.structs import replace

from harness.contracts.observations import AnySample, Odometry, Pose
from tests.builders.shops import TOKEN, Shop, regen, running
from tests.builders.topic_servers import TOPICS, DdsWriter, FoxgloveServer, Rosbridge, TopicServer, bridged, eventually

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


def standing(*kinds: type[AnySample]) -> Callable[[AnySample], AnySample | None]:
    """Samples of these kinds never show that the robot left the place of the first one."""
    first: dict[type[AnySample], Any] = {}

    def altered(sample: AnySample) -> AnySample | None:
        if not isinstance(sample, kinds):
            return sample
        at = first.setdefault(type(sample), sample)
        return replace(sample, x_m=at.x_m, y_m=at.y_m, yaw_rad=at.yaw_rad)

    return altered


@contextmanager
def under_way(folder: Path) -> Iterator[Callable[[], dict[str, Any]]]:
    """`regen mission run` in a process of its own, until the block ends; yields what reads the mission."""
    words = [sys.executable, "-m", "app.cli.main", "mission", "run", "go-to-place", "--site", str(folder)]
    process = subprocess.Popen(words, env=os.environ | {"ROBOT_TOKEN": TOKEN}, stderr=subprocess.DEVNULL)

    def read() -> dict[str, Any]:
        time.sleep(0.5)  # the robot moves in its own time, and each look takes the processor from it
        code, listed, _ = regen("mission", "list", "--data", str(folder / "var"))
        return dict(listed["missions"][0]) if code == 0 and listed["missions"] else {"status": "not begun"}

    try:
        yield read
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)


@pytest.mark.parametrize("kinds", [(Pose,), (Pose, Odometry)], ids=["pose", "both"])
def test_topics_that_contradict_the_driver_or_each_other_accept_no_arrival(
    admitted: Shop, folder: Path, kinds: tuple[type[AnySample], ...]
) -> None:
    with (
        evidence(folder, "rosbridge") as server,
        running(admitted.port, lockstep=False),
        bridged(admitted.address, TOKEN, server, standing(*kinds)),
        under_way(folder) as read,
    ):
        eventually(lambda: read()["status"] == "awaiting_human", "a person is asked", within_s=90.0)
        mission_id = read()["mission_id"]
        _, shown, _ = regen("mission", "events", mission_id, "--data", str(folder / "var"))
    commits = [one["body"]["node_id"] for one in shown["events"] if one["kind"] == "NodeCommitted"]
    assert commits == ["request"]
    refused = [one["body"]["node_id"] for one in shown["events"] if one["kind"] == "CommitRejected"]
    assert "go" in refused, "the driver declared that it arrived"
