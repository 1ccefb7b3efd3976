"""From a mission's history and its live samples to what is drawn. Reads the runtime; changes nothing there."""

from collections.abc import Iterable, Sequence
from itertools import groupby
from math import pi
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.cloud import Cloud, Stand, Track, placed, sweep
from app.drawing import Drawing
from app.history import Histories
from app.views.timeline import Entry
from harness.contracts.effects import Metric
from harness.contracts.errors import BlobDamaged
from harness.contracts.events import PacketRetained
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, MissionId
from harness.contracts.observations import AnySample, Pose, Scan, Trajectory
from harness.contracts.tasks import TaskContract
from harness.contracts.values import decode
from harness.runtime import Runtime

VOXEL_M, COARSE_M, POINTS = 0.06, 0.3, 300_000
BACKLOG = 12
FRAME_PX = (192, 108)
FOV_RAD = 58.0 * pi / 180.0


class Feed:
    """Feeds one drawing. `step` is called again and again, from one thread."""

    def __init__(self, runtime: Runtime, mission_id: MissionId, drawing: Drawing) -> None:
        self._runtime, self._mission_id, self._drawing = runtime, mission_id, drawing
        self._histories = Histories(runtime)
        self._track, self._cloud = Track(), Cloud(voxel_m=VOXEL_M, limit=POINTS)
        self._waiting: dict[Digest, float] = {}
        self._drawn: set[Digest] = set()
        self._packets: set[str] = set()
        self._frames: list[EvidenceReference] = []
        self._stages: dict[str, int] = {}
        self._missing = 0
        self._begun = False

    def note(self) -> str:
        """One sentence for people who cannot see the picture, or see a blank one."""
        if not self._begun:
            return "The 3D view is being prepared."
        if not self._track.stands:
            return "Nothing to draw yet: no pose has been measured in this mission."
        parts = [f"{self._cloud.count:,} points from {len(self._drawn)} lidar sweeps".replace(",", " ")]
        parts += [f"{len(self._waiting)} sweeps wait for a pose"] if self._waiting else []
        parts += [f"{self._missing} sweeps could not be read"] if self._missing else []
        parts += [f"thinned to {VOXEL_M * 100:.0f} cm, at most {POINTS:,} points".replace(",", " ")]
        return "; ".join(parts) + "."

    def step(self) -> None:
        """Take what is new and draw it. Raises HarnessError if the log cannot be read."""
        mission = self._runtime.mission(self._mission_id)
        entries = self._histories.of(self._mission_id)
        if not self._begun and mission.contract is not None:
            self._draw_contract(mission.contract)
            self._begun = True
        changed = {node for entry in entries for node in self._take_packet(entry)}
        live = self._runtime.observations(self._mission_id)
        if live is not None:
            node = mission.invocation.intent.node_id if mission.invocation else ""
            changed |= self._take(live.samples, node=node)
        if changed:
            self._draw_track(changed)
        self._draw_sweeps()
        self._draw_frames()

    def _draw_contract(self, contract: TaskContract) -> None:
        corners: list[tuple[float, float]] = []
        for node in contract.nodes:
            effects = [one.effect for one in node.success_conditions if isinstance(one.effect, Metric)]
            route = next((effect.route_m for effect in effects if effect.route_m), None) or _points(
                node.parameters.get("route")
            )
            if route:
                self._drawing.route(node.node_id, route)
                corners += route
        for place in self._runtime.site.places:
            named = any(one.strip() in ("A", "B") for one in place.aliases)
            if place.frame == contract.frame and (named or place.place_id in contract.bindings.values()):
                self._drawing.anchor(_label(place.name, place.aliases), place.approach_m)
                corners.append(place.approach_m)
        if corners:
            self._drawing.look_at(corners)

    def _take_packet(self, entry: Entry) -> set[str]:
        if not isinstance(entry.event, PacketRetained) or entry.event.packet.identity.packet_id in self._packets:
            return set()
        packet = entry.event.packet
        self._packets.add(packet.identity.packet_id)
        changed: set[str] = set()
        for reference in (*packet.before, *packet.after, *packet.estimates):
            if reference.kind == "trajectory":
                sealed = self._trajectory(reference.blob)
                changed |= self._take((*sealed.poses, *sealed.scans), node=packet.identity.node_id)
            elif reference.kind == "image":
                self._frames.append(reference)
        return changed

    def _trajectory(self, blob: Digest) -> Trajectory:
        try:
            return decode(self._runtime.blob(blob), Trajectory)
        except (BlobDamaged, ValueError):
            self._missing += 1
            return Trajectory()

    def _take(self, samples: Iterable[AnySample], *, node: str) -> set[str]:
        changed = set()
        for sample in samples:
            match sample:
                case Pose():
                    stand = Stand(sample.at_s, sample.x_m, sample.y_m, sample.yaw_rad, node)
                    if self._track.add(stand):
                        changed.add(node)
                case Scan() if sample.blob not in self._drawn:
                    self._waiting[sample.blob] = sample.at_s
                case _:
                    continue
        return changed

    def _draw_track(self, changed: set[str]) -> None:
        for stage, group in groupby(sorted(self._track.stands, key=lambda s: (s.node, s.at_s)), key=lambda s: s.node):
            if stage in changed:
                number = self._stages.setdefault(stage, len(self._stages))
                self._drawing.trajectory(stage or "before", number, list(group))
        self._drawing.robot(self._track.stands[-1])

    def _draw_sweeps(self) -> None:
        ready = [(blob, stand) for blob, at_s in self._waiting.items() if (stand := self._track.at(at_s)) is not None]
        if len(ready) > BACKLOG:
            self._draw_coarse(ready[:: max(len(ready) // BACKLOG, 1)])
        touched: set[int] = set()
        for blob, stand in ready:
            touched |= self._add(self._cloud, blob, stand)
            del self._waiting[blob]
            self._drawn.add(blob)
        for number in sorted(touched):
            self._drawing.chunk(number, self._cloud.chunks[number])
        if len(ready) > BACKLOG:
            self._drawing.refined()
        horizon = self._track.newest_s - 5.0
        self._waiting = {blob: at_s for blob, at_s in self._waiting.items() if at_s > horizon}

    def _draw_coarse(self, some: Sequence[tuple[Digest, Stand]]) -> None:
        rough = Cloud(voxel_m=COARSE_M, limit=POINTS)
        for blob, stand in some:
            self._add(rough, blob, stand)
        if rough.chunks:
            self._drawing.coarse(np.concatenate(rough.chunks))

    def _add(self, cloud: Cloud, blob: Digest, stand: Stand) -> set[int]:
        try:
            return cloud.add(placed(sweep(self._runtime.blob(blob)), stand))
        except (BlobDamaged, ValueError):
            self._missing += 1
            return set()

    def _draw_frames(self) -> None:
        for reference in self._frames:
            stand = self._track.at(reference.from_s)
            if stand is not None:
                self._drawing.frame(reference.blob[:12], stand, self._picture(reference.blob), fov_rad=FOV_RAD)
        self._frames = [one for one in self._frames if self._track.at(one.from_s) is None]

    def _picture(self, blob: Digest) -> NDArray[np.uint8] | None:
        try:
            raw = cv2.imdecode(np.frombuffer(self._runtime.blob(blob), dtype=np.uint8), cv2.IMREAD_COLOR_RGB)
        except (BlobDamaged, cv2.error):
            return None
        return None if raw is None else np.asarray(cv2.resize(raw, FRAME_PX), dtype=np.uint8)


def _points(value: Any) -> tuple[tuple[float, float], ...]:
    pairs = value if isinstance(value, tuple) else ()
    return tuple((float(p[0]), float(p[1])) for p in pairs if isinstance(p, tuple | list) and len(p) == 2)


def _label(name: str, aliases: Sequence[str]) -> str:
    """ "B, Office storage area": the letter of the paper where a place has one."""
    letter = next((one for one in aliases if one in ("A", "B")), "")
    return f"{letter}, {name}" if letter and letter not in name.split() else name
