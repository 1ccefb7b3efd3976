"""Turns a mission's history and live samples into what its 3D views show, with the instant of every piece.

Reads the runtime and changes nothing there. One feed serves every view of a mission, each at its own instant.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import pi
from threading import RLock
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.background.mission_history import Histories
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed
from app.scene import point_cloud
from app.scene.map_cloud import MapView
from app.views.timeline import TimelineEntry
from harness.adapters.pictures import PICTURES
from harness.contracts.effects import Metric
from harness.contracts.errors import BlobDamaged, ProviderFailed
from harness.contracts.events import PacketRetained
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, MissionId
from harness.contracts.maps import MapCloud, map_stream
from harness.contracts.observations import AnySample, Pose, Scan, Trajectory
from harness.contracts.places import Site
from harness.contracts.tasks import TaskContract
from harness.contracts.values import decode
from harness.runtime import Runtime

VOXEL_M, POINTS = 0.06, 300_000
FRAME_PX = (192, 108)
FOV_RAD = 58.0 * pi / 180.0
Point = tuple[float, float]


@dataclass(frozen=True)
class ScenePlan:
    """The fixed content: reference routes, places and forbidden zones by name, and the local origin.

    `site` is the site's own map: zones, regions of places and passages, each with its kind.
    """

    origin_m: Point
    routes: tuple[tuple[str, tuple[Point, ...]], ...] = ()
    anchors: tuple[tuple[str, Point], ...] = ()
    forbidden: tuple[tuple[str, tuple[Point, ...]], ...] = ()
    site: tuple[tuple[str, str, tuple[Point, ...]], ...] = ()

    @property
    def corners(self) -> tuple[Point, ...]:
        return tuple(point for _, route in self.routes for point in route) + tuple(at for _, at in self.anchors)


@dataclass(frozen=True)
class CameraShot:
    """One camera frame where it was taken."""

    name: str
    stand: point_cloud.Stand
    picture: NDArray[np.uint8] | None


class Feed:
    """`step` is called again and again; what it found stands in the attributes, to be read while holding `reading`."""

    def __init__(self, runtime: Runtime, mission_id: MissionId) -> None:
        self._runtime, self._mission_id = runtime, mission_id
        self.reading = RLock()
        self._histories = Histories(runtime)
        self.track, self.cloud = point_cloud.PoseTrack(), point_cloud.Cloud(voxel_m=VOXEL_M, limit=POINTS)
        self.plan: ScenePlan | None = None
        self.map: MapCloud | None = None
        self.shots: list[CameraShot] = []
        self.sweeps: list[tuple[float, Digest]] = []
        self._waiting: dict[Digest, float] = {}
        self._drawn: set[Digest] = set()
        self._packets: set[str] = set()
        self._frames: list[EvidenceReference] = []
        self._missing = 0

    def map_view(self, *, whole: bool) -> MapView:
        """A drawer of the map's cloud for one reader."""
        return MapView(self._runtime, whole=whole)

    def note(self) -> str:
        """The text alternative of the view: what it shows, or why it is blank."""
        if self.plan is None:
            return N_("The 3D view is being prepared.")
        if not self.track.stands:
            return N_("Nothing to draw yet: no pose has been measured in this mission.")
        waiting, missing = len(self._waiting), self._missing
        drawn = _grouped(self.cloud.count)
        parts = [lazy_gettext("{points} points from {sweeps} lidar sweeps", points=drawn, sweeps=len(self._drawn))]
        parts += [lazy_gettext("{count} sweeps wait for a pose", count=waiting)] if waiting else []
        parts += [lazy_gettext("{count} sweeps could not be read", count=missing)] if missing else []
        if self.map:
            parts += [
                lazy_gettext(
                    "map cloud {source}: {points} points", source=self.map.source, points=_grouped(self.map.points)
                )
            ]
        thinned = lazy_gettext(
            "thinned to {cm} cm, at most {points} points", cm=f"{VOXEL_M * 100:.0f}", points=_grouped(POINTS)
        )
        return lazy_gettext("{parts}.", parts=listed((*parts, thinned)))

    def step(self) -> None:
        """Read what is new. Raises HarnessError if the log cannot be read."""
        with self.reading:
            self._step()

    def _step(self) -> None:
        mission = self._runtime.mission(self._mission_id)
        if self.plan is None and mission.contract is not None:
            self.plan = self._planned(mission.contract)
            self.map = self._runtime.fold(map_stream(mission.contract.map_version)).cloud
        for entry in self._histories.of(self._mission_id):
            self._take_packet(entry)
        live = self._runtime.observations(self._mission_id)
        if live is not None:
            self._take(live.samples, node=mission.invocation.intent.node_id if mission.invocation else "")
        if self.plan is not None:
            self._place_sweeps(self.plan.origin_m)
            self._place_frames()

    def sweep_at(self, at_s: float) -> point_cloud.Floats | None:
        """The newest sweep of the last second before an instant, in the local frame; None if there is none."""
        known = [one for one in self.sweeps if at_s - 1.0 < one[0] <= at_s]
        stand = self.track.at(known[-1][0]) if known else None
        if stand is None or self.plan is None:
            return None
        try:
            return point_cloud.placed(
                point_cloud.sweep(self._runtime.blob(known[-1][1])), stand, origin_m=self.plan.origin_m
            )
        except (BlobDamaged, ValueError):
            return None

    def _planned(self, contract: TaskContract) -> ScenePlan:
        routes: list[tuple[str, tuple[Point, ...]]] = []
        for node in contract.nodes:
            effects = [one.effect for one in node.success_conditions if isinstance(one.effect, Metric)]
            route = next((effect.route_m for effect in effects if effect.route_m), None)
            route = route or _points(node.parameters.get("route"))
            routes += [(node.node_id, route)] if route else []
        places = [place for place in self._runtime.site.places if place.frame == contract.frame]
        bound = set(map(str, contract.bindings.values()))
        anchors = [
            (_label(place.name, place.aliases), place.approach_m)
            for place in places
            if place.place_id in bound or any(one.strip() in ("A", "B") for one in place.aliases)
        ]
        kept_out = set(contract.constraints.keep_out)
        zones = [(place.name, place.region_m) for place in places if place.place_id in kept_out and place.region_m]
        first = next(iter([at for _, at in anchors] + [route[0] for _, route in routes]), (0.0, 0.0))
        return ScenePlan(
            origin_m=(float(round(first[0])), float(round(first[1]))),
            routes=tuple(routes),
            anchors=tuple(anchors),
            forbidden=tuple(zones),
            site=_outlines(self._runtime.site),
        )

    def _take_packet(self, entry: TimelineEntry) -> None:
        if not isinstance(entry.event, PacketRetained) or entry.event.packet.identity.packet_id in self._packets:
            return
        packet = entry.event.packet
        self._packets.add(packet.identity.packet_id)
        for reference in (*packet.before, *packet.after, *packet.estimates):
            if reference.kind == "trajectory":
                sealed = self._trajectory(reference.blob)
                self._take((*sealed.poses, *sealed.scans), node=packet.identity.node_id)
            elif reference.kind == "image" and reference.blob not in self._drawn:
                self._drawn.add(reference.blob)
                self._frames.append(reference)

    def _trajectory(self, blob: Digest) -> Trajectory:
        try:
            return decode(self._runtime.blob(blob), Trajectory)
        except (BlobDamaged, ValueError):
            self._missing += 1
            return Trajectory()

    def _take(self, samples: Iterable[AnySample], *, node: str) -> None:
        for sample in samples:
            match sample:
                case Pose():
                    self.track.add(point_cloud.Stand(sample.at_s, sample.x_m, sample.y_m, sample.yaw_rad, node))
                case Scan() if sample.blob not in self._drawn:
                    self._waiting[sample.blob] = sample.at_s
                case _:
                    continue

    def _place_sweeps(self, origin_m: Point) -> None:
        ready = [(at_s, blob, stand) for blob, at_s in self._waiting.items() if (stand := self.track.at(at_s))]
        for at_s, blob, stand in sorted(ready, key=lambda one: one[0]):
            try:
                self.cloud.add(
                    point_cloud.placed(point_cloud.sweep(self._runtime.blob(blob)), stand, origin_m=origin_m), at_s
                )
                self.sweeps.append((at_s, blob))
            except (BlobDamaged, ValueError):
                self._missing += 1
            del self._waiting[blob]
            self._drawn.add(blob)
        horizon = self.track.newest_s - 5.0
        self._waiting = {blob: at_s for blob, at_s in self._waiting.items() if at_s > horizon}

    def _place_frames(self) -> None:
        left: list[EvidenceReference] = []
        for reference in self._frames:
            stand = self.track.at(reference.from_s)
            if stand is None:
                left.append(reference)
            else:
                self.shots.append(CameraShot(f"/frame/{reference.blob[:12]}", stand, self._picture(reference.blob)))
        self._frames = left

    def _picture(self, blob: Digest) -> NDArray[np.uint8] | None:
        try:
            raw = PICTURES.pixels(self._runtime.blob(blob))
        except (BlobDamaged, ProviderFailed):
            return None
        return np.asarray(cv2.resize(raw, FRAME_PX), dtype=np.uint8)


def _outlines(site: Site) -> tuple[tuple[str, str, tuple[Point, ...]], ...]:
    """(name, kind, corners) of everything on the site's map that has an outline."""
    return (
        *((one.name, "zone", one.region_m) for one in site.zones if one.region_m),
        *((one.name, "region", one.region_m) for one in site.places if one.region_m),
        *((one.passage_id, "passage", one.floor_m) for one in site.passages if one.floor_m),
    )


def _points(value: Any) -> tuple[Point, ...]:
    pairs = value if isinstance(value, tuple) else ()
    return tuple((float(p[0]), float(p[1])) for p in pairs if isinstance(p, tuple | list) and len(p) == 2)


def _label(name: str, aliases: Sequence[str]) -> str:
    """ "B, Office storage area": the letter of the paper where a place has one."""
    letter = next((one for one in aliases if one in ("A", "B")), "")
    return f"{letter}, {name}" if letter and letter not in name.split() else name


def _grouped(count: int) -> str:
    """An integer with thin groups: 1234567 reads as 1 234 567."""
    return f"{count:,}".replace(",", " ")
