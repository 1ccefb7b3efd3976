"""Reads ROS 2 topics straight from DDS, by Cyclone DDS: data readers only, never a writer, a service or an action.

A request to a service of another middleware can exhaust the robot's memory (ros2/rmw_cyclonedds#184, #577); so none is
made here. Peers are named and asked one by one: multicast is off, as on most robots' networks it does not arrive.
"""

import ipaddress
import threading
from typing import Any
from urllib.parse import urlsplit

from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from harness.adapters.providers.topics import ros_messages
from harness.adapters.providers.topics.dds_types import DDS_TYPES
from harness.adapters.providers.topics.ros_messages import Role
from harness.adapters.providers.topics.witness import LeaveOut, Receive, Topics
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.reasons import because

LOOK_S = 0.02
MOST_TAKEN = 200
READERS = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(100))
"""Asks for so little that every writer offers it."""


class DdsLink:
    """Implements `TopicLink`. `address` is `dds://PEER/DOMAIN`. Raises ProviderUnreachable where the domain cannot be
    joined."""

    def __init__(self, address: str, topics: Topics) -> None:
        parts = urlsplit(address)
        self._address, self._topics = address, topics
        self._peer, self._domain_id = parts.hostname or "", int(parts.path.strip("/") or 0)
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._readers: list[tuple[Role, str, DataReader[Any]]] = []
        self._owners: tuple[Any, ...] = ()

    @property
    def connected(self) -> bool:
        """DDS has no connection that could be lost: a writer that is gone shows in its samples' age."""
        return self._thread is not None and self._thread.is_alive()

    def open(self, receive: Receive, leave_out: LeaveOut) -> None:
        try:
            domain = Domain(self._domain_id, settings_of(self._peer))
            participant = DomainParticipant(self._domain_id)
            self._owners = (participant, domain)
            for role, name in self._topics.items():
                for kind in ros_messages.TYPES[role]:
                    topic = Topic(participant, f"rt/{name.lstrip('/')}", DDS_TYPES[kind])
                    self._readers.append((role, kind, DataReader(participant, topic, qos=READERS)))
        except DDSException as error:
            raise ProviderUnreachable(
                because("dds_domain_refused", domain=self._domain_id, error=str(error)[:200]), where=self._address
            ) from error
        self._thread = threading.Thread(
            target=self._follow, args=(receive, leave_out), name=f"topics {self._address}", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        self._readers.clear()
        self._owners = ()

    def _follow(self, receive: Receive, leave_out: LeaveOut) -> None:
        while not self._closing.wait(LOOK_S):
            for role, kind, reader in self._readers:
                try:
                    for message in reader.take(MOST_TAKEN):
                        if isinstance(message, DDS_TYPES[kind]):
                            receive(role, kind, message)
                except (DDSException, ValueError) as error:
                    reason = because("topic_message_unusable", topic=self._topics[role], error=str(error)[:200])
                    leave_out(role, reason)


def settings_of(peer: str) -> str:
    """Cyclone's settings: one peer by its address, no multicast; on this machine nothing leaves the loopback."""
    interface = '<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>' if is_loopback(peer) else ""
    return (
        f'<CycloneDDS><Domain Id="any"><General>{interface}<AllowMulticast>false</AllowMulticast></General>'
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>"
        f'<Peers><Peer Address="{peer}"/></Peers></Discovery></Domain></CycloneDDS>'
    )


def is_loopback(peer: str) -> bool:
    try:
        return ipaddress.ip_address(peer).is_loopback
    except ValueError:
        return peer == "localhost"
