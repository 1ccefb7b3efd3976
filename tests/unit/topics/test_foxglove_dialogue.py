"""A reader of a Foxglove server subscribes, asks again where the server refused, and does not ask for ever."""

import json
from typing import Any

import pytest

from harness.adapters.providers.topics.foxglove import MESSAGE, MOST_REPEATS, FoxgloveDialogue

REFUSAL = json.dumps({"op": "status", "level": 2, "message": "Unknown channel ID: 2"})
OFFERS = (("/amcl_pose", "geometry_msgs/msg/PoseStamped"), ("/odom", "nav_msgs/msg/Odometry"))
POSE = json.dumps({"header": {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "map"}}).encode()


class Reader:
    """A dialogue with two channels on offer, and what it sent."""

    def __init__(self) -> None:
        self.operations: list[dict[str, Any]] = []
        topics: Any = {"pose": "/amcl_pose", "odometry": "/odom"}
        self._dialogue = FoxgloveDialogue(topics, lambda *_: None, lambda *_: None, where="ws://robot")
        for number, (topic, kind) in enumerate(OFFERS, 1):
            offer = {"id": number, "topic": topic, "encoding": "json", "schemaName": kind}
            self.receives(json.dumps({"op": "advertise", "channels": [offer]}))

    def receives(self, message: str | bytes) -> None:
        self._dialogue.read(message, lambda text: self.operations.append(json.loads(text)))

    @property
    def subscribed(self) -> list[list[int]]:
        return [
            [one["channelId"] for one in asked["subscriptions"]]
            for asked in self.operations
            if asked["op"] == "subscribe"
        ]


def test_a_refused_subscription_is_asked_for_again_for_the_channels_that_stayed_silent() -> None:
    reader = Reader()
    reader.receives(MESSAGE.pack(1, 1, 0) + POSE)
    reader.receives(REFUSAL)
    assert reader.subscribed == [[1], [2], [2]]
    assert reader.operations[-2] == {"op": "unsubscribe", "subscriptionIds": [2]}


@pytest.mark.parametrize("level", [0, 1])
def test_a_notice_and_a_warning_change_nothing(level: int) -> None:
    reader = Reader()
    reader.receives(json.dumps({"op": "status", "level": level, "message": "slow"}))
    assert reader.subscribed == [[1], [2]]


def test_a_channel_that_is_withdrawn_is_not_asked_for_again() -> None:
    reader = Reader()
    reader.receives(json.dumps({"op": "unadvertise", "channelIds": [2]}))
    reader.receives(REFUSAL)
    assert reader.subscribed == [[1], [2], [1]]


def test_a_server_that_refuses_for_ever_is_not_asked_for_ever() -> None:
    reader = Reader()
    for _ in range(100):
        reader.receives(REFUSAL)
    assert len(reader.subscribed) == len(OFFERS) + MOST_REPEATS
