"""Builds whole missions in virtual time on the kinematic robot, with the ground truth beside them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import hypot

from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.effects import Metric
from harness.contracts.events import DispatchIntended, MissionEvent
from harness.contracts.ids import MissionId, NodeId, RobotId
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission, required_contract
from harness.projections.starts import repeated_starts
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from simulator.robot import SimulatedRobot
from simulator.truth import Truth

ROBOT = RobotId("vbot-1")
OPERATOR = Actor(name="ada", role="operator")


@dataclass(frozen=True)
class Ran:
    """A mission that ended or waits, and everything about it."""

    harness: Harness
    mission: Mission
    truth: tuple[Truth, ...]

    @property
    def events(self) -> list[MissionEvent]:
        return [DECIDER.codec.decode(event) for event in self.harness.runtime.events(self.mission.mission_id)]

    @property
    def actions(self) -> list[str]:
        """Recovery actions that led to a dispatch, in order."""
        return [e.action for e in self.events if isinstance(e, DispatchIntended) and e.action is not None]

    @property
    def waits(self) -> list[str]:
        return [spend.action for node in self.mission.nodes.values() for spend in node.spends if not spend.cost]

    def verdicts(self, node_id: str) -> list[str]:
        return [verdict.verdict for verdict in self.mission.of(NodeId(node_id)).verdicts]

    def true_distance_m(self, node_id: str, at_s: float) -> float:
        """How far the body truly was from a node's target at one instant."""
        node = required_contract(self.mission).node(NodeId(node_id))
        target = next(c.effect.target_m for c in node.success_conditions if isinstance(c.effect, Metric))
        nearest = min((t for t in self.truth if t.kind == "pose"), key=lambda t: abs(t.at_s - at_s))
        return hypot(nearest.x_m - target[0], nearest.y_m - target[1])

    def false_completions(self) -> list[str]:
        """Committed arrivals that the ground truth contradicts (5 cm of localiser noise allowed)."""
        found: list[str] = []
        for fact in self.mission.facts:
            if fact.name in ("arrival", "circuit"):
                packet = next(
                    p for p in self.mission.of(fact.node_id).packets if p.identity.packet_id == fact.packet_id
                )
                if self.true_distance_m(fact.node_id, packet.collected_s) > 0.45:
                    found.append(fact.node_id)
        return found

    def duplicate_starts(self) -> int:
        return repeated_starts(self.harness.starts(self.mission.mission_id))


@contextmanager
def ran(template: str, *faults: str, seed: int = 3) -> Iterator[Ran]:
    """Run one mission at speed 0 on the kinematic robot."""
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=seed) as harness:
        mission_id = begin(harness, template, *faults, seed=seed)
        mission = harness.supervisor.run(mission_id)
        robot = harness.robots[ROBOT]
        assert isinstance(robot, SimulatedRobot)
        yield Ran(harness=harness, mission=mission, truth=tuple(robot.world.truth.records))


def begin(harness: Harness, template: str, *faults: str, seed: int = 3) -> MissionId:
    """Create the mission without running it."""
    labels = {"faults": ",".join(faults)} if faults else {}
    decision = harness.runtime.start(Start(actor=OPERATOR, robot_id=ROBOT, template=template, seed=seed, labels=labels))
    assert isinstance(decision, Accepted), decision
    return next(harness.runtime.newest_missions()).mission_id
