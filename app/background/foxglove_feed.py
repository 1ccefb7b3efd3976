"""Streams evidence live to Foxglove and Lichtblick, as ROS messages over WebSocket. It accepts no commands."""

from collections.abc import Callable, Iterable, Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np

from app.background.robot_reports import Fleet
from harness.adapters.providers.recording import messages
from harness.adapters.providers.recording.ros_message_types import RosMessageTypes, nanoseconds
from harness.adapters.providers.recording.topics import StaticTransform
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.ids import Digest, RobotId
from harness.contracts.observations import AnySample, Image, Odometry, Pose, Scan
from harness.contracts.reasons import because
from harness.runtime import Runtime
from harness.workers import Background, Worker

EXTRA = "foxglove"
HOST = "127.0.0.1"
EVERY_S = 0.2
MOST_EVENTS = 500
IDENTITY = np.eye(4)
TF_TOPIC = "/tf"
LOG_TOPIC = "/regen/log"
"""What the gate appended, line by line."""
SAMPLE_TYPES = {
    "pose": messages.POSE,
    "odometry": messages.ODOMETRY,
    "scan": messages.CLOUD,
    "image": messages.COMPRESSED_IMAGE,
}
"""The ROS type of each topic that every robot has."""
Publish = Callable[[str, bytes, float], None]
"""Topic, body, sensor time in seconds."""


def topic_types(robots: Iterable[RobotId]) -> dict[str, str]:
    """Every topic that a feed of these robots publishes on, and its ROS type."""
    own = {f"/{robot_id}/{name}": kind for robot_id in robots for name, kind in SAMPLE_TYPES.items()}
    return own | {TF_TOPIC: messages.TRANSFORMS, LOG_TOPIC: messages.LOG}


class FoxgloveServer:
    """A server of the Foxglove WebSocket protocol on this machine only, without a capability: a client may subscribe.

    `topics`: the ROS type of every topic there will be. All are on offer before the first client connects: the library
    tells a connected client of a new channel before it accepts subscriptions to it, and refuses one that comes quickly.
    Raises ContractInvalid where the library is missing or the port is taken.
    """

    def __init__(self, port: int, topics: Mapping[str, str]) -> None:
        if find_spec("foxglove") is None:
            raise ContractInvalid(because("foxglove_not_installed", extra=EXTRA))
        import foxglove  # noqa: PLC0415  it loads where somebody asked for it

        types = RosMessageTypes()
        self._context = foxglove.Context()  # kept, as neither the server nor a channel holds it
        self._channels: dict[str, Any] = {}
        for topic, kind in topics.items():
            schema = foxglove.Schema(name=kind, encoding="ros2msg", data=types.definition(kind).encode())
            self._channels[topic] = foxglove.Channel(
                topic, schema=schema, message_encoding="cdr", context=self._context
            )
        try:
            self._server = foxglove.start_server(
                name="RegenHarness", host=HOST, port=port, capabilities=[], context=self._context
            )
        except (OSError, RuntimeError) as error:
            raise ContractInvalid(because("foxglove_port_refused", port=port, error=str(error)[:200])) from error
        self.address = f"ws://{HOST}:{self._server.port}"

    def publish(self, topic: str, body: bytes, at_s: float) -> None:
        """One message on a topic on offer, to whoever subscribed; nobody is waited for."""
        self._channels[topic].log(body, log_time=nanoseconds(at_s))

    def close(self) -> None:
        self._server.stop()


class FoxgloveFeed(Background):
    """Reads on what was sensed of every robot and what the gate appended; each sample is published once.

    `after`: the position in the log after which it begins.
    """

    def __init__(self, runtime: Runtime, fleet: Fleet, publish: Publish, *, after: int) -> None:
        self._runtime, self._fleet, self._publish = runtime, fleet, publish
        self._types = RosMessageTypes()
        self._newest: dict[RobotId, int] = {}
        self._position = after
        self._worker = Worker("foxglove feed", self.step, every_s=EVERY_S, close_within_s=2.0)

    def step(self) -> None:
        """Publish what is new. Raises HarnessError if the log cannot be read."""
        for robot_id in self._fleet.own:
            after = self._newest.get(robot_id, 0)
            fresh = sorted((one for one in self._seen(robot_id) if one.seq > after), key=lambda one: one.seq)
            for sample in fresh:
                self._sample(robot_id, sample)
                self._newest[robot_id] = sample.seq
        for event in self._runtime.log(self._position, MOST_EVENTS):
            self._position = event.position
            text = f"{event.kind} {event.stream} version {event.version} digest {event.digest[:12]}"
            self._publish(LOG_TOPIC, self._types.log(event.recorded_s, "gate", text), event.recorded_s)

    def _seen(self, robot_id: RobotId) -> tuple[AnySample, ...]:
        """What its running mission reads, which is its evidence; else what is read of it for people."""
        for mission in self._runtime.open_missions(robot_id):
            live = self._runtime.observations(mission.mission_id)
            if live is not None:
                return live.samples
        return self._fleet.samples(robot_id)[0]

    def _sample(self, robot_id: RobotId, sample: AnySample) -> None:
        types, at_s = self._types, sample.at_s
        match sample:
            case Pose():
                self._publish(f"/{robot_id}/pose", types.pose(sample), at_s)
                body = types.transforms(at_s, [_body_in_map(robot_id, sample)])
                self._publish(TF_TOPIC, body, at_s)
            case Odometry():
                self._publish(f"/{robot_id}/odometry", types.odometry(sample), at_s)
            case Scan():
                points = np.frombuffer(self._blob(robot_id, sample.blob), dtype="<f4")
                cloud = points[: len(points) // 3 * 3].reshape(-1, 3).astype(np.float64)
                body = types.cloud(at_s, _frame(robot_id), cloud, moved=IDENTITY)
                self._publish(f"/{robot_id}/scan", body, at_s)
            case Image():
                kind = sample.media_type.removeprefix("image/")
                body = types.image(at_s, _frame(robot_id), self._blob(robot_id, sample.blob), kind)
                self._publish(f"/{robot_id}/image", body, at_s)
            case _:
                return

    def _blob(self, robot_id: RobotId, digest: Digest) -> bytes:
        """Empty for bytes that nobody holds any longer."""
        try:
            return self._runtime.blob(digest) if self._runtime.has_blob(digest) else self._fleet.blob(robot_id, digest)
        except HarnessError:
            return b""


def _frame(robot_id: RobotId) -> str:
    return f"{robot_id}/body"


def _body_in_map(robot_id: RobotId, pose: Pose) -> StaticTransform:
    turn = (0.0, 0.0, float(np.sin(pose.yaw_rad / 2)), float(np.cos(pose.yaw_rad / 2)))
    return StaticTransform(
        parent=pose.frame, child=_frame(robot_id), translation_m=(pose.x_m, pose.y_m, 0.0), rotation=turn
    )
