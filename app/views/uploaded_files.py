"""Values of files that people upload, and of the replays that they ask for."""

from typing import Literal

from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Point, Value

CHUNK_BYTES = 768 * 1024
"""What one piece may hold: a request's body is one mebibyte at most."""
CLOUDS = (".pcd", ".ply", ".las", ".laz")
BUNDLES = (".zip",)
"""Several files as one: a rosbag2 folder, or a floor map with its image. Its kind is known once it is whole."""
FLOORS, FLOOR_IMAGES = (".yaml", ".yml"), (".pgm", ".png")
BAG_METADATA = "metadata.yaml"
RECORDINGS = (".mcap", ".zstd", ".bag", ".db3", ".txt", ".csv", ".log", ".tum", ".kitti")
Kind = Literal["recording", "cloud", "map", "folder"]
ReplayState = Literal["waiting", "reading", "running", "ended", "refused", "cancelled"]
OPEN: tuple[ReplayState, ...] = ("waiting", "reading", "running")


class UploadPart(Value):
    """One of several files that are sent as one: their bytes follow each other in this order."""

    name: str
    size_bytes: Count


class Upload(Value):
    """One file, or several as one: what it is called, how large it is to be, how much of it is here. Times are wall
    seconds. `main`: of several, the file that says what they are."""

    upload_id: str
    name: str
    kind: Kind
    size_bytes: Count
    received_bytes: Count
    by: str
    begun_s: float
    parts: tuple[UploadPart, ...] = ()
    main: str = ""

    @property
    def complete(self) -> bool:
        """Whether every byte is here."""
        return self.received_bytes == self.size_bytes


class ReplayJob(Value):
    """One replay. `mission_id` once there is a mission; `problem` says why there is none, `do` what to do about it."""

    job_id: str
    upload_id: str
    name: str
    by: str
    state: ReplayState
    target_m: Point | None = None
    place: str = ""
    topics: tuple[str, ...] = ()
    recover: bool = False
    mission_id: str = ""
    status: str = ""
    problem: Explanation = ""

    @property
    def open(self) -> bool:
        """Whether it waits or runs."""
        return self.state in OPEN
