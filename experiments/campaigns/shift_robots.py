"""Connects a worker's simulated robots to a harness of its own; they outlive the harness that commands them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from experiments.campaigns.wire import WiredRobot
from harness.adapters.clock import LockstepClock
from harness.adapters.pictures import PICTURES
from harness.bootstrap import Harness, NullSignals, Parts, local_services, runtime_on
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.ports import BlobStore, Clock, EventStore, Ids, Provider, Spool
from harness.contracts.regularities import HiddenSite
from harness.projections.mission import Mission
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.supervisor import Supervisor
from harness.supervisor.teleoperation import Teleoperation
from simulator.camera import CAMERA
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings

Connections = Mapping[RobotId, RobotConnection]


def world(seed: int) -> WorldSettings:
    """A world without habits: what goes wrong is in the mission's plan."""
    return WorldSettings(seed=seed, hidden=HiddenSite(name="nothing", regularities=()))


def connected(
    robot: SimulatedRobot, clock: LockstepClock, parts: Parts, *, link: WiredRobot | None = None, folder: Path | None
) -> RobotConnection:
    """The connection to one robot, over a link if it has one, with the providers beside it on the files of `folder`."""

    def configure(mission: Mission) -> None:
        faults = [fault for fault in mission.labels.get("faults", "").split(",") if fault]
        robot.configure(mission.mission_id, mission.seed, parse_faults(faults))

    reached = link or robot
    named = robot.robot_id if folder is not None else ""
    own = replace(parts, clock=clock)
    beside = local_services(own, camera=CAMERA, folder=folder, robot_id=named, room=robot.room)
    providers: tuple[Provider, ...] = (*reached.providers(), *beside.providers)
    return RobotConnection(
        robot_id=RobotId(robot.robot_id),
        robot=reached,
        providers={ProviderId(one.card.provider_id): one for one in providers},
        clock=clock,
        ids=parts.ids,
        spool=parts.spool,
        prepare=configure,
        revive=lambda: False,
        pictures=PICTURES,
        waits_for_people=False,
        sources=tuple(beside.sources),
    )


def robot_folder(folder: Path, name: str) -> Path:
    """Where a robot keeps its journals, its world and the truth, in its worker's folder."""
    return folder / "robots" / name


class ShiftRobots:
    """The robots of one worker by name, with their clocks and connections; they outlive the harness above them.

    With a `folder` each keeps its journals, its world and the truth in it.
    """

    def __init__(self, names: Sequence[str], parts: Parts, *, seed: int, folder: Path | None = None) -> None:
        self.parts = parts
        self.robots = {
            name: SimulatedRobot(world(seed), robot_folder(folder, name) if folder else None, robot_id=name)
            for name in names
        }
        self.clocks = {name: LockstepClock(one.advance_to, at_s=one.at_s) for name, one in self.robots.items()}
        self.connections = {
            RobotId(name): connected(one, self.clocks[name], parts, link=self.link(name), folder=folder)
            for name, one in self.robots.items()
        }

    def link(self, name: str) -> WiredRobot | None:
        """The link over which a robot is reached; None for one beside the worker."""
        return None


def parts_on(store: EventStore, *, blobs: BlobStore, spool: Spool, ids: Ids) -> Parts:
    """Parts of a harness whose robots have clocks of their own."""
    clock = LockstepClock(lambda until_s: until_s, at_s=0.0)
    return Parts(store=store, blobs=blobs, spool=spool, ids=ids, clock=clock, signals=NullSignals())


def harness_over(connections: Connections, parts: Parts) -> Harness:
    """One harness over these robots on the log of `parts`."""
    clocks: dict[RobotId, Clock] = {robot_id: one.clock for robot_id, one in connections.items()}
    runtime = runtime_on(parts, clocks)
    return Harness(
        runtime=runtime,
        supervisor=Supervisor(runtime=runtime, connections=connections),
        robots={robot_id: one.robot for robot_id, one in connections.items()},
        clock=parts.clock,
        teleoperation=Teleoperation(runtime=runtime, connections=connections),
        clocks=clocks,
        cameras={},
    )
