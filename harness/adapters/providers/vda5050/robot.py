"""A VDA 5050 vehicle behind an MQTT broker as a robot: one provider that drives, its condition, its samples."""

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import msgspec

from harness.adapters.providers.vda5050 import messages
from harness.adapters.providers.vda5050.navigator import FAILURES, VehicleNavigator
from harness.adapters.providers.vda5050.vehicle import MapIdentity, Vehicle, VehicleIdentity
from harness.contracts import capabilities, protocol
from harness.contracts.errors import BlobDamaged, HarnessError, ProviderUnreachable
from harness.contracts.ids import Digest, ProviderId, RequestId, ResourceId
from harness.contracts.ports import Provider
from harness.contracts.reasons import because
from harness.contracts.values import Value

PROVIDER = ProviderId("vda5050")
TICK_S = 0.1
QUIET_S, ASK_S = 0.4, 0.5
"""A vehicle whose newest message is older than QUIET_S is asked for its state, at most once in ASK_S, while somebody
reads its samples or it drives for us."""
READ_S = 3.0
FIRST_S = 5.0
SPEED_MPS = 1.0
"""The highest speed where neither the factsheet nor the site names one."""
FRESH_POSE_S = 2.0


class VehicleSettings(Value):
    """Which vehicle, on which map, within which bounds. `velocity_measured`: by wheels of its own (D15)."""

    name: str
    interface: str
    manufacturer: str
    serial_number: str
    version: messages.Version
    frame: str
    map_version: str
    map_id: str
    base_m: float
    velocity_measured: bool = False
    speed_limit_mps: float | None = None


class MessageLink(Protocol):
    """Carries messages to and from a vehicle. `open` subscribes; from then on `receive` is called for each message,
    and `lost` where the connection breaks. Raises ProviderUnreachable."""

    def open(self, topics: Sequence[str], receive: Callable[[str, bytes], None], lost: Callable[[], None]) -> None: ...

    def publish(self, topic: str, body: bytes) -> None: ...

    def close(self) -> None: ...


class VehicleRobot:
    """Implements `contracts.ports.Robot`. One lock holds every call, every message and every turn of the loop apart.

    `wait` lets time pass while the vehicle's first messages are awaited; `wall_s` stamps what is sent.
    """

    def __init__(
        self,
        settings: VehicleSettings,
        link: MessageLink,
        *,
        journal: Path | None,
        local_s: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        self._settings, self._link, self._local_s, self._wall_s = settings, link, local_s, wall_s
        self._lock = threading.RLock()
        self._numbers: dict[str, int] = {}
        self._read_local_s = self._asked_local_s = local_s()
        identity = VehicleIdentity(settings.interface, settings.manufacturer, settings.serial_number, settings.version)
        site = MapIdentity(settings.frame, settings.map_version, settings.map_id)
        self.vehicle = Vehicle(
            identity,
            site,
            velocity_measured=settings.velocity_measured,
            local_s=local_s,
            first_seq=int(wall_s() * 1000),
        )
        link.open([identity.topic(one) for one in messages.INCOMING], self._receive, self._lost)
        self._meet(wait)
        self._navigator = VehicleNavigator(
            self.vehicle, self._card(), send=self._send, local_s=local_s, journal=journal, base_m=settings.base_m
        )

    def providers(self) -> Sequence[Provider]:
        return (LockedProvider(self._navigator, self._lock),)

    def cards(self) -> Sequence[capabilities.CapabilityCard]:
        """The card as it would be now: a vehicle whose factsheet changed has another one."""
        with self._lock:
            return (self._card(),)

    def status(self) -> protocol.RobotStatus:
        """Raises ProviderUnreachable while nothing is known of the vehicle."""
        with self._lock:
            self._read_local_s = self._local_s()
            self._ask()
            state, fix, now_s = self.vehicle.current(), self.vehicle.newest, self.vehicle.now_s
            position = state.position
            ours = position is not None and position.map_id == self._settings.map_id
            return protocol.RobotStatus(
                robot_id=self._settings.name,
                at_s=now_s,
                posture="moving" if state.driving else "standing",
                armed=state.driving or self._navigator.at_work,
                hardware_stop=state.safety_state.engaged,
                charge=state.charge or 0.0,
                localised=self.vehicle.localised(),
                map_version=self._settings.map_version if ours else "",
                pose_age_s=None if fix is None else max(0.0, now_s - fix.at_s),
            )

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        """Raises ProviderUnreachable while nothing is known of the vehicle."""
        with self._lock:
            self._read_local_s = self._local_s()
            self._ask()
            self.vehicle.current()
            return self.vehicle.observations(after, limit)

    def blob(self, digest: Digest) -> bytes:
        """Raises BlobDamaged: a vehicle gives out no bytes."""
        raise BlobDamaged(because("robot_blob_differs", blob=digest[:12]), where=self._settings.name)

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        with self._lock:
            return self._navigator.starts()

    def now_s(self) -> float:
        """The vehicle's own clock. Raises ProviderUnreachable before its first message."""
        with self._lock:
            if not self.vehicle.known:
                raise ProviderUnreachable(because("vehicle_silent", vehicle=self._settings.serial_number))
            return self.vehicle.now_s

    def tick(self) -> None:
        """One turn of the loop, ten times a second."""
        with self._lock:
            if self._navigator.at_work or self._local_s() - self._read_local_s < READ_S:
                self._ask()
            self._navigator.tick()

    def close(self) -> None:
        """Pause the vehicle where it drives for us, and leave the broker."""
        with self._lock:
            self._navigator.leave()
        self._link.close()

    def _meet(self, wait: Callable[[float], None]) -> None:
        """Wait for the first state and for the factsheet. Raises ProviderUnreachable without a state of now."""
        until_s = self._local_s() + FIRST_S
        self._act("factsheetRequest")
        while self._local_s() < until_s:
            with self._lock:
                self._ask()
                if self.vehicle.factsheet is not None and self.vehicle.known and self.vehicle.trouble() is None:
                    return
            wait(TICK_S)
        with self._lock:
            self.vehicle.current()

    def _ask(self) -> None:
        """Ask for a state where none of now is there."""
        local_s = self._local_s()
        if self.vehicle.age_s > QUIET_S and local_s - self._asked_local_s >= ASK_S:
            self._asked_local_s = local_s
            self.vehicle.note_request()
            self._act("stateRequest")

    def _act(self, action_type: str) -> None:
        action_id = f"{action_type}-{int(self._wall_s() * 1000)}"
        self._send("instantActions", messages.instant_body(action_type, action_id, version=self._settings.version))

    def _send(self, topic: messages.Topic, body: dict[str, Any]) -> int:
        number = self._numbers[topic] = self._numbers.get(topic, 0) + 1
        head = messages.header(
            number,
            at_s=self._wall_s(),
            version=self._settings.version,
            manufacturer=self._settings.manufacturer,
            serial_number=self._settings.serial_number,
        )
        self._link.publish(self.vehicle.identity.topic(topic), msgspec.json.encode(head | body))
        return number

    def _receive(self, topic: str, body: bytes) -> None:
        name = topic.rpartition("/")[2]
        with self._lock:
            for one in messages.INCOMING:
                if name == one:
                    self.vehicle.receive(one, body)

    def _lost(self) -> None:
        with self._lock:
            self.vehicle.lost_connection()

    def _card(self) -> capabilities.CapabilityCard:
        """What the vehicle can be asked for: by its factsheet, and by the site's bounds."""
        factsheet, settings = self.vehicle.factsheet, self._settings
        known = factsheet.actions if factsheet else frozenset()
        bounds = (factsheet.speed_mps if factsheet else None, settings.speed_limit_mps)
        fastest = min((one for one in bounds if one is not None), default=SPEED_MPS)
        series = factsheet.type_specification.series_name if factsheet else ""
        odometry = ("odometry",) if settings.velocity_measured else ()
        return capabilities.CapabilityCard(
            provider_id=PROVIDER,
            version=f"{settings.version}.0",
            capability="navigate",
            embodiments=("agv",),
            parameters=(
                capabilities.Parameter(name="route", type="points", unit="m"),
                capabilities.Parameter(name="target", type="point", unit="m"),
                capabilities.Parameter(name="frame", type="frame"),
                capabilities.Parameter(name="tolerance_m", type="number", unit="m", minimum=0.05, maximum=2.0),
                capabilities.Parameter(name="speed_cap_mps", type="number", unit="m/s", minimum=0.05, maximum=fastest),
            ),
            preconditions=("localised",),
            side_effects=("moves the vehicle",),
            latency=capabilities.Latency(base_s=4.0, per_metre_s=2.5),
            resources=(ResourceId("mobile_base"),),
            cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=5.0),
            risk="medium",
            failure_words=FAILURES,
            evidence=("pose", *odometry, "battery"),
            estimates=capabilities.Estimates(success=0.9, risk=0.1, uncertainty=0.1, cost=1.0),
            moves=True,
            sources=("localiser", *odometry),
            reattach="by_request",
            resumable=not known or {"startPause", "stopPause"} <= known,
            software=f"{settings.manufacturer} {settings.serial_number} {series}".strip()[:200],
            protocol=protocol.PROTOCOL,
        )


class LockedProvider:
    """A navigator behind its robot's lock: implements `contracts.ports.Provider` for callers on any thread."""

    def __init__(self, navigator: VehicleNavigator, lock: threading.RLock) -> None:
        self._navigator, self._lock = navigator, lock

    @property
    def card(self) -> capabilities.CapabilityCard:
        return self._navigator.card

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        with self._lock:
            return self._navigator.start(request)

    def report(self, handle: str) -> protocol.InvocationReport:
        with self._lock:
            return self._navigator.report(handle)

    def find(self, request: RequestId) -> protocol.InvocationReport | None:
        with self._lock:
            return self._navigator.find(request)

    def keepalive(self, handle: str) -> None:
        with self._lock:
            self._navigator.keepalive(handle)

    def resume(self, handle: str) -> protocol.InvocationReport:
        with self._lock:
            return self._navigator.resume(handle)

    def stop(self, handle: str) -> protocol.InvocationReport:
        with self._lock:
            return self._navigator.stop(handle)


class ControlLoop:
    """Calls `tick` of a robot ten times a second, on a thread of its own, until it is closed."""

    def __init__(self, tick: Callable[[], None]) -> None:
        self._tick, self._over = tick, threading.Event()
        self._thread = threading.Thread(target=self._run, name="vda5050", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(TICK_S):
            with suppress(HarnessError):  # whoever asks for a report is told; the watch over the vehicle goes on
                self._tick()
