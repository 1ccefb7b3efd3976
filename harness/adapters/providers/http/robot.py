"""Client for a robot behind the HTTP provider protocol: implements `contracts.ports.Robot`."""

from collections.abc import Sequence
from typing import TypeVar

import httpx
import msgspec

from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.ids import Digest, MissionId, RequestId
from harness.contracts.measurements import Sound
from harness.contracts.values import Value, decode, encode
from harness.provider_protocol import wire

T = TypeVar("T")
DEFAULT_TIMEOUT_S = 10.0
MOST_BYTES = 64 << 20
"""No answer of a robot is longer; a hundred megabytes fill no memory and no log."""


class HttpRobot:
    """Raises ProviderUnreachable when no answer came, and the robot's own typed errors when one did.

    Nothing that could start or change something is ever sent twice by this client; reads are repeated once.
    """

    def __init__(self, base_url: str, token: str, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        self._timeout_s = timeout_s
        self._client = self._connected(base_url, token)
        self._providers: tuple[HttpProvider, ...] = ()

    def reconnect(self, base_url: str, token: str) -> None:
        """Go on with another process of the same robot: its address and token changed, its providers did not."""
        self._client.close()
        self._client = self._connected(base_url, token)

    def _connected(self, base_url: str, token: str) -> httpx.Client:
        headers = {"Authorization": f"Bearer {token}"}
        return httpx.Client(base_url=base_url, timeout=self._timeout_s, headers=headers, trust_env=False)

    def providers(self) -> Sequence["HttpProvider"]:
        """The robot's providers; their cards are read once."""
        if not self._providers:
            cards = self.read("/providers", list[CapabilityCard])
            self._providers = tuple(HttpProvider(self, card) for card in cards)
        return self._providers

    def status(self) -> protocol.RobotStatus:
        return self.read("/robot", protocol.RobotStatus)

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        return self.read(f"/observations?after={after}&limit={limit}", protocol.Observations)

    def blob(self, digest: Digest) -> bytes:
        """Raises BlobDamaged if the robot no longer holds it."""
        return self._get(f"/blobs/{digest}")

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return self.read("/starts", list[protocol.PhysicalStart])

    def picture(self) -> protocol.Picture:
        """What the camera sees now. Raises ProviderFailed for a robot that serves no camera."""
        return self.read("/camera", protocol.Picture)

    def drive(self, order: protocol.DriveOrder) -> protocol.DriveReport:
        return self.write("/hand/drive", protocol.DriveReport, order)

    def release(self, session: RequestId) -> protocol.DriveReport:
        return self.write("/hand/release", protocol.DriveReport, wire.DriveSession(session=session))

    def rest(self, order: protocol.PostureOrder) -> protocol.RobotStatus:
        return self.write("/hand/posture", protocol.RobotStatus, order)

    def play(self, sound: Sound) -> None:
        """Simulation only: a loudspeaker plays in the robot's room."""
        self.write("/simulation/room/sound", wire.Done, sound)

    def recording(self, from_s: float, until_s: float) -> bytes:
        """Simulation only: what the microphone of the robot's room heard, as a WAV."""
        return self._get(f"/simulation/room/recording?from_s={from_s!r}&until_s={until_s!r}")

    def clock(self) -> wire.ClockReading:
        """The robot's mission time now."""
        return self.read("/clock", wire.ClockReading)

    def advance(self, until_s: float) -> float:
        """Lockstep only: run the world to this mission time; returns the time reached."""
        return self.write("/simulation/advance", wire.Done, wire.Advance(until_s=until_s)).at_s

    def configure(self, mission_id: MissionId, seed: int, faults: Sequence[str] = ()) -> None:
        """Simulation only: begin a mission with this seed and these faults. Raises UnknownName for a fault."""
        settings = wire.MissionSettings(mission_id=mission_id, seed=seed, faults=tuple(faults))
        self.write("/simulation/configure", wire.Done, settings)

    def save(self) -> None:
        """Simulation only: write the world durably."""
        self.write("/simulation/save", wire.Done)

    def press_hardware_stop(self, *, engaged: bool) -> None:
        """Simulation only: the red button on the robot."""
        self.write("/simulation/hardware-stop", wire.Done, wire.HardwareStop(engaged=engaged))

    def struck(self) -> dict[str, int]:
        """Simulation only: how often each fault of the mission occurred."""
        return self.read("/simulation/struck", dict[str, int])

    def close(self) -> None:
        self._client.close()

    def read(self, path: str, kind: type[T]) -> T:
        """GET and decode."""
        return _decoded(self._get(path), kind, path)

    def write(self, path: str, kind: type[T], body: Value | None = None) -> T:
        """POST once and decode."""
        return _decoded(self._send("POST", path, b"" if body is None else encode(body)), kind, path)

    def _get(self, path: str) -> bytes:
        try:
            return self._send("GET", path)
        except ProviderUnreachable:
            return self._send("GET", path)

    def _send(self, method: str, path: str, content: bytes = b"") -> bytes:
        try:
            with self._client.stream(method, path, content=content) as response:
                body = _limited(response, path)
        except httpx.HTTPError as error:
            raise ProviderUnreachable(
                f"The robot did not answer {method} {path.partition('?')[0]} ({type(error).__name__})",
                where=str(self._client.base_url),
                do="see whether the robot is running; the request may or may not have arrived",
            ) from error
        if response.is_success:
            return body
        raise wire.error_of(_problem(response.status_code, body, path))


class HttpProvider:
    """One provider of that robot."""

    def __init__(self, robot: HttpRobot, card: CapabilityCard) -> None:
        self._robot, self._card = robot, card

    @property
    def card(self) -> CapabilityCard:
        return self._card

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        return self._robot.write(f"/providers/{self._card.provider_id}/invocations", protocol.InvocationReport, request)

    def report(self, handle: str) -> protocol.InvocationReport:
        return self._robot.read(f"/invocations/{handle}", protocol.InvocationReport)

    def find(self, request: RequestId) -> protocol.InvocationReport | None:
        try:
            return self._robot.read(f"/requests/{request}", protocol.InvocationReport)
        except UnknownName:
            return None

    def keepalive(self, handle: str) -> None:
        self._robot.write(f"/invocations/{handle}/keepalive", dict[str, str])

    def resume(self, handle: str) -> protocol.InvocationReport:
        return self._robot.write(f"/invocations/{handle}/resume", protocol.InvocationReport)

    def stop(self, handle: str) -> protocol.InvocationReport:
        return self._robot.write(f"/invocations/{handle}/stop", protocol.InvocationReport)


def _decoded(body: bytes, kind: type[T], path: str) -> T:
    try:
        return decode(body, kind)
    except msgspec.MsgspecError as error:
        raise ProviderFailed(
            f"The robot's answer breaks the protocol ({error})", where=path, do="run the conformance kit against it"
        ) from error


def _limited(response: httpx.Response, path: str) -> bytes:
    """The answer's body; raises ProviderFailed once it is longer than any answer of a robot, and reads no further."""
    body = bytearray()
    for part in response.iter_bytes():
        body += part
        if len(body) > MOST_BYTES:
            raise ProviderFailed(
                f"The robot's answer is larger than {MOST_BYTES >> 20} MiB",
                where=path,
                do="see what the robot sends; samples are asked for in batches, pictures one by one",
            )
    return bytes(body)


def _problem(status: int, body: bytes, path: str) -> wire.Problem:
    try:
        return decode(body, wire.Problem)
    except msgspec.MsgspecError:
        return wire.Problem(code="provider_failed", what=f"The robot answered {status}", where=path)
