"""What independent sources measure for the verifier, outside the provider that is judged: read back, swept, heard."""

from harness.contracts.ids import Digest, RequestId
from harness.contracts.observations import AnySample, Camera, Trajectory
from harness.contracts.protocol import RobotStatus
from harness.contracts.values import Value


class Measurement(Value):
    """What an independent source is asked: about which requests of a stage, over which mission time.

    `requests` are those of the newest execution, `asked_text` the checksum of what the harness asked it to send or
    say. `samples` are the robot's own of the last seconds, `status` its newest report.
    """

    requests: tuple[RequestId, ...]
    from_s: float
    until_s: float
    asked_text: Digest
    samples: tuple[AnySample, ...] = ()
    status: RobotStatus | None = None


class StoredMessage(Value):
    """A message as its channel holds it: the text, and the checksum of each file's bytes as they were read."""

    text: str
    images: tuple[Digest, ...]


class ReadBack(Value):
    """What the channel's read path answered about one message. `found`: it is there, whole and readable."""

    request_id: RequestId
    found: bool
    asked_text: Digest
    text: Digest | None = None
    images: tuple[Digest, ...] = ()
    problem: str = ""


class LidarLook(Value):
    """Lidar sweeps with the poses and the odometry of the same seconds, and the camera as the robot describes it."""

    trajectory: Trajectory
    camera: Camera | None = None


class RequestRecord(Value):
    """The harness's own record of a request: its text's checksum, who gave it, in which role, over which channel."""

    text: Digest
    requested_by: str
    role: str
    channel: str
