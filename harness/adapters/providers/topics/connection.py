"""Opens the topics that witness for a robot: by rosbridge, by a Foxglove WebSocket, or by DDS."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from importlib.util import find_spec
from typing import Literal

from harness.adapters.pictures import PICTURES
from harness.adapters.providers.topics.samples import TopicFrames, TopicSamples
from harness.adapters.providers.topics.witness import TopicLink, Topics, TopicWitness, witnessed
from harness.contracts.errors import ContractInvalid
from harness.contracts.ports import Robot
from harness.contracts.reasons import because

Transport = Literal["rosbridge", "foxglove", "dds"]
EXTRA = "dds"


def topic_witness(
    robot: Robot,
    *,
    transport: Transport,
    address: str,
    token: str,
    topics: Topics,
    frames: TopicFrames,
    now_s: Callable[[], float],
) -> AbstractContextManager[TopicWitness]:
    """The robot's topics as its witness, until the block ends; `now_s` is the robot's own clock.

    Raises ProviderUnreachable where pose and odometry do not come, ContractInvalid where a library is not installed.
    """
    link = _link(transport, address, token=token, topics=topics)
    samples = TopicSamples(frames, now_s=now_s, first_seq=int(time.time() * 1000), size_of=PICTURES.size)
    return witnessed(robot, link, samples, address=address)


def _link(transport: Transport, address: str, *, token: str, topics: Topics) -> TopicLink:
    """Each transport's libraries load only for sites that use it."""
    if transport == "rosbridge":
        return _rosbridge(address, token=token, topics=topics)
    if transport == "foxglove":
        return _foxglove(address, token=token, topics=topics)
    if find_spec("cyclonedds") is None:
        raise ContractInvalid(because("extra_not_installed", extra=EXTRA))
    from harness.adapters.providers.topics.dds import DdsLink  # noqa: PLC0415

    return DdsLink(address, topics)


def _rosbridge(address: str, *, token: str, topics: Topics) -> TopicLink:
    from harness.adapters.providers.topics.rosbridge import RosbridgeDialogue  # noqa: PLC0415
    from harness.adapters.providers.topics.websocket_link import WebSocketLink  # noqa: PLC0415

    return WebSocketLink(address, partial(RosbridgeDialogue, topics), token=token)


def _foxglove(address: str, *, token: str, topics: Topics) -> TopicLink:
    from harness.adapters.providers.topics.foxglove import FoxgloveDialogue  # noqa: PLC0415
    from harness.adapters.providers.topics.websocket_link import WebSocketLink  # noqa: PLC0415

    return WebSocketLink(address, partial(FoxgloveDialogue, topics, where=address), token=token)
