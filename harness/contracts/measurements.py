"""What independent sources measure for the verifier, outside the provider that is judged: read back, swept, heard."""

from msgspec import UNSET, UnsetType

from harness.contracts.ids import Digest, RequestId
from harness.contracts.observations import AnySample, Camera, Trajectory
from harness.contracts.protocol import Receipt, RobotStatus
from harness.contracts.reasons import Explanation
from harness.contracts.spoken_goals import SpokenGoal
from harness.contracts.values import Value


class Measurement(Value):
    """What an independent source is asked: about which requests of a stage, over which mission time.

    `requests` are those of the newest execution, `text` what the harness asked it to send or say, `channel` where it
    was to send that, `receipts` what its provider gave. `executes`: it was asked to do something now, rather than
    looked at again. `names` are the places of the mission's site. `samples` are the robot's own of the last seconds,
    `status` its newest report.
    """

    requests: tuple[RequestId, ...]
    text: str
    from_s: float
    until_s: float
    executes: bool = True
    receipts: tuple[Receipt, ...] = ()
    names: tuple[str, ...] = ()
    samples: tuple[AnySample, ...] = ()
    status: RobotStatus | None = None
    channel: str = ""


class StoredMessage(Value):
    """A message as its channel holds it: the text, and the checksum of each file's bytes as they were read.

    `copies`: how many messages of this key are there, equal in text and files.
    """

    text: str
    images: tuple[Digest, ...]
    copies: int = 1


class ReadBack(Value):
    """What the channel's read path answered about one message. `found`: it is there, whole and readable. `channel`: the
    site's name of it, unset for the data folder's outbox; `copies`: how many of it are there, where they are counted.
    """

    request_id: RequestId
    found: bool
    asked_text: Digest
    text: Digest | None = None
    images: tuple[Digest, ...] = ()
    problem: Explanation = ""
    channel: str | UnsetType = UNSET
    copies: int | UnsetType = UNSET


class LidarLook(Value):
    """Lidar sweeps with the poses and the odometry of the same seconds, and the camera as the robot describes it."""

    trajectory: Trajectory
    camera: Camera | None = None


EXAMINATION = "examination"
"""The value of an image's reference that names its PictureExamination."""


PLAYED_FOR = "played_for"
"""The value of a recognition's reference that names the earlier request whose recording was given out again."""


PLAYED_AT = "played_at"
"""The value of a recognition's reference that says how fast its recording runs, where that is no recording of what was
played."""


LOOK_PX = (64, 36)
"""Areas of a look, across and down."""


class PictureLook(Value):
    """What is compared of one image: the grey mean of each area, and of some blocks the finest that the noise left.

    `noise` has seven waves for each of `blocks` (down, across), the same blocks from either side of the image. Both are
    empty for an image that could not be decoded to its last pixel; `problem` says why.
    """

    image: Digest
    width_px: int = 0
    height_px: int = 0
    grey: bytes = b""
    noise: bytes = b""
    blocks: tuple[int, int] = (0, 0)
    problem: Explanation = ""


class EarlierCapture(Value):
    """An earlier capture that `image` may be a copy of, with what its bytes were first recorded for. `look` is the
    earlier image's; none where its bytes are the same."""

    image: Digest
    request_id: RequestId
    at_s: float
    yaw_rad: float
    look: PictureLook | None = None


class PictureExamination(Value):
    """The harness's own look at the images of an execution, and the earlier captures that resemble them.

    `camera`: as the robot describes it; unset where it does not, and in what earlier releases stored.
    """

    looks: tuple[PictureLook, ...]
    earlier: tuple[EarlierCapture, ...] = ()
    camera: Camera | UnsetType = UNSET


class RequestRecord(Value):
    """The harness's own record of a request: its text's checksum, who gave it, in which role, over which channel.

    `spoken`: the recording and transcript of a request that was spoken.
    """

    text: Digest
    requested_by: str
    role: str
    channel: str
    spoken: SpokenGoal | UnsetType = UNSET


class Sound(Value):
    """A stretch of sound that a loudspeaker plays from `at_s` on: 16-bit little-endian mono samples."""

    at_s: float
    rate_hz: int
    pcm: bytes


class Recognition(Value):
    """What a recogniser understood of a sound, word by word. `asked` is what was to be said, in the same form;
    `unknown` are words that it could not have understood, because its dictionary lacks them.
    """

    sound: Digest
    recogniser: str
    asked: tuple[str, ...]
    heard: tuple[str, ...]
    unknown: tuple[str, ...] = ()
