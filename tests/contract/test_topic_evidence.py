"""A robot's topics as evidence: read from a rosbridge, from the server of foxglove-sdk (JSON and CDR) and from DDS."""

import base64
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from typing import Any

import cv2
import numpy as np
import pytest

from harness.adapters.providers.topics.connection import Transport, topic_witness
from harness.adapters.providers.topics.samples import TopicFrames
from harness.adapters.providers.topics.witness import Topics, TopicWitness
from harness.contracts import protocol
from harness.contracts.errors import BlobDamaged, ProviderUnreachable
from harness.contracts.ids import Digest
from harness.contracts.observations import AnySample, Battery, Image, LaserMount, Odometry, Pose, Scan
from harness.contracts.ports import Provider
from tests.builders import ros_json
from tests.builders.topic_servers import TOPICS, DdsWriter, FoxgloveServer, Rosbridge, TopicServer, eventually
from tests.saying import raises_saying

NOW_S = 1_700_000_000.0
FRAMES = TopicFrames(frame="map", map_version="hall-1")
SERVERS: dict[str, Callable[[], Any]] = {
    "rosbridge": Rosbridge,
    "foxglove": lambda: FoxgloveServer("json"),
    "foxglove in cdr": lambda: FoxgloveServer("cdr"),
    "dds": DdsWriter,
}


class DeclaringRobot:
    """What the robot's own program says of it: localised, standing, full."""

    def __init__(self) -> None:
        self.condition = protocol.RobotStatus(
            robot_id="robot-1", at_s=NOW_S, posture="standing", armed=False, hardware_stop=False, charge=1.0,
            localised=True, map_version="hall-1", pose_age_s=0.0,
        )  # fmt: skip

    def providers(self) -> Sequence[Provider]:
        return ()

    def status(self) -> protocol.RobotStatus:
        return self.condition

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        raise AssertionError("samples come from the topics alone")

    def blob(self, digest: Digest) -> bytes:
        raise AssertionError("bytes come from the topics alone")

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return ()


class Site:
    """One robot, the server of its topics, and the clock that its stamps are compared with."""

    def __init__(self, kind: str, server: TopicServer) -> None:
        self.transport: Transport = kind.split()[0]  # type: ignore[assignment]
        self.server, self.robot, self.now_s = server, DeclaringRobot(), NOW_S
        self._published = 0

    @contextmanager
    def witness(self, frames: TopicFrames = FRAMES, *, only: tuple[str, ...] = tuple(TOPICS)) -> Iterator[TopicWitness]:
        """Read by the harness, with a first pose and odometry at the begin."""
        topics: Topics = {role: TOPICS[role] for role in only}  # type: ignore[misc]
        with (
            self.repeating("/amcl_pose", ros_json.pose(NOW_S - 1.0, 0.0, 0.0)),
            self.repeating("/odom", ros_json.odometry(NOW_S - 1.0, 0.0, 0.0)),
            topic_witness(
                self.robot, transport=self.transport, address=self.server.address, token="", topics=topics,
                frames=frames, now_s=lambda: self.now_s,
            ) as found,
        ):  # fmt: skip
            yield found

    @contextmanager
    def repeating(self, topic: str, message: dict[str, Any]) -> Iterator[None]:
        """The same message again and again while the block runs, as a publisher does."""
        with closing(self.server.repeat(topic, message)):
            yield


def samples(witness: TopicWitness, kind: type[AnySample], at_s: float) -> list[Any]:
    found = witness.observations(0).samples
    return [one for one in found if isinstance(one, kind) and abs(one.at_s - at_s) < 1e-3]


def arrives(witness: TopicWitness, kind: type[AnySample], at_s: float) -> Any:
    """The one sample of this stamp, once it is there."""
    eventually(lambda: bool(samples(witness, kind, at_s)), f"a {kind.__name__} of {at_s}")
    (one,) = samples(witness, kind, at_s)
    return one


@pytest.fixture(params=SERVERS)
def site(request: pytest.FixtureRequest) -> Iterator[Site]:
    with closing(SERVERS[request.param]()) as server:
        yield Site(request.param, server)


@pytest.fixture
def bridge() -> Iterator[Site]:
    """By rosbridge, where the messages' text is under the test's control."""
    with closing(Rosbridge()) as server:
        yield Site("rosbridge", server)


def test_topics_become_samples_with_the_stamps_of_their_headers(site: Site) -> None:
    with (
        site.witness() as witness,
        site.repeating("/amcl_pose", ros_json.pose(NOW_S, 1.5, -2.0, 0.3)),
        site.repeating("/odom", ros_json.odometry(NOW_S, 1.4, -1.9, 0.2, v=0.4, w=-0.1)),
        site.repeating("/battery_state", ros_json.battery(NOW_S, 0.75)),
        site.repeating("/scan", ros_json.scan(NOW_S, [2.0, 0.05, 4.0])),
    ):
        pose = arrives(witness, Pose, NOW_S)
        odometry = arrives(witness, Odometry, NOW_S)
        battery, scan = arrives(witness, Battery, NOW_S), arrives(witness, Scan, NOW_S)
        assert (pose.x_m, pose.y_m, pose.source) == (1.5, -2.0, "localiser")
        assert (pose.frame, pose.map_version) == ("map", "hall-1")
        assert pose.yaw_rad == pytest.approx(0.3) and pose.confidence == pytest.approx(1 / 1.04)
        assert (odometry.v_mps, odometry.w_radps, odometry.source) == (0.4, -0.1, "odometry")
        assert battery.charge == 0.75
        points = np.frombuffer(witness.blob(scan.blob), dtype="<f4").reshape(-1, 3)
        assert scan.points == 2 and np.allclose(points, [[2.0, 0.0, 0.0], [-4.0, 0.0, 0.0]], atol=1e-6)


def test_what_the_topics_show_is_the_robots_condition_and_its_stops_are_its_own_word(site: Site) -> None:
    with (
        site.witness() as witness,
        site.repeating("/amcl_pose", ros_json.pose(NOW_S, 1.5, -2.0)),
        site.repeating("/odom", ros_json.odometry(NOW_S, 1.4, -1.9, v=0.4)),
        site.repeating("/battery_state", ros_json.battery(NOW_S, 0.25)),
    ):
        for kind in (Pose, Odometry, Battery):
            arrives(witness, kind, NOW_S)
        status = witness.status()
        assert (status.robot_id, status.posture, status.charge, status.localised) == ("robot-1", "moving", 0.25, True)
        assert status.hardware_stop is False and status.pose_age_s == 0.0
        site.robot.condition = protocol.RobotStatus(
            **{name: getattr(status, name) for name in status.__struct_fields__} | {"at_s": NOW_S + 10.0}
        )
        assert witness.status().localised is False and witness.status().pose_age_s == 10.0


def test_a_reader_only_ever_subscribes(bridge: Site) -> None:
    assert isinstance(bridge.server, Rosbridge)
    with bridge.witness() as witness:
        bridge.server.publish("/amcl_pose", ros_json.pose(NOW_S, 1.0, 1.0))
        arrives(witness, Pose, NOW_S)
        assert witness.providers() == ()
    assert {one["op"] for one in bridge.server.asked} == {"subscribe"}


def test_messages_that_come_twice_or_late_or_from_the_future_are_no_samples(bridge: Site) -> None:
    with bridge.witness() as witness:
        for at_s, x in ((NOW_S, 1.0), (NOW_S, 9.0), (NOW_S - 0.5, 9.0), (NOW_S + 30.0, 9.0), (0.0, 9.0)):
            bridge.server.publish("/odom", ros_json.odometry(at_s, x, 0.0))
        bridge.server.publish("/odom", ros_json.odometry(NOW_S + 0.2, 1.1, 0.0))
        arrives(witness, Odometry, NOW_S + 0.2)
        seen = [one for one in witness.observations(0).samples if isinstance(one, Odometry) and one.at_s >= NOW_S - 0.9]
        assert [(one.at_s - NOW_S, one.x_m) for one in seen] == [(0.0, 1.0), (pytest.approx(0.2), 1.1)]


def test_a_robot_that_restarts_with_an_old_clock_shows_nothing_until_it_is_set(bridge: Site) -> None:
    with bridge.witness() as witness:
        bridge.server.publish("/amcl_pose", ros_json.pose(NOW_S, 1.0, 1.0))
        arrives(witness, Pose, NOW_S)
        for step in range(20):
            bridge.server.publish("/amcl_pose", ros_json.pose(1000.0 + step, 7.0, 7.0))
        bridge.server.publish("/amcl_pose", ros_json.pose(NOW_S + 0.3, 1.2, 1.0))
        arrives(witness, Pose, NOW_S + 0.3)
        assert all(one.x_m < 2.0 for one in witness.observations(0).samples if isinstance(one, Pose))


def published(message: object, *, topic: str = "/odom", op: str = "publish") -> str:
    return json.dumps({"op": op, "topic": topic, "msg": message})


NONSENSE: tuple[str | bytes, ...] = (
    "{",
    "null",
    "[" * 5000,
    published(7),
    published({"header": {"stamp": {"sec": "now"}}}),
    published(ros_json.odometry(NOW_S, 1e300, 0.0)),
    published(ros_json.odometry(NOW_S, 0.0, 0.0)).replace("0.0", "1e999"),
    published({}, topic="/cmd_vel"),
    published({}, op="call_service"),
)


@pytest.mark.parametrize("text", NONSENSE)
def test_nonsense_is_passed_over_and_the_next_message_is_read(bridge: Site, text: str | bytes) -> None:
    assert isinstance(bridge.server, Rosbridge)
    with bridge.witness() as witness:
        bridge.server.send("/odom", text)
        bridge.server.publish("/odom", ros_json.odometry(NOW_S + 0.3, 1.0, 0.0))
        arrives(witness, Odometry, NOW_S + 0.3)
        assert not samples(witness, Odometry, NOW_S)


def test_positions_in_another_frame_are_not_connected(bridge: Site) -> None:
    frames = TopicFrames(frame="hall", map_version="hall-1")
    with (
        raises_saying(ProviderUnreachable, "The pose messages are in map, not in hall"),
        bridge.witness(frames),
    ):
        raise AssertionError("it is not connected")


def test_topics_on_which_nothing_comes_are_named(bridge: Site) -> None:
    with (
        raises_saying(ProviderUnreachable, "Nothing came on the robot's topics"),
        topic_witness(
            bridge.robot, transport="rosbridge", address=bridge.server.address, token="",
            topics={"pose": "/elsewhere", "odometry": "/odom2"}, frames=FRAMES, now_s=lambda: NOW_S,
        ),
    ):  # fmt: skip
        raise AssertionError("it is not connected")


def test_a_type_and_an_encoding_that_cannot_be_read_are_named() -> None:
    for kind, encoding, said in (
        ("sensor_msgs/msg/LaserScan", "json", "Topic /amcl_pose has the type sensor_msgs/msg/LaserScan"),
        ("geometry_msgs/msg/PoseStamped", "protobuf", "Topic /amcl_pose is encoded as “protobuf”"),
    ):
        with closing(FoxgloveServer("json", kinds={"/amcl_pose": (kind, encoding)})) as server:
            site = Site("foxglove", server)
            with (
                raises_saying(ProviderUnreachable, said),
                topic_witness(
                    site.robot, transport="foxglove", address=server.address, token="",
                    topics={"pose": "/amcl_pose", "odometry": "/odom"}, frames=FRAMES, now_s=lambda: NOW_S,
                ),
            ):  # fmt: skip
                raise AssertionError("it is not connected")


def test_a_broken_connection_is_no_evidence_and_comes_back_by_itself(bridge: Site) -> None:
    assert isinstance(bridge.server, Rosbridge)
    with bridge.witness() as witness:
        bridge.server.drop()
        eventually(lambda: _unreachable(witness), "the connection is noticed as lost")
        with bridge.repeating("/odom", ros_json.odometry(NOW_S + 0.3, 1.0, 0.0)):
            eventually(lambda: not _unreachable(witness), "the connection is back")
            arrives(witness, Odometry, NOW_S + 0.3)


def _unreachable(witness: TopicWitness) -> bool:
    try:
        witness.observations(0)
    except ProviderUnreachable:
        return True
    return False


def test_a_localiser_that_publishes_updates_only_is_carried_on_by_odometry(bridge: Site) -> None:
    with bridge.witness() as witness:
        steps = [NOW_S + step / 10 for step in range(20)]
        for number, at_s in enumerate(steps):
            bridge.now_s = at_s
            bridge.server.publish("/odom", ros_json.odometry(at_s, 0.05 * number, 0.0, v=0.5))
            arrives(witness, Odometry, at_s)
            if number in (0, 5):
                bridge.server.publish("/amcl_pose", ros_json.pose(at_s, 2.0 + 0.05 * number, 1.0))
                arrives(witness, Pose, at_s)
        carried = arrives(witness, Pose, steps[14])
        assert carried.source == "odometry" and (carried.x_m, carried.y_m) == (pytest.approx(2.7), pytest.approx(1.0))
        assert witness.status().localised


def test_a_scan_is_taken_to_the_body_where_its_mount_is_known(bridge: Site) -> None:
    mounted = TopicFrames(frame="map", map_version="hall-1", laser=LaserMount(x_m=0.2, yaw_rad=np.pi))
    for frames, count in ((mounted, 1), (FRAMES, 0)):
        with bridge.witness(frames) as witness:
            bridge.server.publish("/scan", ros_json.scan(NOW_S, [1.0, None, None], frame="laser"))
            bridge.server.publish("/battery_state", ros_json.battery(NOW_S, 0.5))
            arrives(witness, Battery, NOW_S)
            found = samples(witness, Scan, NOW_S)
            assert len(found) == count
            for one in found:
                points = np.frombuffer(witness.blob(one.blob), dtype="<f4").reshape(-1, 3)
                assert np.allclose(points, [[-0.8, 0.0, 0.0]], atol=1e-6)


def test_a_picture_is_kept_whole_and_a_broken_one_is_left_out(bridge: Site) -> None:
    done, body = cv2.imencode(".jpg", np.full((24, 32, 3), 90, dtype=np.uint8))
    assert done
    with bridge.witness() as witness:
        for at_s, picture in ((NOW_S - 1.5, body.tobytes()[:40]), (NOW_S, body.tobytes())):
            data = base64.b64encode(picture).decode()
            message = {"header": ros_json.header(at_s, "camera"), "format": "jpeg", "data": data}
            bridge.server.publish("/image", message)
        image = arrives(witness, Image, NOW_S)
        assert (image.width_px, image.height_px, image.source) == (32, 24, "camera")
        assert witness.blob(image.blob) == body.tobytes()
        assert len([one for one in witness.observations(0).samples if isinstance(one, Image)]) == 1
        with pytest.raises(BlobDamaged):
            witness.blob(Digest("0" * 64))


def test_sequence_numbers_rise_over_a_restart_of_the_harness(bridge: Site) -> None:
    ends: list[int] = []
    for _ in range(2):
        with bridge.witness() as witness:
            ends += [witness.observations(0).samples[0].seq, witness.observations(0).next_seq]
        time.sleep(0.05)
    assert ends == sorted(ends)
