"""Evidence shown live to Foxglove: a client of its protocol sees a mission's samples and the gate's log, and can send
nothing."""

import json
import time
from collections.abc import Collection, Iterator
from contextlib import closing
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from app.background.foxglove_feed import FoxgloveFeed, FoxgloveServer, topic_types
from app.background.robot_reports import Fleet
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import RobotId
from harness.contracts.observations import Odometry, Pose, Scan
from tests.builders.topic_servers import Repetition
from tests.builders.waiting import Waiting, waiting
from tests.saying import raises_saying

ROBOT = "vbot-1"
WITHIN_S = 60.0
TOPICS = (f"/{ROBOT}/pose", f"/{ROBOT}/odometry", f"/{ROBOT}/scan", "/tf", "/regen/log")


@pytest.fixture(scope="module")
def asked() -> Iterator[Waiting]:
    """A mission under way that waits for a person."""
    with waiting() as made:
        yield made.asked()


class Viewer:
    """A client of the published protocol: subscribes to what it is offered, and keeps what comes."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket, self._store = socket, get_typestore(Stores.ROS2_JAZZY)
        self.offers: dict[int, tuple[str, str]] = {}
        self.capabilities: list[str] | None = None

    def message(self, topic: str) -> Any:
        """The next message of a topic, decoded by its advertised type."""
        until_s = time.monotonic() + WITHIN_S
        while True:
            found = self._received(until_s, f"no message on {topic}")
            if isinstance(found, bytes) and found[0] == 1:
                name, kind = self.offers[int.from_bytes(found[1:5], "little")]
                if name == topic:
                    return self._store.deserialize_cdr(found[13:], kind)

    def until_offered(self, topics: Collection[str]) -> None:
        until_s = time.monotonic() + WITHIN_S
        while missing := set(topics) - {topic for topic, _ in self.offers.values()}:
            self._received(until_s, f"no offer of {sorted(missing)}")

    def _received(self, until_s: float, missing: str) -> str | bytes:
        """What comes next, however much comes of other topics: never waits longer than until then."""
        left_s = until_s - time.monotonic()
        assert left_s > 0, f"{missing} within {WITHIN_S:g} s; on offer: {sorted(self.offers.values())}"
        try:
            found = self._socket.recv(timeout=left_s)
        except TimeoutError:
            pytest.fail(f"{missing} within {WITHIN_S:g} s; on offer: {sorted(self.offers.values())}")
        if isinstance(found, str):
            self._operation(json.loads(found))
        return found

    def _operation(self, said: dict[str, Any]) -> None:
        assert said["op"] != "status", said["message"]
        if said["op"] == "serverInfo":
            self.capabilities = said["capabilities"]
        for one in said.get("channels", ()):
            self.offers[one["id"]] = (one["topic"], one["schemaName"])
            assert one["encoding"] == "cdr" and one["schema"]
            request = {"op": "subscribe", "subscriptions": [{"id": one["id"], "channelId": one["id"]}]}
            self._socket.send(json.dumps(request))


def test_a_viewer_sees_the_missions_samples_and_what_the_gate_appends(asked: Waiting) -> None:
    live = asked.runtime.observations(asked.runtime.missions()[0].mission_id)
    assert live is not None
    fleet = Fleet(asked.harness.robots, asked.harness.cameras, lambda: 0.0)
    with closing(FoxgloveServer(0, topic_types([RobotId(ROBOT)]))) as server:
        shown = Repetition(lambda: FoxgloveFeed(asked.runtime, fleet, server.publish, after=0).step())
        with (
            closing(shown),
            connect(server.address, subprotocols=[Subprotocol("foxglove.sdk.v1")], compression=None) as socket,
        ):
            viewer = Viewer(socket)
            seen = {topic: viewer.message(topic) for topic in TOPICS}
    poses = {(one.x_m, one.y_m): one for one in live.samples if isinstance(one, Pose)}
    pose = seen[TOPICS[0]]
    assert (pose.pose.position.x, pose.pose.position.y) in poses and pose.header.frame_id == "map"
    odometry = seen[TOPICS[1]].twist.twist.linear.x
    assert odometry in {one.v_mps for one in live.samples if isinstance(one, Odometry)}
    assert seen[TOPICS[2]].width in {one.points for one in live.samples if isinstance(one, Scan)}
    (transform,) = seen["/tf"].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", f"{ROBOT}/body")
    assert (seen["/regen/log"].name, seen["/regen/log"].msg.split()[2]) == ("gate", "version")
    assert viewer.capabilities == [], "a viewer may subscribe and nothing else"


def test_every_topic_is_on_offer_before_anything_was_sensed() -> None:
    topics = topic_types([RobotId(ROBOT), RobotId("vbot-2")])
    with (
        closing(FoxgloveServer(0, topics)) as server,
        connect(server.address, subprotocols=[Subprotocol("foxglove.sdk.v1")], compression=None) as socket,
    ):
        viewer = Viewer(socket)
        viewer.until_offered(topics)
    assert dict(viewer.offers.values()) == topics and set(TOPICS) < set(topics)


def test_a_taken_port_is_named() -> None:
    with closing(FoxgloveServer(0, topic_types([RobotId(ROBOT)]))) as server:
        port = int(server.address.rpartition(":")[2])
        with raises_saying(ContractInvalid, match=f"on port {port}"):
            FoxgloveServer(port, {})
