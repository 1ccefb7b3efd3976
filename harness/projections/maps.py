"""Folds which point cloud a map version is shown with; earlier clouds stay in the log. Pure."""

from msgspec.structs import replace

from harness.contracts.maps import CloudAttached, MapCloud
from harness.contracts.values import Count, Value


class MapPicture(Value):
    """The newest cloud of one map version; none before the first."""

    version: Count = 0
    cloud: MapCloud | None = None


def apply(picture: MapPicture, event: CloudAttached) -> MapPicture:
    """The picture after one more event."""
    return replace(picture, version=picture.version + 1, cloud=event.cloud)
