"""The example VDA 5050 vehicle under another master control, listened to in virtual time: what is sent is counted."""

import json
from collections.abc import Callable, Sequence
from typing import Any

from harness.adapters.providers.vda5050.listened import ListenedVehicle
from tests.builders.vehicles import EPOCH_S, STEP_S, example, settings

PREFIX = "uagv/v2/Acme/0001"


class SilentLink:
    """The harness's side of the broker; whatever it publishes is kept."""

    def __init__(self) -> None:
        self.published: list[tuple[str, bytes]] = []
        self.topics: tuple[str, ...] = ()
        self.receive: Callable[[str, bytes], None] = lambda topic, body: None

    def open(self, topics: Sequence[str], receive: Callable[[str, bytes], None], lost: Callable[[], None]) -> None:
        self.topics, self.receive = tuple(topics), receive

    def publish(self, topic: str, body: bytes) -> None:
        self.published.append((topic, body))

    def close(self) -> None:
        """Nothing is open."""


class OtherMaster:
    """The vehicle, who commands it, and the harness that listens. Time passes only on request."""

    def __init__(self, **changed: Any) -> None:
        self.now_s, self.offset_s = EPOCH_S, 0.0
        self.link = SilentLink()
        self.boot()
        self.listened = ListenedVehicle(settings(**changed), self.link, local_s=lambda: self.now_s - EPOCH_S + 100.0)
        self.advance(0.5)

    def boot(self) -> None:
        """Switch the vehicle on: it knows of nothing before."""
        self.vehicle = example().Vehicle(self._heard, lambda: self.now_s + self.offset_s)

    def orders(self, order_id: str, x_m: float, *, heard: bool = True, map_id: str = "hall-1") -> None:
        """The other master sends the vehicle to x, over a node on the way. `heard`: the harness reads the order too."""
        places = [self.vehicle.x, (self.vehicle.x + x_m) / 2, x_m]
        nodes = [
            {
                "nodeId": f"{order_id}-{index}", "sequenceId": 2 * index, "released": True, "actions": [],
                "nodePosition": {"x": place, "y": 0.0, "mapId": map_id},
            }
            for index, place in enumerate(places)
        ]  # fmt: skip
        edges = [
            {"edgeId": f"{order_id}-e{index}", "sequenceId": 2 * index + 1, "released": True, "actions": []}
            for index in range(2)
        ]
        message = self.vehicle.header("order") | {
            "orderId": order_id, "orderUpdateId": 0, "nodes": nodes, "edges": edges
        }  # fmt: skip
        if heard:
            self._heard("order", message, False)
        self.vehicle.receive("order", message)

    def advance(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.vehicle.tick(STEP_S)

    def _heard(self, name: str, message: dict[str, Any], retained: bool) -> None:
        self.link.receive(f"{PREFIX}/{name}", json.dumps(message).encode())
