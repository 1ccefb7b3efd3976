"""Runs the ordinary agent loop on a recording, and writes a mission as a recording."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from harness.adapters.ids import SystemIds
from harness.adapters.limited_process import run_limited
from harness.adapters.pictures import size_of
from harness.adapters.providers.recording.limits import recording_limits
from harness.adapters.providers.recording.reader import Recording, open_recording
from harness.adapters.providers.recording.robot import RecordedRobot
from harness.adapters.providers.recording.segments import Segment
from harness.adapters.providers.recording.topics import TopicSettings, topic_settings
from harness.adapters.providers.recording.writer import RecordedLeg, WriteSummary, record_mission
from harness.adapters.providers.recording.writer import RecordedMission as Recorded
from harness.adapters.stores.blob_address import open_owned_blobs
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.log_address import open_log
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.adapters.stores.owner import OwnerLock
from harness.adapters.stores.spool import FileSpool
from harness.assembly import Harness, Member, NullSignals, Parts, assemble, beside
from harness.baseline.load import workspace_in
from harness.contracts.actors import Actor
from harness.contracts.commands import EndMission
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, RecordingInvalid
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.observations import SINGLE_SOURCE, AnySample, Image, Trajectory
from harness.contracts.place_events import place_stream
from harness.contracts.places import Site
from harness.contracts.ports import EventStore
from harness.contracts.reasons import because
from harness.contracts.site_events import site_stream
from harness.contracts.tasks import Node, TaskTemplate
from harness.contracts.values import Point, Value, decode, encode
from harness.gate.places import DECIDER as PLACE
from harness.gate.site_changes import DECIDER as CHANGES
from harness.planning.binding import bind_place
from harness.planning.templates import by_name
from harness.projections.mission import Mission, NodeState, required_contract
from harness.projections.places import changed_site
from harness.projections.site_changes import with_routes
from harness.runtime import Runtime, Start
from harness.settings import HarnessSettings
from harness.supervisor.supervisor import Supervisor
from harness.verification.geometry import path_length

TOLERANCE_M = 0.40
"""Bytes that a packed recording may unpack to, on disk."""


@dataclass(frozen=True)
class Replayer:
    """A recording with the harness around it."""

    runtime: Runtime
    supervisor: Supervisor
    recording: Recording
    robot: RecordedRobot
    target_source: str

    @property
    def single_source(self) -> str:
        """The topic that position and motion both come from, so that neither confirms the other; empty for two."""
        summary = self.recording.summary()
        return (summary.position_topic or summary.odometry_topic) if summary.single_source else ""

    def run(
        self,
        actor: Actor,
        *,
        watch: Callable[[Mission], None],
        began: Callable[[MissionId], None] = lambda mission_id: None,
        interrupted: Callable[[], bool] = lambda: False,
    ) -> tuple[Mission, dict[str, Any]]:
        """Run the navigation mission on the recording, and what the harness measured on its own (D38).

        Interrupted, it ends failed, and says that it was cancelled.
        """
        templates = self.runtime.current_configuration(RobotId("recording")).templates
        template = drive_template(by_name("recording", templates), self.robot.segments)
        target = self.robot.segments[-1].target_m
        arguments: dict[str, str | float] = {
            **({"target_x_m": target[0], "target_y_m": target[1]} if target else {}),
            "frame": self.recording.frame,
            "map_version": self.recording.map_version,
            "tolerance_m": TOLERANCE_M,
        }
        start = Start(
            actor=actor,
            robot_id=RobotId("recording"),
            template="recording",
            arguments=arguments,
            replay=True,
            labels=self._labels(),
        )
        decision = self.runtime.start(start, template=template)
        if isinstance(decision, Refused):
            raise ContractInvalid(decision.reason)
        mission_id: MissionId = decision.events[0].mission_id  # type: ignore[union-attr]
        began(mission_id)
        mission = self.supervisor.run(mission_id, watch=watch, interrupted=interrupted)
        if interrupted():
            self.runtime.submit(mission_id, EndMission(status="failed", reason=because("replay_cancelled")))
            mission = self.runtime.mission(mission_id)
        return mission, self.facts(mission)

    def _labels(self) -> dict[str, str]:
        labels = {"recording": self.recording.sha256, "target_source": self.target_source}
        labels |= {SINGLE_SOURCE: self.single_source} if self.single_source else {}
        return labels | ({"incomplete": "yes"} if self.recording.summary().incomplete else {})

    def facts(self, mission: Mission) -> dict[str, Any]:
        """Path length and duration of the whole recording, the target and its source, every leg's figures, and what
        guards the recording's bytes, what a cut one lacks and what was not read of it.

        What the recorded supervisor declared comes from the recording; what was measured, from the gate's verdicts.
        """
        judged = [_measured(node) for node in mission.nodes.values()]
        summary = self.recording.summary()
        return {
            "path_length_m": path_length(point for _, point in self.recording.track()),
            "duration_s": self.recording.duration_s,
            "target_source": self.target_source,
            "target_m": self.robot.segments[-1].target_m,
            SINGLE_SOURCE: self.single_source,
            "recording": self.recording.sha256,
            "checks": summary.checks,
            "incomplete": summary.incomplete,
            "left_out": summary.left_out,
            "segments": [
                {
                    "name": segment.name,
                    "reference_length_m": segment.reference_length_m,
                    "declared_distance_m": segment.declared_distance_m,
                    "measured_distance_m": figures.get("distance_m"),
                    "last_pose_distance_m": figures.get("last_pose_distance_m", segment.last_pose_distance_m),
                }
                for segment, figures in zip(self.robot.segments, judged, strict=True)
            ],
        }


@contextmanager
def replayed(
    settings: HarnessSettings,
    path: Path,
    *,
    target: Point | None,
    topics: Sequence[str],
    place: str = "",
    recover: bool = False,
) -> Iterator[Replayer]:
    """The harness on this data folder with a recording in place of a robot.

    The arrival is tested at `target`, or at the approach of `place`, or where the recording's own goals and routes
    lead. With `recover` a cut recording is replayed as far as it is whole. Raises RecordingInvalid for a recording that
    cannot be read, before anything is written, UnknownName for a place and ContractInvalid for one on another map,
    before a mission is created.
    """
    with ExitStack() as stack:
        recording = open_checked(path, topic_settings(topics), recover=recover)
        stack.callback(recording.close)
        folder = prepare(settings.data_folder)
        lock = stack.enter_context(OwnerLock(folder.root))
        ids = SystemIds()
        lock.take(token=ids.token())
        store = open_log(settings.database or folder.log_url)
        stack.callback(store.close)
        goal = _approach(place, _site(store, workspace_in(settings.site_folder).site), recording) if place else target
        robot = RecordedRobot(recording, target=goal)
        stack.callback(robot.close)
        parts = Parts(
            store=store,
            blobs=open_owned_blobs(settings.blobs, folder.blobs),
            spool=FileSpool(folder.spool),
            ids=ids,
            clock=robot,
            signals=NullSignals(),
            index=stack.enter_context(closing(SqlMemoryIndex(f"sqlite:///{folder.root / 'memory.db'}"))),
        )
        recorded = settings.model_copy(update={"robot_id": "recording", "speed": 0.0})
        harness = assemble(stack, recorded, parts, robot=robot, local=(), configure=lambda _: None)
        given = f"--place {place}" if place else "--target" if target is not None else ""
        source = given or robot.segments[-1].target_source
        yield Replayer(harness.runtime, harness.supervisor, recording, robot, source)


@contextmanager
def replayed_beside(
    harness: Harness,
    settings: HarnessSettings,
    path: Path,
    *,
    target: Point | None,
    topics: Sequence[str],
    place: str = "",
    recover: bool = False,
) -> Iterator[Replayer]:
    """As `replayed`, on the log of a harness that runs and goes on running. One at a time."""
    assert harness.parts is not None
    with ExitStack() as stack:
        recording = open_checked(path, topic_settings(topics), recover=recover)
        stack.callback(recording.close)
        goal = _approach(place, harness.runtime.site, recording) if place else target
        robot = RecordedRobot(recording, target=goal)
        stack.callback(robot.close)
        parts = replace(harness.parts, clock=robot, models={}, observer=None)
        member = Member(RobotId("recording"), robot, robot, (), lambda _: None)
        recorded = settings.model_copy(update={"robot_id": "recording", "speed": 0.0})
        runtime, supervisor = beside(stack, recorded, parts, member)
        given = "place" if place else "target" if target is not None else ""
        yield Replayer(runtime, supervisor, recording, robot, given or robot.segments[-1].target_source)


class RecordingToRead(Value):
    """What the process that reads a recording first is asked; `topics` is JSON."""

    path: str
    topics: str
    recover: bool = False


def open_checked(path: Path, topics: TopicSettings | None = None, *, recover: bool = False) -> Recording:
    """A recording that a process with limits has read from end to end before: what it takes is known then.

    Raises RecordingInvalid for one that cannot be read, takes more than that, or changes meanwhile.
    """
    settings = topics or TopicSettings()
    request = RecordingToRead(
        path=str(path.absolute()), topics=settings.model_dump_json(exclude_unset=True), recover=recover
    )
    answer = run_limited(read_whole, encode(request), recording_limits(path), failure=RecordingInvalid, where=str(path))
    recording = open_recording(path, settings, recover=recover)
    if recording.sha256 != answer.decode():
        recording.close()
        raise RecordingInvalid(because("recording_changed"), where=str(path))
    return recording


def read_whole(request: bytes) -> bytes:
    """The digest of a recording after every sample of it was decoded, in this very process. Raises RecordingInvalid."""
    task = decode(request, RecordingToRead)
    topics = TopicSettings.model_validate_json(task.topics)
    with open_recording(Path(task.path), topics, recover=task.recover, size_of=size_of) as recording:
        for _ in recording.samples():
            pass
        return recording.sha256.encode()


def _site(store: EventStore, shipped: Site) -> Site:
    """The places and routes of the site's folder with the changes that people made in this data folder."""
    places = PLACE.fold(PLACE.initial, map(PLACE.codec.decode, store.load(place_stream(shipped.name))))
    changes = CHANGES.fold(CHANGES.initial, map(CHANGES.codec.decode, store.load(site_stream(shipped.name))))
    return with_routes(changed_site(shipped, places), changes)


def _approach(name: str, site: Site, recording: Recording) -> Point:
    """Where a place is entered, if its map is the recording's."""
    place = bind_place(name, site=site)
    if (recording.frame, recording.map_version) == (site.frame, site.map_version):
        return place.approach_m
    raise ContractInvalid(
        because(
            "place_on_other_map",
            place_id=place.place_id,
            map_version=site.map_version,
            frame=site.frame,
            recorded_map_version=recording.map_version,
            recorded_frame=recording.frame,
        ),
        where="--place",
    )


def _measured(node: NodeState) -> dict[str, float]:
    results = node.verdicts[-1].results if node.verdicts else ()
    return next((result.measured for result in results if "distance_m" in result.measured), {})


def drive_template(template: TaskTemplate, segments: Sequence[Segment]) -> TaskTemplate:
    """One node per recorded leg, in order; the template's single node is the pattern.

    Without a target nothing can be tested but that there is none: every condition is then ambiguous (D38).
    """
    template = template if segments[-1].target_m else _untargeted(template)
    (pattern,) = template.nodes
    names = [pattern["node_id"] if len(segments) == 1 else f"leg-{index + 1}" for index in range(len(segments))]
    nodes = tuple(
        _leg_node(pattern, name, segment, after=names[index - 1 : index])
        for index, (name, segment) in enumerate(zip(names, segments, strict=True))
    )
    in_order = {
        "condition_id": "goal.in_order",
        "text": "The recorded legs were accepted in their order",
        "effect": {"type": "temporal", "predicate": "in_order", "interval_s": 1.0, "bound": 1.0, "nodes": names},
    }
    over_all = (in_order,) if len(segments) > 1 else ()
    return msgspec.structs.replace(
        template, nodes=nodes, completion_conditions=(*template.completion_conditions, *over_all)
    )


def _untargeted(template: TaskTemplate) -> TaskTemplate:
    """The template without its target: what it would test there becomes `arrival_without_target`."""
    effect = {"type": "symbolic", "predicate": "arrival_without_target", "arguments": {}}

    def untargeted(condition: dict[str, Any]) -> dict[str, Any]:
        return condition | {"text": "The body is at its target, which nobody named", "effect": effect}

    (pattern,) = template.nodes
    parameters = {name: value for name, value in pattern["parameters"].items() if name != "target"}
    conditions = [untargeted(one) for one in pattern["success_conditions"]]
    node = pattern | {"parameters": parameters, "success_conditions": conditions}
    return msgspec.structs.replace(
        template,
        nodes=(node,),
        parameters=tuple(one for one in template.parameters if not one.name.startswith("target_")),
        completion_conditions=tuple(untargeted(one) for one in template.completion_conditions),
    )


def _leg_node(pattern: dict[str, Any], name: str, segment: Segment, *, after: list[str]) -> dict[str, Any]:
    if segment.target_m is None:
        return pattern
    target = list(segment.target_m)
    route = {"route": [list(point) for point in segment.route_m]} if segment.route_m else {}
    conditions = [
        condition
        | {
            "condition_id": f"{name}.{condition['condition_id'].partition('.')[2]}",
            "effect": condition["effect"] | {"target_m": target},
        }
        for condition in pattern["success_conditions"]
    ]
    parameters = pattern["parameters"] | {"target": target} | route
    return pattern | {
        "node_id": name,
        "depends_on": after,
        "parameters": parameters,
        "success_conditions": conditions,
    }


def write_recording(runtime: Runtime, mission_id: MissionId, path: Path) -> WriteSummary:
    """Write a mission as MCAP with the paper's topics (4 MiB at most). Raises RecordingInvalid."""
    mission = runtime.mission(mission_id)
    contract = required_contract(mission)
    packets = [packet for node in mission.nodes.values() for packet in node.packets]
    recorded = Recorded(
        mission_id=mission_id,
        frame=contract.frame,
        map_version=contract.map_version,
        legs=tuple(
            _leg(contract.node(packet.identity.node_id), packet)
            for packet in sorted(packets, key=lambda packet: packet.dispatched_s)
            if "route" in contract.node(packet.identity.node_id).parameters and not packet.verify_only
        ),
    )
    return record_mission(path, recorded, samples=_samples(runtime, packets), blob=runtime.blob)


def _leg(node: Node, packet: EvidencePacket) -> RecordedLeg:
    arrival = next((receipt for receipt in packet.receipts if receipt.kind == "arrival"), None)
    return RecordedLeg(
        name=node.node_id,
        route_m=msgspec.convert(node.parameters["route"], tuple[Point, ...]),
        dispatched_s=packet.dispatched_s,
        departed_s=packet.declared.get("departed_at_s"),
        arrived_s=arrival.at_s if arrival else None,
        declared_distance_m=packet.declared.get("distance_m"),
        closed_s=packet.collected_s,
    )


def _samples(runtime: Runtime, packets: Sequence[EvidencePacket]) -> list[AnySample]:
    found: dict[int, AnySample] = {}
    for packet in packets:
        for reference in packet.estimates:
            trajectory = decode(runtime.blob(reference.blob), Trajectory)
            samples: tuple[AnySample, ...] = (*trajectory.poses, *trajectory.odometry, *trajectory.scans)
            found |= {sample.seq: sample for sample in samples}
        for reference in packet.after:
            if reference.kind == "image":
                image = _image(reference.blob, reference.until_s, reference.values)
                found[image.seq] = image
    return sorted(found.values(), key=lambda sample: (sample.at_s, sample.seq))


def _image(blob: Digest, at_s: float, values: dict[str, float | str]) -> Image:
    return msgspec.convert(
        {
            "kind": "image",
            "seq": int(values["seq"]),
            "at_s": at_s,
            "source": "camera",
            "frame": "camera",
            "blob": blob,
            "media_type": values["media_type"],
            "width_px": int(values["width_px"]),
            "height_px": int(values["height_px"]),
            "yaw_rad": values["yaw_rad"],
            "request_id": values["request_id"],
        },
        Image,
    )
