"""The point cloud of a map version: its chunks, its origin and who attached it, in metres in the map's frame."""

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.ids import Digest, StreamId
from harness.contracts.values import Count, Name, NonNegative, Value

Corner = tuple[float, float, float]


class CloudChunk(Value):
    """Part of a cloud: `points` float32 xyz triples, little-endian, relative to the cloud's origin.

    Chunks go from coarse to fine: those up to a level together hold one point per voxel of its size; the last level
    has voxel size 0 and completes the cloud.
    """

    voxel_m: NonNegative
    points: Count
    blob: Digest


class MapCloud(Value):
    """A cloud as it is shown: refined chunk by chunk. `source` names the file, `source_digest` its bytes.

    `origin_m` is added to every point: 32 bits are exact to micrometres near it, wherever on the globe the map lies.
    """

    map_version: Name
    frame: Name
    source: Name
    source_digest: Digest
    points: Count
    dropped: Count
    origin_m: Corner
    low_m: Corner
    high_m: Corner
    chunks: tuple[CloudChunk, ...]


class AttachCloud(Command, tag=True):
    actor: Actor
    cloud: MapCloud
    reason: str


class CloudAttached(Event, tag=True):
    """From here on views of this map version show this cloud. It is a picture, never evidence."""

    actor: Actor
    cloud: MapCloud
    reason: str


def map_stream(map_version: str) -> StreamId:
    return StreamId(f"map/{map_version}")
