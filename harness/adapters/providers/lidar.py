"""Collects the robot's lidar sweeps while a passage is analysed: a second method on another sensor (D45)."""

from collections.abc import Callable

from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import LidarLook, Measurement
from harness.contracts.observations import Odometry, Pose, Scan, Trajectory
from harness.contracts.values import encode

LOOK_S = 4.0
"""How many seconds of sweeps count, up to when the analysis was collected."""
Keep = Callable[[bytes], Digest]


class PassageSweep:
    """IndependentSource of `passage_checked`: sweeps, poses and odometry of the last seconds, kind "sweep".

    The sweeps themselves are stored as blobs when they arrive; the verifier computes what they show.
    """

    predicate = "passage_checked"
    lasting = False
    able = True

    def __init__(self, *, keep: Keep) -> None:
        self._keep = keep

    def measure(self, measurement: Measurement) -> tuple[EvidenceReference, ...]:
        """One reference; none without a sweep."""
        since_s = measurement.until_s - LOOK_S
        recent = [one for one in measurement.samples if since_s <= one.at_s <= measurement.until_s]
        scans = tuple(one for one in recent if isinstance(one, Scan))
        if not scans:
            return ()
        poses = tuple(one for one in recent if isinstance(one, Pose))
        look = LidarLook(
            trajectory=Trajectory(
                poses=poses, odometry=tuple(one for one in recent if isinstance(one, Odometry)), scans=scans
            ),
            camera=measurement.status.camera if measurement.status else None,
        )
        maps = {(pose.frame, pose.map_version) for pose in poses}
        frame, map_version = maps.pop() if len(maps) == 1 else ("", "")
        reference = EvidenceReference(
            kind="sweep",
            origin="sensor",
            source="lidar",
            from_s=scans[0].at_s,
            until_s=scans[-1].at_s,
            confidence=1.0,
            blob=self._keep(encode(look)),
            frame=frame,
            map_version=map_version,
        )
        return (reference,)
