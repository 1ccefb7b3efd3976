"""Client for a robot behind the HTTP provider protocol: implements `contracts.ports.Robot`."""

from collections.abc import Sequence
from typing import TypeVar
from urllib.parse import quote

import msgspec
from msgspec.structs import replace

from harness.adapters.providers.http.exchange import BLOB_BYTES, Exchanges, Reply, nested_too_deep
from harness.adapters.providers.http.plausible import check_batch, check_report, check_stack_goals
from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import BlobDamaged, HarnessError, ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.ids import Digest, MissionId, RequestId, sha256
from harness.contracts.measurements import Sound
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode
from harness.provider_protocol import wire

T = TypeVar("T")
DEFAULT_TIMEOUT_S = 10.0
MOST_CARDS = 256
MOST_SAID = 2000
"""How many characters of a robot's refusal are kept."""


class HttpRobot:
    """Raises ProviderUnreachable where nobody knows what became of a request, ProviderFailed for an answer that cannot
    be used, and the robot's own typed errors.

    A request that could start or change something counts as refused only by a 4xx answer with a problem of the
    protocol: a gateway's page, a redirect, a 5xx and an answer that cannot be read say nothing about what became of it.
    Nothing of the kind is ever sent twice by this client; reads are repeated once. `timeout_s` bounds the wall time of
    each exchange as a whole.
    """

    def __init__(self, base_url: str, token: str, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        self._timeout_s = timeout_s
        self._exchanges = Exchanges(base_url, token, timeout_s)
        self._providers: tuple[HttpProvider, ...] = ()

    def reconnect(self, base_url: str, token: str) -> None:
        """Go on with another process of the same robot: its address and token changed, its providers did not."""
        self._exchanges.close()
        self._exchanges = Exchanges(base_url, token, self._timeout_s)

    def providers(self) -> Sequence["HttpProvider"]:
        """The robot's providers; their cards are read once."""
        if not self._providers:
            self._providers = tuple(HttpProvider(self, card) for card in self.cards())
        return self._providers

    def cards(self) -> Sequence[CapabilityCard]:
        """The cards as the robot has them now."""
        cards = self.read("/providers", list[CapabilityCard])
        if len(cards) > MOST_CARDS:
            raise ProviderFailed(because("too_many_of", what="providers", limit=MOST_CARDS), where="/providers")
        return cards

    def status(self) -> protocol.RobotStatus:
        return self.read("/robot", protocol.RobotStatus)

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        """Raises ProviderFailed for a batch that is longer than asked for, or whose figures no sensor can have."""
        batch = self.read(f"/observations?after={after}&limit={limit}", protocol.Observations)
        check_batch(batch, limit=limit)
        return batch

    def blob(self, digest: Digest) -> bytes:
        """Raises BlobDamaged if the robot no longer holds it, or gives out other bytes under its digest."""
        body = self._bytes(f"/blobs/{digest}")
        if sha256(body) != digest:
            raise BlobDamaged(because("robot_blob_differs", blob=digest[:12]), where=f"/blobs/{digest[:12]}")
        return body

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return self.read("/starts", list[protocol.PhysicalStart])

    def stack_goals(self, after: int, limit: int = protocol.MOST_CHANGES) -> protocol.StackGoals:
        """What the robot's own stack was given to do since that change, and how it says that ended. Raises
        ProviderFailed for a robot that does not tell, and for changes that cannot be."""
        found = self.read(f"/stack/goals?after={after}&limit={limit}", protocol.StackGoals)
        return check_stack_goals(found, limit=limit)

    def picture(self) -> protocol.Picture:
        """What the camera sees now. Raises ProviderFailed for a robot that serves no camera."""
        return self.read("/camera", protocol.Picture)

    def drive(self, order: protocol.DriveOrder) -> protocol.DriveReport:
        report = self.write("/hand/drive", protocol.DriveReport, order)
        return replace(report, reason=wire.trusted(report.reason))

    def release(self, session: RequestId) -> protocol.DriveReport:
        return self.write("/hand/release", protocol.DriveReport, wire.DriveSession(session=session))

    def rest(self, order: protocol.PostureOrder) -> protocol.RobotStatus:
        return self.write("/hand/posture", protocol.RobotStatus, order)

    def play(self, sound: Sound) -> None:
        """Simulation only: a loudspeaker plays in the robot's room."""
        self.write("/simulation/room/sound", wire.Done, sound)

    def recording(self, from_s: float, until_s: float) -> bytes:
        """Simulation only: what the microphone of the robot's room heard, as a WAV."""
        return self._bytes(f"/simulation/room/recording?from_s={from_s!r}&until_s={until_s!r}")

    def clock(self) -> wire.ClockReading:
        """The robot's mission time now."""
        return self.read("/clock", wire.ClockReading)

    def advance(self, until_s: float) -> float:
        """Lockstep only: run the world to this mission time; returns the time reached."""
        return self.write("/simulation/advance", wire.Done, wire.Advance(until_s=until_s)).at_s

    def configure(self, mission_id: MissionId, seed: int, faults: Sequence[str] = ()) -> None:
        """Simulation only: begin a mission with this seed and these faults. Raises UnknownName for a fault."""
        settings = wire.MissionSettings(mission_id=mission_id, seed=seed, faults=tuple(faults))
        self.write("/simulation/configure", wire.Done, settings, own=(UnknownName,))

    def save(self) -> None:
        """Simulation only: write the world durably."""
        self.write("/simulation/save", wire.Done)

    def press_hardware_stop(self, *, engaged: bool) -> None:
        """Simulation only: the red button on the robot."""
        self.write("/simulation/hardware-stop", wire.Done, wire.HardwareStop(engaged=engaged))

    def clear_way(self) -> None:
        """Simulation only: somebody takes away what stands in the robot's way."""
        self.write("/simulation/clear-way", wire.Done)

    def struck(self) -> dict[str, int]:
        """Simulation only: how often each fault of the mission occurred."""
        return self.read("/simulation/struck", dict[str, int])

    def close(self) -> None:
        self._exchanges.close()

    def read(self, path: str, kind: type[T], *, own: tuple[type[HarnessError], ...] = ()) -> T:
        """GET and decode. `own` are kinds of errors beside ProviderFailed that the robot may answer here."""
        return _decoded(_accepted(self._exchanges.read(path), path, own), kind, path)

    def write(
        self, path: str, kind: type[T], body: Value | None = None, *, own: tuple[type[HarnessError], ...] = ()
    ) -> T:
        """POST once and decode. Raises ProviderUnreachable for anything but a result or a refusal: it is not known
        then what became of the request."""
        content = b"" if body is None else encode(body)
        try:
            reply = self._exchanges.ask("POST", path, content)
        except ProviderUnreachable:
            raise
        except ProviderFailed as error:
            raise _unknown(path, error) from error
        refusal = _refusal(reply)
        if refusal is not None:
            raise _error_of(refusal, own)
        try:
            return _decoded(_accepted(reply, path, own), kind, path)
        except ProviderFailed as error:
            raise _unknown(path, error) from error

    def _bytes(self, path: str) -> bytes:
        return _accepted(self._exchanges.read(path, most_bytes=BLOB_BYTES), path, (BlobDamaged,)).body


class HttpProvider:
    """One provider of that robot."""

    def __init__(self, robot: HttpRobot, card: CapabilityCard) -> None:
        self._robot, self._card = robot, card

    @property
    def card(self) -> CapabilityCard:
        return self._card

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        path = f"/providers/{self._card.provider_id}/invocations"
        report = self._robot.write(path, protocol.InvocationReport, request)
        try:
            return check_report(report)
        except ProviderFailed as error:
            raise _unknown(path, error) from error

    def report(self, handle: str) -> protocol.InvocationReport:
        return check_report(self._robot.read(f"/invocations/{_segment(handle)}", protocol.InvocationReport))

    def find(self, request: RequestId) -> protocol.InvocationReport | None:
        """None only where the robot says itself that the request never came: a 404 with a problem of the protocol."""
        try:
            found = self._robot.read(f"/requests/{request}", protocol.InvocationReport, own=(UnknownName,))
        except UnknownName:
            return None
        return check_report(found)

    def keepalive(self, handle: str) -> None:
        self._robot.write(f"/invocations/{_segment(handle)}/keepalive", dict[str, str])

    def resume(self, handle: str) -> protocol.InvocationReport:
        return self._robot.write(f"/invocations/{_segment(handle)}/resume", protocol.InvocationReport)

    def stop(self, handle: str) -> protocol.InvocationReport:
        return self._robot.write(f"/invocations/{_segment(handle)}/stop", protocol.InvocationReport)


def _segment(handle: str) -> str:
    """A robot's handle as one segment of a path: it names nothing else on its address."""
    return quote(handle, safe=":-._~")


def _decoded(reply: Reply, kind: type[T], path: str) -> T:
    where = path.partition("?")[0]
    if not reply.is_json:
        raise ProviderFailed(because("answer_not_json", content_type=reply.kind[:100] or "-"), where=where)
    if nested_too_deep(reply.body):
        raise ProviderFailed(because("answer_nested_too_deep"), where=where)
    try:
        return decode(reply.body, kind)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise ProviderFailed(because("answer_breaks_protocol", error=str(error)[:300]), where=where) from error


def _accepted(reply: Reply, path: str, own: tuple[type[HarnessError], ...]) -> Reply:
    """The reply if it is a success; raises the robot's own error, or ProviderFailed."""
    if 200 <= reply.status < 300:
        return reply
    refusal = _refusal(reply)
    if refusal is not None:
        raise _error_of(refusal, own)
    raise ProviderFailed(because("robot_answered_status", status=reply.status), where=path.partition("?")[0])


def _refusal(reply: Reply) -> wire.Problem | None:
    """What a 4xx answer says in the protocol's own words; None for any other answer."""
    if not 400 <= reply.status < 500 or not reply.is_json or nested_too_deep(reply.body):
        return None
    try:
        problem = decode(reply.body, wire.Problem)
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return None
    if problem.code == ProviderUnreachable.code:
        return None
    return replace(problem, what=problem.what[:MOST_SAID], where=problem.where[:MOST_SAID], do=problem.do[:MOST_SAID])


def _error_of(problem: wire.Problem, own: tuple[type[HarnessError], ...]) -> HarnessError:
    """A robot's refusal as an error. Of the harness's own troubles, its log and its store, a robot cannot speak."""
    error = wire.error_of(problem)
    if isinstance(error, (ProviderFailed, *own)):
        return error
    return ProviderFailed(error.what, where=error.where, do=error.do)


def _unknown(path: str, error: ProviderFailed) -> ProviderUnreachable:
    return ProviderUnreachable(
        because("outcome_not_known", reason=error.reason), where=error.where or path.partition("?")[0]
    )
