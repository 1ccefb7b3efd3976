"""A VDA 5050 vehicle and its broker in virtual time: docs/examples/vehicle.py, and a link that can damage what it
carries."""

import importlib.util
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from harness.adapters.clock import LockstepClock
from harness.adapters.providers.vda5050.robot import VehicleRobot, VehicleSettings
from harness.conformance.conformance_file import ConformanceFile, read
from harness.conformance.subject import ProviderUnderTest
from harness.contracts import protocol
from harness.contracts.ids import MissionId, NodeId, ProviderId, RequestId, sha256
from harness.provider_protocol.delegation import DelegatingProvider

ROOT = Path(__file__).resolve().parents[2]
EPOCH_S = 1_800_000_000.0
STEP_S = 0.05
LATENCY_S = 0.01
Damage = Callable[[str, bytes], list[tuple[float, bytes]]]
"""What becomes of a message on a topic: copies, each with its delay, seconds."""


def example() -> Any:
    """The module docs/examples/vehicle.py: a stranger to this harness."""
    spec = importlib.util.spec_from_file_location("example_vehicle", ROOT / "docs" / "examples" / "vehicle.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def at_once(topic: str, body: bytes) -> list[tuple[float, bytes]]:
    return [(LATENCY_S, body)]


def settings(**changed: Any) -> VehicleSettings:
    told: dict[str, Any] = {
        "name": "agv-1", "interface": "uagv", "manufacturer": "Acme", "serial_number": "0001", "version": "2.1",
        "frame": "map", "map_version": "shop-1", "map_id": "hall-1", "base_m": 1.5, "velocity_measured": True,
    }  # fmt: skip
    return VehicleSettings(**told | changed)


class VirtualSite:
    """One vehicle, the robot that the harness sees, and time that passes only on request.

    `up` and `down` are what the broker does to messages from and to the vehicle. `offset_s` is what the vehicle's own
    clock is ahead.
    """

    def __init__(self, *, journal: Path | None = None, **changed: Any) -> None:
        self.now_s, self.offset_s = EPOCH_S, 0.0
        self.up: Damage = at_once
        self.down: Damage = at_once
        self.settings, self.journal = settings(**changed), journal
        self.sent: list[tuple[str, Any]] = []
        self._queue: list[tuple[float, int, Callable[[], None]]] = []
        self._count = 0
        self._receivers: dict[str, Callable[[str, bytes], None]] = {}
        self.alive = True
        self.boot()
        self.robot = self.connected()
        self.clock = LockstepClock(self.advance_to, at_s=self.robot.now_s())
        self.provider = DelegatingProvider(self.robot.providers()[0])

    def boot(self) -> None:
        """Switch the vehicle on: it knows of nothing before."""
        self.vehicle = example().Vehicle(
            self._publish, lambda: self.now_s + self.offset_s, protocol=self.settings.version
        )
        self.vehicle.publish_connection()

    def connected(self) -> VehicleRobot:
        return VehicleRobot(
            self.settings,
            VirtualLink(self),
            journal=self.journal,
            local_s=lambda: self.now_s - EPOCH_S + 100.0,
            wall_s=lambda: self.now_s,
            wait=self.advance,
        )

    def reconnected(self) -> DelegatingProvider:
        """The harness's process ends and another one begins, on the same journal."""
        self.robot.close()
        self.robot = self.connected()
        self.provider.inner = self.robot.providers()[0]
        return self.provider

    def advance(self, seconds: float) -> None:
        until_s = self.now_s + seconds
        ticks = 0
        while self.now_s < until_s - 1e-9:
            self.now_s += min(STEP_S, until_s - self.now_s)
            if self.alive:
                self.vehicle.tick(STEP_S)
            for _, _, deliver in self._due():
                deliver()
            ticks += 1
            if ticks % 2 == 0 and hasattr(self, "robot"):
                self.robot.tick()

    def advance_to(self, mission_s: float) -> float:
        """Let mission time, which is the vehicle's clock as the robot knows it, come so far."""
        for _ in range(100_000):
            left_s = mission_s - self.robot.now_s()
            if left_s <= 1e-6:
                break
            self.advance(max(left_s, 1e-3))
        return mission_s

    def subscribe(self, topics: Sequence[str], receive: Callable[[str, bytes], None]) -> None:
        self._receivers = dict.fromkeys(topics, receive)
        if hasattr(self, "vehicle"):
            self.vehicle.publish_connection()

    def to_vehicle(self, topic: str, body: bytes) -> None:
        name = topic.rpartition("/")[2]
        self.sent.append((name, json.loads(body)))
        for delay_s, copy in self.down(name, body):
            self._later(delay_s, lambda copy=copy: self._at_vehicle(name, copy))

    def from_vehicle(self, name: str, message: dict[str, Any], *, damaged: bool = True) -> None:
        """Bring a message to the harness, as if the vehicle had sent it."""
        topic = f"uagv/v{self.settings.version[0]}/Acme/0001/{name}"
        body = json.dumps(message).encode()
        for delay_s, copy in self.up(name, body) if damaged else at_once(name, body):
            self._later(delay_s, lambda copy=copy: self._receivers.get(topic, lambda t, b: None)(topic, copy))

    def orders(self) -> list[Any]:
        """Every order message that was sent."""
        return [body for name, body in self.sent if name == "order"]

    def instant(self) -> list[str]:
        """Every instant action that was sent, without the questions."""
        kinds = [one["actionType"] for name, body in self.sent if name == "instantActions" for one in body["actions"]]
        return [kind for kind in kinds if not kind.endswith("Request")]

    def under_test(self) -> ProviderUnderTest:
        return ProviderUnderTest(
            provider=self.provider,
            clock=self.clock,
            reattached=self.reconnected,
            blob=lambda digest: self.robot.blob(digest),
            observations=lambda after, limit: self.robot.observations(after, limit),
            starts=lambda: self.robot.starts(),
        )

    def request(
        self, name: str = "one", *, target: tuple[float, float] = (3.0, 0.0), **changed: Any
    ) -> protocol.StartRequest:
        parameters: protocol.Parameters = {
            "route": ((0.0, 0.0), target), "target": target, "frame": "map", "tolerance_m": 0.4, "speed_cap_mps": 0.6,
        }  # fmt: skip
        identity = protocol.InvocationIdentity(
            mission_id=MissionId("msn_1"), node_id=NodeId(name), attempt=1,
            request_id=RequestId(sha256(name.encode())), provider_id=ProviderId("vda5050"),
        )  # fmt: skip
        return protocol.StartRequest(
            identity=identity, capability="navigate", parameters=parameters | changed.pop("parameters", {}), k_ctx=1,
            configuration=sha256(b""), deadline_s=changed.pop("deadline_s", self.robot.now_s() + 60.0),
            fencing={"mobile_base": 1}, **changed,
        )  # fmt: skip

    def run(
        self, handle: str, *, within_s: float = 60.0, until: Callable[[protocol.InvocationReport], bool] | None = None
    ) -> protocol.InvocationReport:
        """Keep it alive until it ends, or `until` holds."""
        ends = until or (lambda report: report.status in protocol.TERMINAL)
        report = self.provider.report(handle)
        for _ in range(int(within_s / 0.25)):
            if ends(report):
                break
            self.advance(0.25)
            self.provider.keepalive(handle)
            report = self.provider.report(handle)
        return report

    def _publish(self, name: str, message: dict[str, Any], retained: bool) -> None:
        self.from_vehicle(name, json.loads(json.dumps(message)))

    def _at_vehicle(self, name: str, body: bytes) -> None:
        if self.alive:
            self.vehicle.receive(name, json.loads(body))

    def _later(self, delay_s: float, deliver: Callable[[], None]) -> None:
        self._count += 1
        self._queue.append((self.now_s + delay_s, self._count, deliver))

    def _due(self) -> list[tuple[float, int, Callable[[], None]]]:
        due = sorted(one for one in self._queue if one[0] <= self.now_s)
        self._queue = [one for one in self._queue if one[0] > self.now_s]
        return due


class VirtualLink:
    """The harness's side of the virtual broker."""

    def __init__(self, site: VirtualSite) -> None:
        self._site, self._open = site, True

    def open(self, topics: Sequence[str], receive: Callable[[str, bytes], None], lost: Callable[[], None]) -> None:
        self._site.subscribe(topics, receive)

    def publish(self, topic: str, body: bytes) -> None:
        if self._open:
            self._site.to_vehicle(topic, body)

    def close(self) -> None:
        self._open = False


def conformance() -> ConformanceFile:
    """The conformance file of the example vehicle."""
    return read(ROOT / "docs" / "examples" / "drive-vehicle.yaml")
