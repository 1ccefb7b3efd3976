"""Holds what is known of one vehicle from its messages: state, connection, clock, and samples with their own times.

A message that comes twice is read once. One that was overtaken changes nothing. One with another vehicle's name, or
from a clock that jumped, is never used. Nothing here sends anything.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from cachetools import LRUCache

from harness.adapters.providers.vda5050 import messages
from harness.contracts import observations as samples
from harness.contracts.errors import ProviderFailed, ProviderUnreachable
from harness.contracts.protocol import Observations
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Point

JUMP_S = 5.0
"""A message whose time is this far from the vehicle's known clock is from a clock that jumped, or was delayed too long
to say anything about now."""
SILENT_S = 35.0
"""The specification wants a state at least every 30 s."""
ASKED_S = 3.0
"""A vehicle that sent nothing this long after it was asked for its state is silent."""
LONGEST_GAP_S = 1.0
"""Between velocities further apart than this, the motion is unknown."""
SAMPLES = 20_000
REMEMBERED = 4096
REST_S, REST_M, REST_MPS, REST_RADPS = 0.5, 0.02, 0.01, 0.02
FRESH_S = 1.5
MAPPED = "vda5050:"
"""Before the id of a map that is not the site's: poses in it are poses in another map."""
KINDS: dict[str, type[messages.VehicleMessage]] = {
    "state": messages.VehicleState,
    "visualization": messages.VisualizationMessage,
    "connection": messages.ConnectionMessage,
    "factsheet": messages.FactsheetMessage,
}


@dataclass(frozen=True)
class VehicleIdentity:
    """Which vehicle, and where its messages are: `interface/vN/manufacturer/serial/TOPIC`."""

    interface: str
    manufacturer: str
    serial_number: str
    version: messages.Version

    def topic(self, name: messages.Topic) -> str:
        return f"{self.interface}/v{self.version[0]}/{self.manufacturer}/{self.serial_number}/{name}"


@dataclass(frozen=True)
class MapIdentity:
    """The site's frame and map version, and the vehicle's own id of that map."""

    frame: str
    map_version: str
    map_id: str


@dataclass(frozen=True)
class PositionFix:
    """A position that the vehicle reported, with its time, its map and the velocity that came with it."""

    at_s: float
    point: Point
    velocity: messages.VehicleVelocity | None
    map_id: str

    def rests_with(self, other: "PositionFix") -> bool:
        """Whether the body stood between the two, as far as position and velocity say."""
        v = self.velocity
        slow = v is None or (math.hypot(v.vx, v.vy) < REST_MPS and abs(v.omega) < REST_RADPS)
        return slow and self.map_id == other.map_id and math.dist(self.point, other.point) < REST_M


@dataclass
class MessageCounts:
    """How many messages were not used, by reason."""

    repeated: int = 0
    overtaken: int = 0
    lost: int = 0
    invalid: int = 0
    of_others: int = 0
    of_jumped_clock: int = 0


@dataclass
class _Odometry:
    """What the velocities add up to: metres and radians in a frame of its own, from zero."""

    at_s: float | None = None
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    v: messages.VehicleVelocity = field(default_factory=messages.VehicleVelocity)

    def add(self, at_s: float, v: messages.VehicleVelocity) -> None:
        if self.at_s is not None and 0.0 < at_s - self.at_s <= LONGEST_GAP_S:
            step_s = at_s - self.at_s
            yaw = self.yaw_rad + (self.v.omega + v.omega) / 2 * step_s / 2
            forward, left = (self.v.vx + v.vx) / 2 * step_s, (self.v.vy + v.vy) / 2 * step_s
            self.x_m += forward * math.cos(yaw) - left * math.sin(yaw)
            self.y_m += forward * math.sin(yaw) + left * math.cos(yaw)
            self.yaw_rad = math.remainder(self.yaw_rad + (self.v.omega + v.omega) / 2 * step_s, math.tau)
        self.at_s, self.v = at_s, v


class Vehicle:
    """Folds the messages of one vehicle. `local_s` is a clock of this machine that only goes on.

    `velocity_measured`: the vehicle measures its velocity apart from its position; only then it is odometry.
    `first_seq`: samples are numbered from there, above those of an earlier connection.
    """

    def __init__(
        self,
        identity: VehicleIdentity,
        site: MapIdentity,
        *,
        velocity_measured: bool,
        local_s: Callable[[], float],
        first_seq: int = 0,
    ) -> None:
        self.identity, self.site = identity, site
        self.state: messages.VehicleState | None = None
        self.factsheet: messages.FactsheetMessage | None = None
        self.counts = MessageCounts()
        self.boots = 0
        """How often the vehicle began to count its states anew."""
        self.state_local_s = 0.0
        self._online: bool | None = None
        self._connection = ""
        self._measured, self._local_s, self._seq = velocity_measured, local_s, first_seq
        self._seen: LRUCache[tuple[str, int, str], bool] = LRUCache(REMEMBERED)
        self._newest: dict[str, messages.VehicleMessage] = {}
        self._heard_s: float | None = None
        self._ahead_s: deque[float] = deque(maxlen=100)
        self._latest_s = 0.0
        self._jumped_s: float | None = None
        self._anew = False
        self._impostor = ""
        self._asked_s: float | None = None
        self._samples: deque[samples.AnySample] = deque(maxlen=SAMPLES)
        self._odometry = _Odometry()
        self._track: deque[PositionFix] = deque(maxlen=200)
        self._charged_s = 0.0

    @property
    def now_s(self) -> float:
        """The vehicle's clock now, from the least delayed of its newest messages, never backwards; 0 before the
        first."""
        if self._ahead_s:
            self._latest_s = max(self._latest_s, self._local_s() + max(self._ahead_s))
        return self._latest_s

    @property
    def known(self) -> bool:
        """Whether a state came that can be used."""
        return self.state is not None

    @property
    def newest(self) -> "PositionFix | None":
        """The newest position, if it is one in the site's map."""
        fix = self._track[-1] if self._track else None
        return fix if fix is not None and fix.map_id == self.site.map_id else None

    def receive(self, name: messages.Topic, body: bytes) -> None:
        """Take a message, or count why it is not used. Never raises for what a vehicle may send."""
        try:
            message = messages.read_message(body, KINDS[name])
            at_s = message.at_s
        except ProviderFailed:
            self.counts.invalid += 1
            return
        named = (message.manufacturer, message.serial_number)
        if named != (self.identity.manufacturer, self.identity.serial_number):
            self.counts.of_others += 1
            self._impostor = "/".join(named)[:80]
            return
        if isinstance(message, messages.ConnectionMessage):
            self._connection, self._online = message.connection_state[:40], message.online
            return
        if isinstance(message, messages.FactsheetMessage):
            self.factsheet = message
            return
        if self._usable(name, message, at_s):
            self._take(name, message, at_s)

    def note_request(self) -> None:
        """Note that the vehicle was asked for its state."""
        if self._asked_s is None:
            self._asked_s = self._local_s()

    def lost_connection(self) -> None:
        """The connection to the broker broke: nothing that was known of the link is known now."""
        self._online = None

    @property
    def age_s(self) -> float:
        """How long ago the newest usable message came, seconds of this machine; infinite where none did."""
        return math.inf if self._heard_s is None else self._local_s() - self._heard_s

    def trouble(self) -> Reason | None:
        """Why nothing can be said of the vehicle now; None where its state is of now."""
        name = f"{self.identity.manufacturer}/{self.identity.serial_number}"
        if self._online is False:
            return because("vehicle_offline", vehicle=name, connection=self._connection)
        if self._jumped_s is not None:
            return because("vehicle_clock_jumped", vehicle=name, jumped_s=self._jumped_s)
        asked_s = self._local_s() - self._asked_s if self._asked_s is not None else 0.0
        if self.state is None or asked_s > ASKED_S or self.age_s > SILENT_S:
            if self._impostor:
                return because("another_vehicle_answers", found=self._impostor, expected=name)
            return because("vehicle_silent", vehicle=name)
        return None

    def current(self) -> messages.VehicleState:
        """The newest state. Raises ProviderUnreachable where it is not of now."""
        trouble = self.trouble()
        if trouble is not None or self.state is None:
            raise ProviderUnreachable(trouble or because("vehicle_silent", vehicle=self.identity.serial_number))
        return self.state

    def at_rest(self, since_s: float) -> bool:
        """Whether every message of the last REST_S, all later than `since_s`, shows the body where it was, slower
        than REST_MPS and not driving. The vehicle's clock."""
        now_s = self.now_s
        state = self.state
        if state is None or state.driving or not self._track or now_s - self._track[-1].at_s > FRESH_S:
            return False
        newest = self._track[-1]
        window = [one for one in self._track if one.at_s >= since_s]
        before = next((i for i in range(len(window) - 1, -1, -1) if window[i].at_s <= newest.at_s - REST_S), None)
        return before is not None and all(one.rests_with(newest) for one in window[before:])

    def observations(self, after: int, limit: int) -> Observations:
        found = tuple(one for one in self._samples if one.seq > after)[:limit]
        return Observations(samples=found, next_seq=found[-1].seq if found else after, at_s=self.now_s)

    def localised(self) -> bool:
        """Whether the vehicle says that it knows where it is, in the site's map."""
        position = self.state.position if self.state else None
        return position is not None and position.trusted and position.map_id == self.site.map_id

    def _usable(self, name: str, message: messages.VehicleMessage, at_s: float) -> bool:
        """Whether a message says something new of now; what does not is counted."""
        key = (name, message.header_id, message.timestamp)
        if key in self._seen:
            self.counts.repeated += 1
            return False
        self._seen[key] = True
        newest = self._newest.get(name)
        anew = name == "state" and newest is not None and message.header_id < newest.header_id
        if self._ahead_s and abs(at_s - self.now_s) > JUMP_S:
            self.counts.of_jumped_clock += 1
            self._jumped_s = at_s - self.now_s
            self._anew = self._anew or anew
            return False
        if newest is not None and at_s < newest.at_s:
            self.counts.overtaken += 1
            return False
        if newest is not None and message.header_id > newest.header_id + 1:
            self.counts.lost += message.header_id - newest.header_id - 1
        if name == "state" and (anew or self._anew):
            self.boots, self._anew = self.boots + 1, False
        self._newest[name] = message
        return True

    def _take(self, name: str, message: messages.VehicleMessage, at_s: float) -> None:
        local_s = self._local_s()
        self._ahead_s.append(at_s - local_s)
        self._heard_s, self._jumped_s, self._asked_s, self._impostor = local_s, None, None, ""
        if isinstance(message, messages.VehicleState):
            self.state, self.state_local_s = message, local_s
            self._online = True  # a state of now outlives a last will that overtook it
            if message.charge is not None and at_s - self._charged_s >= 1.0:
                self._charged_s = at_s
                self._keep(samples.Battery(seq=self._next(), at_s=at_s, source="battery", charge=message.charge))
        if isinstance(message, messages.VehicleState | messages.VisualizationMessage):
            self._sense(message.position, message.velocity, at_s)

    def _sense(
        self, position: messages.VehiclePosition | None, velocity: messages.VehicleVelocity | None, at_s: float
    ) -> None:
        """One pose, and one step of odometry where the velocity is a measurement of its own."""
        if self._track and at_s <= self._track[-1].at_s:
            return
        if position is not None and position.trusted and math.isfinite(position.x + position.y + position.theta):
            ours = position.map_id == self.site.map_id
            self._keep(
                samples.Pose(
                    seq=self._next(),
                    at_s=at_s,
                    source="localiser",
                    frame=self.site.frame,
                    map_version=self.site.map_version if ours else f"{MAPPED}{position.map_id}"[:80],
                    x_m=position.x,
                    y_m=position.y,
                    yaw_rad=math.remainder(position.theta, math.tau),
                    confidence=min(1.0, max(0.0, position.localization_score))
                    if position.localization_score is not None
                    else 1.0,
                )
            )
            self._track.append(PositionFix(at_s, (position.x, position.y), velocity, position.map_id))
        if velocity is not None and self._measured and math.isfinite(velocity.vx + velocity.vy + velocity.omega):
            self._odometry.add(at_s, velocity)
            self._keep(
                samples.Odometry(
                    seq=self._next(),
                    at_s=at_s,
                    source="odometry",
                    frame="odom",
                    x_m=self._odometry.x_m,
                    y_m=self._odometry.y_m,
                    yaw_rad=self._odometry.yaw_rad,
                    v_mps=math.hypot(velocity.vx, velocity.vy),
                    w_radps=velocity.omega,
                )
            )

    def _keep(self, sample: samples.AnySample) -> None:
        self._samples.append(sample)

    def _next(self) -> int:
        self._seq += 1
        return self._seq
