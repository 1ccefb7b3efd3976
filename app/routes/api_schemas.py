"""The structs that the API answers with about robots, people, alerts, files and the log; they are its description."""

from typing import Any

import msgspec

from app.views.fleet import OperatingMode
from harness.contracts.control import Autonomy
from harness.contracts.ids import HandoffId, MissionId
from harness.contracts.protocol import RobotStatus
from harness.contracts.reasons import Reason
from harness.contracts.values import Count, Value


class ChangedSince(Value):
    """One field that is no longer as it was shown."""

    name: str
    was: str
    now: str


class ProblemDocument(Value):
    """RFC 9457. `code` is the slug for machines, `do` what can be done now; `changes` since what was answered.

    `reason` is code and facts of what `detail` says; a refusal also has its `rule`.
    """

    type: str
    title: str
    status: Count
    detail: str
    code: str
    do: str
    changes: tuple[ChangedSince, ...] = ()
    rule: str = ""
    reason: Reason | None = None


class UploadResource(Value):
    """A file that comes in pieces of at most `piece_bytes`; the next one goes to `received_bytes`."""

    upload_id: str
    name: str
    kind: str
    size_bytes: int
    received_bytes: int
    piece_bytes: int


class ReplayResource(Value):
    """A replay: `state` is waiting, reading, running, ended, refused or cancelled; `status` is its mission's end."""

    replay_id: str
    upload_id: str
    name: str
    state: str
    mission_id: str
    status: str
    problem: str
    problem_code: str


class LogEvent(msgspec.Struct, frozen=True, kw_only=True):
    """One event with its place in the hash chain."""

    position: Count
    version: Count
    kind: str
    mission_s: float
    recorded_s: float
    previous: str
    digest: str
    event: dict[str, Any]


class TrailEntry(Value):
    """One line of the access log, which has its own hash chain."""

    number: Count
    at_s: float
    kind: str
    actor: str
    role: str
    subject: str
    detail: str
    source: str
    previous: str
    digest: str


class Caller(Value):
    """Who a caller is."""

    name: str
    roles: tuple[str, ...]
    scopes: tuple[str, ...]
    robot_id: str | None
    may: tuple[str, ...]


class AccountResource(Value):
    """One person."""

    name: str
    roles: tuple[str, ...]
    disabled: bool
    created_at_s: float
    changed_at_s: float


class TokenResource(Value):
    """One token, without its secret."""

    token_id: str
    name: str
    scopes: tuple[str, ...]
    robot_id: str
    created_by: str
    created_at_s: float
    expires_at_s: float | None
    used_at_s: float | None
    revoked_at_s: float | None


class IssuedToken(TokenResource):
    """A new token: `token` is shown this once."""

    token: str


class RobotResource(Value):
    """One robot: the process that drives it, its last report with its age, its mission, and who is in control."""

    robot_id: str
    worker: str
    mode: OperatingMode
    status: RobotStatus | None
    link_age_s: float | None
    trouble: str
    mission_id: MissionId | None
    mission_status: str | None
    handoff_id: HandoffId | None
    autonomy: Autonomy | None
    queued: Count
    driver: str | None
    watchers: tuple[str, ...]


class FleetResource(Value):
    """One robot of the site, whichever process drives it: where it says it is, and how it is reached.

    `here`: the process that answers drives it. `link` is good, old or lost.
    """

    robot_id: str
    worker: str
    here: bool
    mode: OperatingMode
    charge: float | None
    link: str
    link_age_s: float | None
    trouble: str
    mission_id: MissionId | None
    mission_status: str | None
    handoff_id: HandoffId | None
    queued: Count
    x_m: float | None
    y_m: float | None
    pose_old: bool


class SiteControlResource(Value):
    """The limit of autonomy that holds for every mission."""

    autonomy: Autonomy
    limited_by: str | None
    reason: str


class StopsAsked(Value):
    """Missions that were asked to stop; `refused` says why others were not."""

    asked: tuple[str, ...]
    refused: tuple[str, ...]


class WheelSession(Value):
    """Who drives a robot by hand."""

    robot_id: str
    session: str
    driver: str
    device: str


class AlertSummary(Value):
    """One alert: everything with one cause. Times are wall seconds."""

    alert_id: str
    title: str
    text: str
    kind: str
    state: str
    priority: str
    count: Count
    total: Count
    first_s: float
    last_s: float
    assignee: str
    put_away: str
    shelved_until_s: float | None
    link: str


class AlertLine(Value):
    """One line of an alert's history."""

    at_s: float
    text: str
    position: Count


class AlertResource(AlertSummary):
    """One alert with what lasts and its history, newest first."""

    conditions: tuple[str, ...]
    history: tuple[AlertLine, ...]


class SignInLink(Value):
    """A link that signs one person in once."""

    url: str
