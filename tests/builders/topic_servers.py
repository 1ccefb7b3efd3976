"""Servers of a robot's topics: a rosbridge of our own, the server of foxglove-sdk, and a DDS writer; and a bridge that
publishes on them what the example robot senses."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import foxglove
import numpy as np
from rosbags.typesys import Stores, get_typestore
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from harness.adapters.providers.http.robot import HttpRobot
from harness.adapters.providers.topics import ros_messages
from harness.contracts.errors import ProviderFailed
from harness.contracts.observations import AnySample, Battery, Odometry, Pose
from tests.builders.ros_json import battery, odometry, pose

ROOT = Path(__file__).resolve().parents[2]
TOPICS = {"pose": "/amcl_pose", "odometry": "/odom", "battery": "/battery_state", "scan": "/scan", "image": "/image"}
KINDS = {
    "/amcl_pose": ros_messages.POSE_COVARIANCE,
    "/odom": ros_messages.ODOMETRY,
    "/battery_state": ros_messages.BATTERY,
    "/scan": ros_messages.SCAN,
    "/image": ros_messages.COMPRESSED_IMAGE,
}


class TopicServer(Protocol):
    """Where messages are published, as JSON has them."""

    address: str

    def publish(self, topic: str, message: dict[str, Any]) -> None: ...

    def repeat(self, topic: str, message: dict[str, Any]) -> "Repetition": ...

    def close(self) -> None: ...


class Repetition:
    """Publishes the same message again and again until it is closed."""

    def __init__(self, publish: Callable[[], None]) -> None:
        self._publish, self._closing = publish, threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _follow(self) -> None:
        while not self._closing.wait(0.02):
            self._publish()


class Repeating:
    """A server that can repeat what it publishes."""

    def publish(self, topic: str, message: dict[str, Any]) -> None:
        raise NotImplementedError

    def repeat(self, topic: str, message: dict[str, Any]) -> Repetition:
        return Repetition(lambda: self.publish(topic, message))


class Rosbridge(Repeating):
    """The part of rosbridge's protocol that readers need: it answers `subscribe` and sends `publish`.

    `asked` has every operation that came, in order.
    """

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self._readers: dict[str, list[ServerConnection]] = {}
        self._lock = threading.Lock()
        self._server = serve(self._answer, "127.0.0.1", 0, compression=None)
        self.address = f"ws://127.0.0.1:{self._server.socket.getsockname()[1]}"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def publish(self, topic: str, message: dict[str, Any]) -> None:
        self.send(topic, json.dumps({"op": "publish", "topic": topic, "msg": message}))

    def send(self, topic: str, text: str | bytes) -> None:
        """Send exactly this to whoever subscribed to the topic."""
        with self._lock:
            readers = list(self._readers.get(topic, ()))
        for reader in readers:
            try:
                reader.send(text)
            except ConnectionClosed:
                continue

    def drop(self) -> None:
        """Every connection breaks."""
        with self._lock:
            readers = {one for found in self._readers.values() for one in found}
            self._readers.clear()
        for one in readers:
            one.close()

    def close(self) -> None:
        self._server.shutdown()
        self.drop()
        self._thread.join()

    def _answer(self, socket: ServerConnection) -> None:
        for text in socket:
            operation = json.loads(text)
            self.asked.append(operation)
            with self._lock:
                readers = self._readers.setdefault(operation["topic"], [])
                if operation["op"] == "subscribe" and socket not in readers:
                    readers.append(socket)


class FoxgloveServer(Repeating):
    """The server of foxglove-sdk, with one channel for each topic; `encoding` is json or cdr."""

    def __init__(self, encoding: str, kinds: Mapping[str, tuple[str, str]] = MappingProxyType({})) -> None:
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._context = foxglove.Context()
        self._server = foxglove.start_server(host="127.0.0.1", port=0, context=self._context)
        self.address = f"ws://127.0.0.1:{self._server.port}"
        self._encoding = encoding
        offers = {topic: (kind, encoding) for topic, kind in KINDS.items()} | dict(kinds)
        self._channels = {topic: self._channel(topic, *offer) for topic, offer in offers.items()}

    def _channel(self, topic: str, kind: str, encoding: str) -> foxglove.Channel:
        text = str(self._store.generate_msgdef(kind, ros_version=2)[0]) if encoding == "cdr" else "{}"
        named = {"json": "jsonschema", "cdr": "ros2msg"}.get(encoding, encoding)
        schema = foxglove.Schema(name=kind, encoding=named, data=text.encode())
        return foxglove.Channel(topic, schema=schema, message_encoding=encoding, context=self._context)

    def publish(self, topic: str, message: dict[str, Any]) -> None:
        body = json.dumps(message).encode() if self._encoding == "json" else self._cdr(KINDS[topic], message)
        self._channels[topic].log(body)

    def close(self) -> None:
        self._server.stop()

    def _cdr(self, kind: str, message: dict[str, Any]) -> bytes:
        return bytes(self._store.serialize_cdr(filled(self._store, kind, message), kind))


def filled(store: Any, kind: str, found: dict[str, Any]) -> Any:
    """The message as rosbags has it, fields that are not given left at zero."""
    values: dict[str, Any] = {}
    for name, (shape, what) in store.get_msgdef(kind).fields:
        given = found.get(name)
        if shape.name == "NAME":
            values[name] = filled(store, what, given or {})
        elif shape.name == "BASE":
            values[name] = given if given is not None else ("" if what[0] == "string" else 0)
        else:
            element, length = what[0][1][0], what[1] if shape.name == "ARRAY" else 0
            values[name] = np.array(given if given is not None else [0] * length, dtype=element)
    return store.types[kind](**values)


class DdsWriter(Repeating):
    """Writers of ROS 2 topics in a process of their own, on this machine only."""

    def __init__(self) -> None:
        domain = 100 + time.time_ns() // 1000 % 120
        self.address = f"dds://127.0.0.1/{domain}"
        words = [sys.executable, "-m", "tests.builders.dds_writer", str(domain)]
        self._process = subprocess.Popen(words, cwd=ROOT, stdin=subprocess.PIPE, text=True)

    def publish(self, topic: str, message: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([topic, KINDS[topic], message]) + "\n")
        self._process.stdin.flush()

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


class Bridge:
    """Publishes what the example robot senses on a server of topics; `altered` may lie about it."""

    def __init__(
        self, address: str, token: str, server: TopicServer, altered: Callable[[AnySample], AnySample | None]
    ) -> None:
        self._address, self._token, self._server, self._altered = address, token, server, altered
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _follow(self) -> None:
        after = 0
        with closing(HttpRobot(self._address, self._token)) as robot:
            while not self._closing.wait(0.03):
                try:
                    found = robot.observations(after)
                except ProviderFailed:
                    continue
                after = found.next_seq
                for one in found.samples:
                    sample = self._altered(one)
                    if sample is not None:
                        self._publish(sample)

    def _publish(self, sample: AnySample) -> None:
        match sample:
            case Pose():
                self._server.publish("/amcl_pose", pose(sample.at_s, sample.x_m, sample.y_m, sample.yaw_rad))
            case Odometry():
                message = odometry(
                    sample.at_s, sample.x_m, sample.y_m, sample.yaw_rad, v=sample.v_mps, w=sample.w_radps
                )
                self._server.publish("/odom", message)
            case Battery():
                self._server.publish("/battery_state", battery(sample.at_s, sample.charge))
            case _:
                return


@contextmanager
def bridged(
    address: str, token: str, server: TopicServer, altered: Callable[[AnySample], AnySample | None] = lambda one: one
) -> Iterator[Bridge]:
    bridge = Bridge(address, token, server, altered)
    try:
        yield bridge
    finally:
        bridge.close()


def eventually(found: Callable[[], bool], what: str, *, within_s: float = 30.0) -> None:
    until_s = time.monotonic() + within_s
    while not found():
        assert time.monotonic() < until_s, f"not within {within_s:g} s: {what}"
        time.sleep(0.02)
