"""A ROS 2 robot by its sidecar: real rclpy and Fast DDS of Jazzy, a NavigateToPose server, a base with its topics.

Three kinds of processes: the robot's own nodes (docs/examples/ros2_stack.py), the sidecar (docs/examples/
ros2_sidecar.py) beside them, and the harness here. Time is real. The stack is no Nav2; it speaks Nav2's interface.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from itertools import count
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from app.cli.main import app
from app.cli.output import complain
from app.i18n.reasons.rendering import explained
from harness.adapters.providers.http.robot import HttpProvider, HttpRobot
from harness.adapters.providers.topics.connection import topic_witness
from harness.adapters.providers.topics.samples import TopicFrames
from harness.adapters.providers.topics.witness import Topics
from harness.contracts.errors import FencingRefused, HarnessError, ProviderFailed, UnknownName
from harness.contracts.ids import MissionId, NodeId, ProviderId, RequestId
from harness.contracts.observations import Battery, LaserMount, Odometry, Pose, Scan
from harness.contracts.protocol import TERMINAL, InvocationIdentity, InvocationReport, StartRequest
from harness.contracts.reasons import plain
from harness.workspace.new_folder import write_folder
from tests.builders.declaring_robot import DeclaringRobot

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "docs" / "examples"
TOKEN = "a secret of this test"
MAP = "hall-1"
DOMAINS = count()
"""Each test in a ROS domain of its own: nodes that were killed are still announced for a while."""
NEAR, FAR = (1.2, -0.6), (2.4, -1.4)


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def eventually(found: Callable[[], bool], what: str, *, within_s: float = 40.0) -> None:
    until_s = time.monotonic() + within_s
    while not found():
        assert time.monotonic() < until_s, f"not within {within_s:g} s: {what}"
        time.sleep(0.1)


class Ros:
    """One robot of its own ROS domain: its processes, each started and killed by name."""

    def __init__(self, stack: ExitStack, peer: Path, folder: Path, domain: int) -> None:
        self._stack, self._peer, self.folder, self.domain = stack, peer, folder, domain
        self._environment = os.environ | {
            "LD_LIBRARY_PATH": str(peer / "lib"), "AMENT_PREFIX_PATH": str(peer), "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOG_DIR": str(folder / "log"), "ROBOT_TOKEN": TOKEN,
        }  # fmt: skip
        self._running: dict[str, subprocess.Popen[str]] = {}
        self.port, self.observer_port = free_port(), free_port()

    def start(self, name: str, program: str, *options: str) -> None:
        """Start a process, and wait until it says that it runs."""
        words = [str(self._peer / "bin" / "python"), str(EXAMPLES / program), *options]
        error = self._stack.enter_context((self.folder / f"{name}.log").open("a"))
        one = subprocess.Popen(words, env=self._environment, stdout=subprocess.PIPE, stderr=error, text=True)
        self._stack.callback(self.kill, name)
        self._running[name] = one
        assert one.stdout is not None and one.stdout.readline(), (self.folder / f"{name}.log").read_text()

    def kill(self, name: str) -> None:
        """At once, as a crash does."""
        one = self._running.pop(name, None)
        if one is not None:
            one.kill()
            one.wait()
            assert one.stdout is not None
            one.stdout.close()

    def base(self, *options: str) -> None:
        self.start("base", "ros2_stack.py", "base", str(EXAMPLES / "hall.yaml"), *options)

    def navigation(self, *options: str) -> None:
        self.start("navigation", "ros2_stack.py", "navigation", str(EXAMPLES / "hall.yaml"), *options)

    def sidecar(self) -> None:
        journal = str(self.folder / "starts.jsonl")
        words = ("--name", "robot-1", "--map-version", MAP, "--port", str(self.port), "--journal", journal)
        self.start("sidecar", "ros2_sidecar.py", *words)

    def observer(self) -> None:
        words = ("--name", "robot-1", "--map-version", MAP, "--port", str(self.observer_port), "--observe")
        self.start("observer", "ros2_sidecar.py", *words)

    def tour(self) -> None:
        """What gives the robot its goals, other than the harness."""
        self.start("tour", "ros2_stack.py", "tour", str(EXAMPLES / "hall.yaml"))

    def console(self, folder: Path) -> None:
        """`regen up` of a site, as a process."""
        words = [sys.executable, "-m", "app.cli.main", "up", "--site", str(folder), "--port", str(free_port())]
        output = self._stack.enter_context((self.folder / "console.log").open("w"))
        one = subprocess.Popen(words, cwd=ROOT, env=os.environ | {"ROBOT_TOKEN": TOKEN}, stdout=output, stderr=output)
        self._stack.callback(one.wait, 30.0)
        self._stack.callback(one.send_signal, signal.SIGTERM)

    def client(self) -> HttpRobot:
        found = HttpRobot(f"http://127.0.0.1:{self.port}", TOKEN)
        self._stack.callback(found.close)
        return found

    def whole(self, *, base: tuple[str, ...] = (), navigation: tuple[str, ...] = ()) -> HttpRobot:
        """Everything, localised and with its emergency stop heard to be released."""
        self.base(*base)
        self.navigation(*navigation)
        self.sidecar()
        found = self.client()
        eventually(lambda: found.status().localised, "a fresh pose")
        eventually(lambda: not found.status().hardware_stop, "the released emergency stop")
        return found


@pytest.fixture
def ros(peers: Path, tmp_path: Path) -> Iterator[Ros]:
    if not (peers / "ros2" / "installed").exists():
        pytest.skip("ROS 2 is not installed here: tools/peers.sh")
    with ExitStack() as stack:
        yield Ros(stack, peers / "ros2", tmp_path, domain=1 + (os.getpid() + next(DOMAINS)) % 100)


def request(name: str = "1", target: tuple[float, float] = FAR, *, token: int = 1, within_s: float = 60.0) -> Any:
    identity = InvocationIdentity(
        mission_id=MissionId("m"),
        node_id=NodeId("go"),
        attempt=1,
        request_id=RequestId(name * 64),
        provider_id=ProviderId("navigate_to_pose"),
    )
    return StartRequest(
        identity=identity,
        capability="navigate",
        parameters={"target": target, "frame": "map", "tolerance_m": 0.4, "speed_cap_mps": 0.4},
        k_ctx=0,
        configuration="0" * 64,  # type: ignore[arg-type]
        deadline_s=time.time() + within_s,
        fencing={"mobile_base": token},
    )


def started(robot: HttpRobot, one: StartRequest) -> tuple[HttpProvider, InvocationReport]:
    """Started as soon as the sidecar has found the action server."""
    (provider,) = robot.providers()
    until_s = time.monotonic() + 20.0
    while True:
        try:
            return provider, provider.start(one)
        except ProviderFailed as refusal:
            if "No action server" not in str(refusal) or time.monotonic() > until_s:
                raise
            time.sleep(0.2)


def followed(provider: HttpProvider, handle: str, until: Callable[[InvocationReport], bool]) -> InvocationReport:
    """The first report that fits; it is kept alive until then."""
    until_s = time.monotonic() + 60.0
    while not until(report := provider.report(handle)):
        assert time.monotonic() < until_s, report
        provider.keepalive(handle)
        time.sleep(0.1)
    return report


def over(report: InvocationReport) -> bool:
    return report.status in TERMINAL


def samples(robot: HttpRobot) -> list[Any]:
    return list(robot.observations(0, 20_000).samples)


def driving(robot: HttpRobot) -> bool:
    newest = [one for one in samples(robot) if isinstance(one, Odometry)][-1]
    return abs(newest.v_mps) > 0.15


def regen(*words: str) -> tuple[int, Any, str]:
    done = CliRunner(env={"ROBOT_TOKEN": TOKEN}).invoke(app, [*words, "--json"])
    if isinstance(done.exception, HarnessError):
        return complain(done.exception), None, explained(done.exception)
    return done.exit_code, json.loads(done.stdout) if done.stdout else None, done.stderr


class Hall:
    """A site of the hall's map with this robot; its evidence comes from the process that only observes."""

    def __init__(self, ros: Ros, *, observed: bool = True) -> None:
        self.ros, self.folder = ros, ros.folder / "hall"
        write_folder(self.folder, name="hall", map_file=EXAMPLES / "hall.yaml", address=f"http://127.0.0.1:{ros.port}")
        if observed:
            robots = yaml.safe_load((self.folder / "robots.yaml").read_text())
            address = f"http://127.0.0.1:{ros.observer_port}"
            robots["robots"][0]["evidence"] = {"address": address, "token": {"environment": "ROBOT_TOKEN"}}
            (self.folder / "robots.yaml").write_text(yaml.safe_dump(robots))
        (self.folder / "conformance").mkdir()
        (self.folder / "conformance" / "navigate.yaml").write_text((EXAMPLES / "navigate_to_pose.yaml").read_text())

    def check(self) -> tuple[int, Any, str]:
        words = ("provider", "check", "robot-1", "--site", str(self.folder))
        return regen(*words, "--allow-motion", "--stands-clear", "robot-1")

    def go(self) -> tuple[int, Any, str]:
        return regen("mission", "run", "go-to-place", "--site", str(self.folder), "--speed", "0")


@pytest.mark.ledger(
    "R175", symbol="harness.adapters.providers.http.addressed:addressed_over_http", entry="command line"
)
def test_the_kit_admits_it_and_missions_are_judged_by_what_the_second_process_sees(ros: Ros) -> None:
    """navigation2#3257, spot_ros#53: was the pose truly reached? The stack's SUCCEEDED decides nothing."""
    robot, hall = ros.whole(), Hall(ros)
    ros.observer()
    started(robot, request("0", NEAR))[0].stop("goal-1")  # the action server is found by now
    code, answer, said = hall.check()
    rows = answer["providers"][0]["rows"]
    assert code == 0, [row for row in rows if row["outcome"] == "not met"]
    assert len([row for row in rows if row["outcome"] == "met"]) == 22
    code, outcome, said = hall.go()
    assert (code, outcome["status"], outcome["goal_verdict"]) == (0, "succeeded", "satisfied"), said
    assert outcome["segments"][0]["measured_distance_m"] < 0.4

    ros.kill("navigation")
    ros.kill("base")
    ros.base()
    ros.navigation("--short-of", "1.2")
    time.sleep(20.0)  # so long the killed server stays in the graph, and could be sent the goal
    eventually(lambda: robot.status().localised, "a fresh pose of the base that was started again")
    code, outcome, said = hall.go()
    (way, *_) = outcome["segments"]
    assert (outcome["status"], outcome["goal_verdict"]) != ("succeeded", "satisfied"), "SUCCEEDED 1.2 m short"
    assert code != 0 and way["declared_distance_m"] > 0.9 and way["measured_distance_m"] > 0.9, outcome


def test_samples_carry_the_stamps_and_frames_of_their_headers(ros: Ros) -> None:
    robot = ros.whole(base=("--start", "1.0", "-0.5"))
    eventually(lambda: {Pose, Odometry, Scan, Battery} <= set(map(type, samples(robot))), "each kind of sample")
    newest = {type(one): one for one in samples(robot)}
    assert abs(newest[Pose].x_m - 1.0) < 0.1 and abs(newest[Pose].y_m + 0.5) < 0.1
    assert newest[Pose].frame == "map" and newest[Pose].map_version == MAP and newest[Pose].confidence > 0.9
    assert newest[Odometry].x_m == 0.0, "odometry begins where the base was switched on"
    assert abs(newest[Scan].at_s - time.time()) < 3.0
    assert len(robot.blob(newest[Scan].blob)) == 12 * newest[Scan].points > 0
    assert newest[Battery].charge == pytest.approx(0.8)
    eventually(lambda: robot.status().posture == "standing", "a robot that stands")
    status = robot.status()
    assert not status.hardware_stop and status.charge == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("base", "said"),
    [
        (("--no-localiser",), "not localised"),
        (("--stamps-behind", "30"), "not localised"),
        (("--spread", "2.0"), "not localised"),
        (("--stop-engaged",), "emergency stop"),
    ],
)
def test_nothing_starts_without_localisation_or_with_the_stop_engaged(
    ros: Ros, base: tuple[str, ...], said: str
) -> None:
    """flotilla#1349: no start without localisation. Old stamps are no localisation."""
    ros.base(*base)
    ros.navigation()
    ros.sidecar()
    robot = ros.client()
    eventually(lambda: any(isinstance(one, Odometry) for one in samples(robot)), "odometry")
    time.sleep(1.5)
    with pytest.raises(ProviderFailed, match=said):
        started(robot, request())
    assert not robot.starts()
    assert robot.status().hardware_stop == ("--stop-engaged" in base)


def test_without_keepalives_it_stands_by_itself_and_goes_on_when_asked(ros: Ros) -> None:
    robot = ros.whole()
    provider, report = started(robot, request())
    followed(provider, report.handle, lambda one: driving(robot))
    time.sleep(2.5)
    held = provider.report(report.handle)
    assert (held.status, held.failure) == ("blocked", "keepalive_lost")
    still = [one for one in samples(robot) if isinstance(one, Odometry)][-10:]
    assert max(abs(one.v_mps) for one in still) < 0.01
    provider.resume(report.handle)
    ended = followed(provider, report.handle, over)
    assert ended.status == "succeeded" and ended.declared["distance_m"] < 0.4
    assert len(robot.starts()) == 1


def test_a_server_that_refuses_to_cancel_is_never_reported_as_cancelled_in_motion(ros: Ros) -> None:
    """isar#926: stopped means measured."""
    robot = ros.whole(navigation=("--deaf",))
    provider, report = started(robot, request())
    followed(provider, report.handle, lambda one: driving(robot))
    assert provider.stop(report.handle).status == "stopping"
    time.sleep(1.0)
    assert provider.report(report.handle).status == "stopping" and driving(robot)
    ended = followed(provider, report.handle, over)
    assert ended.status == "cancelled"
    standing = [one for one in samples(robot) if isinstance(one, Odometry) and one.at_s <= ended.at_s][-8:]
    assert max(abs(one.v_mps) for one in standing) < 0.02


def test_a_server_that_vanishes_under_way_is_a_failure_at_a_measured_standstill(ros: Ros) -> None:
    robot = ros.whole(navigation=("--vanish-after", "2.0"))
    provider, report = started(robot, request())
    ended = followed(provider, report.handle, over)
    assert (ended.status, ended.failure) == ("failed", "server_lost") and not ended.proposed_facts
    assert ended.declared["distance_m"] > 0.5
    ros.kill("navigation")
    with pytest.raises(ProviderFailed, match="No action server"):
        provider.start(request("2"))


def test_an_emergency_stop_under_way_ends_the_goal_so_that_its_release_moves_nothing(ros: Ros) -> None:
    robot = ros.whole(base=("--stop-after", "1.0"))
    provider, report = started(robot, request())
    ended = followed(provider, report.handle, over)
    assert (ended.status, ended.failure) == ("failed", "emergency_stop") and robot.status().hardware_stop
    assert ended.declared["distance_m"] > 0.5 and not driving(robot)


@pytest.mark.parametrize(
    ("navigation", "target", "failure", "said"),
    [(("--reject",), FAR, "rejected", "rejected the goal"), ((), (-1.9, 40.0), "aborted", "208 no way to the goal")],
)
def test_a_goal_that_the_stack_does_not_take_or_reach_is_a_failure_with_its_own_word(
    ros: Ros, navigation: tuple[str, ...], target: tuple[float, float], failure: str, said: str
) -> None:
    robot = ros.whole(navigation=navigation)
    provider, report = started(robot, request(target=target))
    ended = followed(provider, report.handle, over)
    assert (ended.status, ended.failure) == ("failed", failure) and said in plain(ended.message)


def test_a_sidecar_that_was_restarted_under_way_stops_the_goal_and_starts_nothing_twice(ros: Ros) -> None:
    """flotilla#2613: after a lost connection nothing new starts by itself, and the old goal does not go on."""
    robot = ros.whole()
    provider, report = started(robot, request(token=5))
    followed(provider, report.handle, lambda one: driving(robot))
    ros.kill("sidecar")
    ros.sidecar()
    (provider,) = robot.providers()
    ended = followed(provider, report.handle, over)
    assert (ended.status, ended.failure, ended.handle) == ("failed", "restarted", report.handle)
    assert not driving(robot)
    assert provider.start(request(token=5)) == ended, "the same request is the same execution, to the byte"
    assert len(robot.starts()) == 1
    eventually(lambda: robot.status().localised, "a fresh pose")
    with pytest.raises(FencingRefused):
        provider.start(request("2", token=4))
    ros.kill("sidecar")
    ros.sidecar()
    assert provider.find(request().identity.request_id) == ended


def test_topics_of_fast_dds_nodes_are_read_by_cyclone_dds_and_nothing_is_written(ros: Ros) -> None:
    ros.base()
    topics: Topics = {"pose": "/amcl_pose", "odometry": "/odom", "scan": "/scan", "battery": "/battery_state"}
    frames = TopicFrames(frame="map", map_version=MAP, laser=LaserMount(x_m=0.2))
    address = f"dds://127.0.0.1/{ros.domain}"
    with topic_witness(
        DeclaringRobot(), transport="dds", address=address, token="", topics=topics, frames=frames, now_s=time.time
    ) as witness:
        began_s = time.time()
        kinds = {Pose, Odometry, Scan, Battery}
        eventually(lambda: kinds <= {type(one) for one in witness.observations(0).samples}, "a sample of every topic")
        found = witness.observations(0).samples
        assert all(abs(one.at_s - began_s) < 60.0 for one in found)
        seqs = [one.seq for one in found]
        assert seqs == sorted(set(seqs))
        odometry = [one.at_s for one in found if isinstance(one, Odometry)]
        assert odometry == sorted(odometry)
        (pose, *_) = [one for one in found if isinstance(one, Pose)]
        assert (pose.frame, pose.map_version) == ("map", MAP) and abs(pose.x_m) < 0.1
        (scan, *_) = [one for one in found if isinstance(one, Scan)]
        assert len(witness.blob(scan.blob)) == scan.points * 12 > 0


def test_the_process_that_observes_offers_no_provider_and_starts_nothing(ros: Ros) -> None:
    ros.base()
    ros.navigation()
    ros.observer()
    with closing(HttpRobot(f"http://127.0.0.1:{ros.observer_port}", TOKEN)) as observer:
        eventually(lambda: observer.status().localised, "a fresh pose")
        assert not observer.providers() and not observer.starts()
        assert {Pose, Odometry} <= set(map(type, samples(observer)))
        for path in ("/providers/navigate_to_pose/invocations", "/invocations/goal-1/stop"):
            with pytest.raises(UnknownName, match="only observes"):
                observer.write(path, InvocationReport, request(), own=(UnknownName,))


def shadow_hall(ros: Ros) -> Path:
    """A site whose robot is the process that only observes, in shadow mode."""
    folder = ros.folder / "hall"
    address = f"http://127.0.0.1:{ros.observer_port}"
    write_folder(folder, name="hall", map_file=EXAMPLES / "hall.yaml", address=address)
    robots = yaml.safe_load((folder / "robots.yaml").read_text())
    robots["robots"][0]["authority"] = "observe"
    (folder / "robots.yaml").write_text(yaml.safe_dump(robots))
    return folder


def shadow_goals(folder: Path) -> list[Any]:
    """What `regen shadow` lists, oldest first."""
    _, found, _ = regen("shadow", "--site", str(folder))
    return [one for robot in found["robots"] for one in reversed(robot["goals"])]


def test_goals_that_others_give_an_action_server_are_compared_with_what_the_robot_did(ros: Ros) -> None:
    """navigation2#3257, in shadow mode: SUCCEEDED beside where the robot was; nothing is ever sent to the server."""
    ros.base()
    ros.navigation("--claims", "2")
    ros.observer()
    with closing(HttpRobot(f"http://127.0.0.1:{ros.observer_port}", TOKEN)) as observer:
        eventually(lambda: observer.status().localised, "a fresh pose")
    folder = shadow_hall(ros)
    ros.console(folder)
    eventually(lambda: regen("shadow", "--site", str(folder))[1] is not None, "a console that watches")
    ros.tour()
    eventually(lambda: len([one for one in shadow_goals(folder) if one["declared"]]) >= 2, "two goals", within_s=90.0)
    driven, claimed = shadow_goals(folder)[:2]
    assert driven["stack"] == "navigate_to_pose" and driven["goal"]["frame"] == "map"
    assert driven["goal"]["target_m"] == pytest.approx(NEAR, abs=0.02)
    assert (driven["declared"], driven["accepted"]) == ("succeeded", "accepted"), driven["finding"]
    assert driven["finding"]["distance_m"] < 0.4
    assert (claimed["declared"], claimed["accepted"]) == ("succeeded", "refused"), claimed["finding"]
    assert claimed["goal"]["target_m"] == pytest.approx(FAR, abs=0.02) and claimed["finding"]["distance_m"] > 1.0
    code, rows, _ = regen("provider", "check", "robot-1", "--site", str(folder))
    assert (code, rows["ok"]) == (0, True), rows

    ros.kill("tour")
    ros.kill("navigation")
    ros.navigation("--vanish-after", "1.0")
    known = {one["goal"]["goal_id"] for one in shadow_goals(folder)}
    ros.tour()

    def abandoned() -> list[Any]:
        """Goals of the server that vanished under way, which nobody waits for any more."""
        fresh = [one for one in shadow_goals(folder) if one["goal"]["goal_id"] not in known]
        return [one for one in fresh if one["lost_code"]]

    eventually(lambda: bool(abandoned()), "the goal of a dead server", within_s=90.0)
    assert abandoned()[0]["lost_code"] == "stack_outcome_unknown" and abandoned()[0]["declared"] is None


def test_what_an_action_server_says_is_handed_on_once_and_in_order(ros: Ros) -> None:
    """Goals that overlap have no target; a goal that is aborted or cancelled by somebody else says so."""
    robot = ros.whole()
    ros.observer()
    with closing(HttpRobot(f"http://127.0.0.1:{ros.observer_port}", TOKEN)) as observer:
        eventually(lambda: observer.status().localised, "a fresh pose")
        run = observer.stack_goals(0).run
        provider, report = started(robot, request())
        followed(provider, report.handle, lambda one: driving(robot))
        eventually(lambda: any(one.target_m for one in observer.stack_goals(0).changes), "where the plan ends")
        provider.stop(report.handle)
        assert followed(provider, report.handle, over).status == "cancelled"
        eventually(lambda: any(one.ended for one in observer.stack_goals(0).changes), "its end")
        found = observer.stack_goals(0)
        assert found.run == run and [one.seq for one in found.changes] == [1, 2, 3]
        assert len({one.goal_id for one in found.changes}) == 1
        assert [one.status for one in found.changes] == ["active", "active", "cancelled"]
        assert found.changes[0].target_m is None and found.changes[-1].target_m == pytest.approx(FAR, abs=0.02)
        assert observer.stack_goals(2).changes == found.changes[2:]
        nowhere = started(robot, request("2", (-1.9, 40.0), token=2))
        assert followed(nowhere[0], nowhere[1].handle, over).failure == "aborted"
        eventually(lambda: observer.stack_goals(0).changes[-1].status == "failed", "the aborted goal")
        assert observer.stack_goals(0).changes[-1].target_m is None, "nothing was planned"
