"""Bodies of the HTTP provider protocol that are not contracts: problems, clock readings, simulation commands."""

from collections.abc import Mapping

from harness.contracts import errors
from harness.contracts.ids import MissionId, RequestId
from harness.contracts.reasons import Explanation, Fact, Reason, plain
from harness.contracts.values import MissionTime, NonNegative, Value

ROBOT_REASONS: Mapping[str, frozenset[str]] = {
    "acknowledgement_lost": frozenset(),
    "base_held": frozenset({"handle"}),
    "body_moves": frozenset(),
    "controller_interrupted": frozenset(),
    "deadline_passed": frozenset(),
    "drive_session_over": frozenset({"session"}),
    "fencing_token_missing": frozenset({"resource"}),
    "fencing_token_old": frozenset({"token", "resource", "newest"}),
    "goal_reached_within": frozenset({"distance_m"}),
    "handle_unknown": frozenset({"handle"}),
    "hardware_stop_engaged": frozenset(),
    "journal_line_unreadable": frozenset({"error"}),
    "journal_unusable": frozenset({"error"}),
    "keepalive_missed": frozenset(),
    "no_gap_wide_enough": frozenset(),
    "no_progress": frozenset({"progress_m", "within_s"}),
    "no_progress_since": frozenset({"progress_m", "within_s", "reason"}),
    "no_way_to_route": frozenset(),
    "nothing_received": frozenset(),
    "observed_for": frozenset({"looked_s"}),
    "on_way_to_route": frozenset({"reason"}),
    "parameter_of_another_type": frozenset({"name", "type"}),
    "parameter_required": frozenset({"name"}),
    "parameter_too_large": frozenset({"name", "value", "bound", "unit"}),
    "parameter_too_small": frozenset({"name", "value", "bound", "unit"}),
    "parameter_undeclared": frozenset({"name"}),
    "provider_not_here": frozenset({"provider_id"}),
    "providers_not_here": frozenset(),
    "request_body_invalid": frozenset({"error"}),
    "request_body_too_large": frozenset({"limit"}),
    "request_changed": frozenset({"request_id"}),
    "request_misdirected": frozenset({"named", "own"}),
    "request_never_came": frozenset({"request_id"}),
    "robot_blob_not_held": frozenset({"blob"}),
    "robot_ending": frozenset(),
    "robot_fallen": frozenset(),
    "robot_folder_in_use": frozenset(),
    "robot_folder_unusable": frozenset({"error"}),
    "robot_lies": frozenset(),
    "robot_port_unusable": frozenset({"port", "error"}),
    "robot_restarted_under_way": frozenset(),
    "robot_token_wrong": frozenset(),
    "route_closed_ahead": frozenset(),
    "route_unusable": frozenset({"points", "frame", "expected"}),
    "runs_by_itself": frozenset(),
    "spool_forked": frozenset({"seq"}),
    "start_journal_unreadable": frozenset({"error"}),
    "start_journal_unwritable": frozenset({"error"}),
    "step_out_of_bounds": frozenset({"step_s", "limit_s"}),
    "stopped_on_request": frozenset(),
    "turn_not_completed": frozenset(),
    "turn_photographed": frozenset({"frames"}),
    "under_way": frozenset(),
    "unknown_fault": frozenset({"name", "known"}),
    "walking_not_installed": frozenset({"missing"}),
    "world_unreadable": frozenset({"error"}),
}
"""The reasons that a robot may give by code, each with its facts: of any other its text counts."""
FIGURES = frozenset(
    {
        "bound", "distance_m", "frames", "limit", "limit_s", "looked_s", "newest", "points", "port", "progress_m",
        "seq", "step_s", "token", "value", "within_s",
    }
)  # fmt: skip
"""Facts that are numbers; the others are text, but for `reason`, which is a reason that a robot may give."""
LONGEST_FACT = 2000


class Problem(Value):
    """The body of every 4xx and 5xx answer: a code for machines, and what, where and what to do for people.

    `reason` is what happened as a code with facts, where the robot's program has one: it is shown in the reader's
    language, and `what` is not.
    """

    code: str
    what: str
    where: str = ""
    do: str = ""
    reason: Reason | None = None


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

    at_s: MissionTime
    speed: NonNegative
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
    reason = error.what if isinstance(error.what, Reason) else None
    return Problem(code=error.code, what=plain(error.what), where=plain(error.where), do=plain(error.do), reason=reason)


def status_of(error: errors.HarnessError) -> int:
    """The HTTP status of an error: that of its nearest kind."""
    return next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)


def error_of(received: Problem) -> errors.HarnessError:
    """The same error on the other side; an unknown code becomes ProviderFailed."""
    kind = _BY_CODE.get(received.code, errors.ProviderFailed)
    if received.reason is not None and _known(received.reason):
        return kind(received.reason, where=received.where)
    return kind(received.what, where=received.where, do=received.do)


def trusted(explanation: Explanation) -> Explanation:
    """What a robot's answer explains, as it may be shown: a reason that nobody knows is text."""
    return explanation if isinstance(explanation, str) or _known(explanation) else plain(explanation)


def _known(reason: Reason) -> bool:
    """Whether a robot may give this reason: its code with exactly its facts, each of its type."""
    fits = (_fits(name, value) for name, value in reason.facts.items())
    return ROBOT_REASONS.get(reason.code) == reason.facts.keys() and all(fits)


def _fits(name: str, value: Fact) -> bool:
    if isinstance(value, Reason):
        return name == "reason" and _known(value)
    if name in FIGURES:
        return isinstance(value, int | float)
    return name != "reason" and isinstance(value, str) and len(value) <= LONGEST_FACT
