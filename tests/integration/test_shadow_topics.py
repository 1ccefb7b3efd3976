"""A robot whose own topics contradict the arrival that its stack declares: shadow mode, in the stack's own time."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from harness.addressed_robots import observed_robot
from harness.contracts.observations import Pose
from harness.contracts.ports import ObservedRobot
from harness.settings import HarnessSettings
from harness.site_robots import robots_of
from harness.supervisor.shadow_watch import ShadowWatch
from harness.workspace.reading import open_workspace
from tests.builders.ros_json import odometry, pose
from tests.builders.shadow_sites import ROBOT, ShadowSite, opened, write_site
from tests.builders.shops import regen
from tests.builders.topic_servers import TOPICS, Rosbridge, eventually
from tests.fakes.own_stack import BEGUN_S, OwnStack, serving
from tests.integration.test_shadow_mode import listed


@dataclass
class TopicSite:
    """The site, and the robot as its topics have it: `seen` moves apart from the stack's own samples."""

    site: ShadowSite
    server: Rosbridge
    robot: ObservedRobot
    seen: OwnStack
    published: int = 0

    def publish(self) -> None:
        """Everything sensed since the last time, once the robot's clock has come that far, and wait until it is
        read."""
        robot, fresh = self.robot, self.seen.samples[self.published :]
        self.published = len(self.seen.samples)
        eventually(lambda: robot.observations(0).at_s >= self.site.stack.now_s, "the robot's clock")
        for one in fresh:
            made = pose if one["kind"] == "pose" else odometry
            topic = TOPICS["pose" if one["kind"] == "pose" else "odometry"]
            self.server.publish(topic, made(one["at_s"], one["x_m"], one["y_m"]))
        newest_s = fresh[-1]["at_s"] - 0.01
        eventually(
            lambda: any(isinstance(one, Pose) and one.at_s >= newest_s for one in robot.observations(0).samples),
            "the newest pose",
        )

    def drives(self, goal_id: str, *, declared_m: float, seen_m: float) -> None:
        """The stack drives to `declared_m` by its own samples and says so; the topics have the body at `seen_m`."""
        stack, seen = self.site.stack, self.seen
        stack.given(goal_id, declared_m, 0.0)
        self.site.reads()
        stack.goes(declared_m, 0.0, 5.0)
        seen.goes(seen_m, 0.0, 5.0)
        stack.says(goal_id, "succeeded")
        stack.stands(3.0)
        seen.stands(3.0)
        self.publish()
        self.site.reads()


@contextmanager
def topic_site(folder: Path) -> Iterator[TopicSite]:
    stack = OwnStack()
    with closing(Rosbridge()) as server, serving(stack) as address:
        topics = {role: TOPICS[role] for role in ("pose", "odometry")}
        write_site(folder, address, evidence={"kind": "rosbridge", "address": server.address, "topics": topics})
        first = [
            server.repeat(TOPICS["pose"], pose(BEGUN_S, 0.0, 0.0)),
            server.repeat(TOPICS["odometry"], odometry(BEGUN_S, 0.0, 0.0)),
        ]
        workspace = open_workspace(folder)
        (entry,) = robots_of(HarnessSettings(site_folder=folder), workspace, None).observed
        with opened(folder, stack, address) as site, observed_robot(entry, workspace) as robot:
            for one in first:
                one.close()
            watch = ShadowWatch(ROBOT, robot, runtime=site.harness.runtime, clock=site.clock, apart=True)
            site.app.state.console = replace(site.app.state.console, shadows={ROBOT: watch})
            yield TopicSite(replace(site, watch=watch), server, robot, OwnStack())


@pytest.fixture
def topics(tmp_path: Path) -> Iterator[TopicSite]:
    with topic_site(tmp_path / "shop") as found:
        yield found


def test_topics_that_contradict_a_declared_arrival_refuse_it(topics: TopicSite) -> None:
    """spot_ros#53: at the goal by the stack's own word and samples, and not by what the robot's topics say."""
    topics.site.reads()
    topics.drives("g1", declared_m=4.0, seen_m=1.0)
    robot = listed(topics.site)
    (goal,) = robot["goals"]
    assert (goal["declared"], goal["accepted"], goal["apart"]) == ("succeeded", "refused", True), goal["finding"]
    assert goal["finding"]["distance_m"] == pytest.approx(3.0, abs=0.05)
    assert robot["counts"]["false_successes"] == 1
    assert "disagrees" in topics.site.operator().get("/shadow?only=disagrees").text
    code, found, _ = regen("shadow", "--site", str(topics.site.folder))
    assert code == 1 and found["robots"][0]["goals"][0]["agreement"] == "disagrees"


def test_topics_that_show_the_arrival_accept_it_apart_from_who_declares(topics: TopicSite) -> None:
    topics.site.reads()
    topics.drives("g1", declared_m=4.0, seen_m=4.0)
    (goal,) = listed(topics.site)["goals"]
    assert (goal["declared"], goal["accepted"], goal["apart"]) == ("succeeded", "accepted", True), goal["finding"]
    assert "by the same address" not in topics.site.operator().get("/shadow").text
    assert {one["op"] for one in topics.server.asked} <= {"subscribe", "unsubscribe"}
