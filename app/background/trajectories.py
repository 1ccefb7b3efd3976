"""Caches what sensors measured in a mission: sealed trajectories, and live samples for open pages."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from threading import Lock

from cachetools import LRUCache

from app.views.plots import MeasuredPosition, Readings
from app.views.timeline import TimelineEntry
from harness.contracts import observations
from harness.contracts.errors import BlobDamaged
from harness.contracts.events import PacketRetained
from harness.contracts.ids import Digest, MissionId, NodeId
from harness.contracts.values import decode
from harness.runtime import Live, Runtime

KEPT = 16


@dataclass
class _PacketReadings:
    """What the packets of one mission hold, by sensor time; `packets` were read, `shown` was made last."""

    packets: set[str] = field(default_factory=set)
    spots: dict[float, MeasuredPosition] = field(default_factory=dict)
    speed: dict[float, float] = field(default_factory=dict)
    charge: dict[float, float] = field(default_factory=dict)
    shown: Readings | None = None

    def take(self, samples: Iterable[observations.AnySample], *, node: NodeId) -> None:
        for sample in samples:
            match sample:
                case observations.Pose():
                    self.spots.setdefault(sample.at_s, MeasuredPosition(sample.at_s, sample.x_m, sample.y_m, node))
                case observations.Odometry():
                    self.speed.setdefault(sample.at_s, sample.v_mps)
                case observations.Battery():
                    self.charge.setdefault(sample.at_s, sample.charge)
                case _:
                    continue

    @property
    def readings(self) -> Readings:
        return Readings(
            spots=tuple(self.spots[at_s] for at_s in sorted(self.spots)),
            speed=tuple(sorted(self.speed.items())),
            charge=tuple(sorted(self.charge.items())),
        )


class Measurements:
    """The newest KEPT missions that somebody looked at. Safe between threads."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._sealed: LRUCache[MissionId, _PacketReadings] = LRUCache(KEPT)
        self._lock = Lock()

    def of(
        self, mission_id: MissionId, entries: Sequence[TimelineEntry], *, live: Live | None, node: NodeId
    ) -> Readings:
        """Everything measured so far; `node` is the stage that the live samples belong to."""
        with self._lock:
            sealed = self._sealed.setdefault(mission_id, _PacketReadings())
            fresh = self._read(sealed, entries)
            if live is not None:
                sealed.take(live.samples, node=node)
            if fresh or live is not None or sealed.shown is None:
                sealed.shown = sealed.readings
            return sealed.shown

    def _read(self, sealed: _PacketReadings, entries: Sequence[TimelineEntry]) -> bool:
        before = len(sealed.packets)
        for entry in entries:
            if not isinstance(entry.event, PacketRetained):
                continue
            identity = entry.event.packet.identity
            if identity.packet_id in sealed.packets:
                continue
            sealed.packets.add(identity.packet_id)
            packet = entry.event.packet
            for reference in (*packet.before, *packet.after, *packet.estimates):
                if reference.kind == "trajectory":
                    trajectory = self._trajectory(reference.blob)
                    sealed.take((*trajectory.poses, *trajectory.odometry, *trajectory.battery), node=identity.node_id)
        return len(sealed.packets) > before

    def _trajectory(self, blob: Digest) -> observations.Trajectory:
        """Empty where the blob cannot be read; its reference says so among the evidence."""
        try:
            return decode(self._runtime.blob(blob), observations.Trajectory)
        except (BlobDamaged, ValueError):
            return observations.Trajectory()
