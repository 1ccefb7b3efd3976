"""Decides whether a point cloud may become the picture of its map version. Pure."""

from math import isfinite

from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.maps import AttachCloud, CloudAttached
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.maps import MapPicture, apply


def decide(picture: MapPicture, command: AttachCloud, now: Moment) -> Decision[CloudAttached]:
    """Refuse a cloud whose chunks do not add up or that has no finite position; one already shown adds nothing."""
    cloud = command.cloud
    if not cloud.points or sum(chunk.points for chunk in cloud.chunks) != cloud.points:
        return refused("chunks_incomplete", points=cloud.points)
    if not all(isfinite(value) for corner in (cloud.origin_m, cloud.low_m, cloud.high_m) for value in corner):
        return refused("no_place", because("cloud_not_finite"))
    if picture.cloud == cloud:
        return Accepted(())
    return Accepted((CloudAttached(actor=command.actor, cloud=cloud, reason=command.reason),))


DECIDER: Decider[MapPicture, AttachCloud, CloudAttached] = Decider(
    initial=MapPicture(), apply=apply, decide=decide, codec=Codec(CloudAttached)
)
