"""One mission of a worker's robot, for every shift: how it is created, stepped and laid before the adjudicator."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import msgspec

from experiments.campaigns.kills import commits_of
from experiments.campaigns.mission import ASKING, PlayedMission, template_of
from experiments.campaigns.mission_course import MissionCourse, turn
from experiments.campaigns.plan import MissionPlan
from harness.bootstrap import Harness
from harness.contracts.decisions import Accepted
from harness.contracts.errors import HarnessError
from harness.contracts.events import HandoffRequested, MissionCreated
from harness.contracts.ids import HandoffId, MissionId, RobotId, handoff_stream, lease_stream, leased
from harness.contracts.ports import Clock, StoredEvent
from harness.runtime import Runtime, Start
from simulator.robot import SimulatedRobot
from simulator.truth import Truth

BASE = "mobile_base"


@dataclass
class MissionUnderway:
    """A mission in progress on one robot, and the log position of that robot's lease before it."""

    plan: MissionPlan
    mission_id: MissionId
    begun_s: float
    lease_version: int
    course: MissionCourse = field(default_factory=MissionCourse)

    def turn(self, harness: Harness, clock: Clock, *, raised: tuple[type[HarnessError], ...] = ()) -> bool:
        """One step; whether the mission is over. Errors of the kinds `raised` are the worker's own matter."""
        return turn(harness, self.mission_id, self.plan, self.course, clock=clock, begun_s=self.begun_s, raised=raised)

    def record(self, harness: Harness, robot: SimulatedRobot, truth: Iterable[Truth]) -> PlayedMission:
        """What an adjudicator needs of a mission that is over: the log, and this robot's own truth."""
        log = mission_log(harness.runtime, self.mission_id, RobotId(robot.robot_id), lease_version=self.lease_version)
        return PlayedMission(
            plan=self.plan,
            mission=harness.runtime.mission(self.mission_id),
            log=log,
            commits=tuple(commits_of(log)),
            truth=tuple(truth),
            starts=harness.starts(self.mission_id),
            sent=frozenset(),
            struck=robot.struck(),
            course=self.course,
            harness=harness,
        )


def freed(harness: Harness, name: str) -> int:
    """The version of the lease on a robot's base, which is free: a quarantined one is freed by a look at the robot.

    Raises ProviderUnreachable for a robot that nobody can look at.
    """
    base = leased(RobotId(name), BASE)
    if harness.runtime.lease(base).status == "quarantined":
        harness.supervisor.free(base, actor=ASKING, reason="the robot stands")
    return harness.runtime.lease(base).version


def created(harness: Harness, plan: MissionPlan, name: str, labels: Mapping[str, str]) -> MissionId:
    """A new mission of this plan on a robot, with labels beside its faults."""
    start = Start(
        actor=ASKING,
        robot_id=RobotId(name),
        template=plan.template,
        seed=plan.seed % 2**31,
        labels={"faults": ",".join(plan.faults), **labels},
    )
    decision = harness.runtime.start(start, template=template_of(harness, plan))
    first = decision.events[0] if isinstance(decision, Accepted) else decision
    if not isinstance(first, MissionCreated):
        raise RuntimeError(f"mission {plan.seed} was not created: {first}")
    return first.mission_id


def mission_log(
    runtime: Runtime, mission_id: MissionId, robot_id: RobotId, *, lease_version: int
) -> tuple[StoredEvent, ...]:
    """Everything about one mission, in the log's order: its events, its questions, its robot's lease since then."""
    mine = runtime.events(mission_id)
    requests = (event for event in mine if event.kind == HandoffRequested.__name__)
    questions = [HandoffId(msgspec.json.decode(event.body)["handoff_id"]) for event in requests]
    events = [event for one in questions for event in runtime.stream(handoff_stream(one))]
    leases = runtime.stream(lease_stream(leased(robot_id, BASE)))[lease_version:]
    return tuple(sorted((*mine, *events, *leases), key=lambda event: event.position))


def as_errand(plan: MissionPlan) -> MissionPlan:
    """The plan as an errand without disturbances of the link: a shift has its own."""
    return msgspec.structs.replace(plan, template="errand", disturbances=())
