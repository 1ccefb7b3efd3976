"""Bodies of the HTTP provider protocol that are not contracts: problems, clock readings, simulation commands."""

from harness.contracts import errors
from harness.contracts.ids import MissionId, RequestId
from harness.contracts.reasons import plain
from harness.contracts.values import Value


class Problem(Value):
    """The body of every 4xx and 5xx answer: a code for machines, and what, where and what to do for people."""

    code: str
    what: str
    where: str = ""
    do: str = ""


ATTACHMENT = "robot.json"
"""The file in a robot's own folder that says how to reach the robot, while its program runs."""


class Attachment(Value):
    """How to reach a running robot process: loopback port, bearer token, process id, its speed."""

    port: int
    token: str
    pid: int
    speed: float
    robot_id: str

    @property
    def base_url(self) -> str:
        return f"http://127.0.0.1:{self.port}"


class ClockReading(Value):
    """The robot's mission time. `speed` 0 is lockstep; `monotonic_s` is the serving machine's monotonic clock."""

    at_s: float
    speed: float
    monotonic_s: float


class Advance(Value):
    """Lockstep only: let the world run to this mission time."""

    until_s: float


class MissionSettings(Value):
    """A mission's seed and faults (`NAME` or `NAME:persistent`) for a simulated robot."""

    mission_id: MissionId
    seed: int
    faults: tuple[str, ...] = ()


class DriveSession(Value):
    """Which session of driving by hand is meant."""

    session: RequestId


class HardwareStop(Value):
    """Simulation only: somebody presses the red button on the robot, or releases it."""

    engaged: bool


class Done(Value):
    """An acknowledgement with nothing to add, at this mission time."""

    at_s: float


STATUS: dict[type[errors.HarnessError], int] = {
    errors.HarnessError: 500,
    errors.ProviderFailed: 409,
    errors.FencingRefused: 409,
    errors.ProviderUnreachable: 504,
    errors.UnknownName: 404,
    errors.BlobDamaged: 404,
    errors.StoreUnavailable: 503,
    errors.StoreOwned: 503,
    errors.LogDamaged: 500,
}
_BY_CODE = {kind.code: kind for kind in STATUS}


def problem(error: errors.HarnessError) -> Problem:
    """An error as it travels."""
    return Problem(code=error.code, what=plain(error.what), where=plain(error.where), do=plain(error.do))


def status_of(error: errors.HarnessError) -> int:
    """The HTTP status of an error: that of its nearest kind."""
    return next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)


def error_of(received: Problem) -> errors.HarnessError:
    """The same error on the other side; an unknown code becomes ProviderFailed."""
    kind = _BY_CODE.get(received.code, errors.ProviderFailed)
    return kind(received.what, where=received.where, do=received.do)
