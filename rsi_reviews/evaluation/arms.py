"""Runs the arms of the comparison on the same robot, providers, routes and seeds, each on a store of its own.

The arms direct, monitored and behaviour tree have a driver of their own. Evidence-gated is the harness itself. One arm
always hands off.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import msgspec

from harness.bootstrap import Harness, directly, simulated
from harness.contracts.actors import Actor
from harness.contracts.configuration import Configuration, FailureClass, RecoveryAction
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import RobotId
from harness.contracts.reasons import because
from harness.contracts.simulation import Simulator
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Name, Value
from harness.planning.compile import compile_contract
from harness.planning.templates import by_name
from harness.projections.mission import Mission, required_contract
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.evaluation import behaviour_tree
from rsi_reviews.evaluation.driver import ArmRecord, Driver, Policy, Robotics
from rsi_reviews.evaluation.missions import FaultCondition, MissionName, configuration, surroundings
from rsi_reviews.evaluation.rules import BOUND, EVIDENCE, MONITORED, PROVIDER_WORD
from rsi_reviews.evaluation.story import journals, routes_of, story_of
from rsi_reviews.evaluation.wires import MisdeliveringWire

ROBOT = RobotId("vbot-1")
ASKING = Actor(name="evaluation", role="operator")
SIMULATED = HarnessSettings(speed=0, fidelity="kinematic")
FOLLOWER, CAREFUL = "route-follower", "careful-local-planner"
UNBOUNDED = 12
SETTLE_S = 1.6


class ArmCase(Value):
    """One mission to run: the arm, the fault condition, the contract, the seed."""

    arm: Name
    condition: FaultCondition
    mission: MissionName
    seed: int


@dataclass(frozen=True)
class CaseReport:
    """How a case went: the story for the adjudicator, and what only the arm knows. `cpu_s`: of the judged mission."""

    story: dict[str, Any]
    status: str
    spent: int
    handoffs: int
    mission_s: float
    cpu_s: float


Walk = Callable[[Robotics], ArmRecord]


@dataclass(frozen=True)
class EvaluationArm:
    """One way to decide that a leg is done. `walk`: its own driver; without one, the harness under `settle`."""

    name: str
    text: str
    walk: Walk | None = None
    settle: Callable[[Configuration], Configuration] = lambda first: first


def _driven(policy: Policy) -> Walk:
    return lambda robotics: Driver(robotics, policy).run()


def _handed_off(robotics: Robotics) -> ArmRecord:
    diary = ArmRecord()
    diary.give_up("a person is asked to do it", asks=True)
    return diary


def without_recovery(first: Configuration) -> Configuration:
    """Every failure goes to a person at once: no recovery step, no budget."""
    ladders: dict[FailureClass, tuple[RecoveryAction, ...]] = dict.fromkeys(first.recovery.ladders, ("human",))
    return msgspec.structs.replace(first, recovery=msgspec.structs.replace(first.recovery, ladders=ladders))


MONITORING = Policy(rules=MONITORED, providers=(FOLLOWER, FOLLOWER), deadlines=True, keeps_requests=True, settle_s=0.5)
BINDING_EVIDENCE = Policy(
    rules=BOUND,
    providers=(FOLLOWER, FOLLOWER, CAREFUL),
    looks=2,
    deadlines=True,
    keeps_requests=True,
    settle_s=SETTLE_S,
    asks=True,
)
UNBOUND_EVIDENCE = replace(BINDING_EVIDENCE, rules=EVIDENCE, bound=False)
UNBOUNDED_RECOVERY = replace(BINDING_EVIDENCE, providers=(FOLLOWER,) * UNBOUNDED, looks=UNBOUNDED)
ARMS: tuple[EvaluationArm, ...] = (
    EvaluationArm(
        "direct",
        "the provider is called; its word for success is success",
        _driven(Policy(rules=PROVIDER_WORD, providers=(FOLLOWER,))),
    ),
    EvaluationArm("monitored", "lifecycle, deadlines, request ids, one retry; done means done", _driven(MONITORING)),
    EvaluationArm(
        "behaviour-tree",
        "py_trees: navigate, settle, then condition nodes on fresh poses and wheels; three tries",
        behaviour_tree.walk,
    ),
    EvaluationArm("evidence-gated", "the harness itself under H_0"),
    EvaluationArm("always-hands-off", "a person is asked at once; nothing moves", _handed_off),
    EvaluationArm(
        "bound-driver",
        "the evaluation's own driver with the full rule tuple: what the next row lacks one thing of",
        _driven(BINDING_EVIDENCE),
    ),
    EvaluationArm(
        "no-evidence-binding",
        "the same driver without identity, interval and freshness of evidence",
        _driven(UNBOUND_EVIDENCE),
    ),
    EvaluationArm(
        "no-recovery", "the harness with every ladder cut to its last rung, a person", settle=without_recovery
    ),
    EvaluationArm(
        "unbounded-recovery",
        f"the same driver with {UNBOUNDED} attempts and {UNBOUNDED} looks a leg, not 3 and 2",
        _driven(UNBOUNDED_RECOVERY),
    ),
)
COMPARED = ("direct", "monitored", "behaviour-tree", "evidence-gated", "always-hands-off")
ABLATIONS = ("bound-driver", "no-evidence-binding", "no-recovery", "unbounded-recovery")


def arm(name: str) -> EvaluationArm:
    """The arm of that name; raises UnknownName."""
    found = next((one for one in ARMS if one.name == name), None)
    if found is None:
        raise UnknownName(because("unknown_arm", name=name, known=tuple(one.name for one in ARMS)), where="--arms")
    return found


def run(case: ArmCase, simulator: Simulator) -> CaseReport:
    """Run one case from its seed; the same case gives the same story."""
    return run_under(arm(case.arm), case, simulator)


def run_under(chosen: EvaluationArm, case: ArmCase, simulator: Simulator) -> CaseReport:
    """Run a case for an arm that is not one of the published ones, such as the harness under a candidate."""
    with _world(case, chosen.settle(configuration()), simulator) as (harness, mission):
        intended = _intended_contract(case) if case.condition.aliased else None
        begun_s, worked_s = harness.clock.now().mission_s, process_time()
        if chosen.walk is None:
            done = harness.supervisor.run(mission.mission_id)
            diary = ArmRecord(status=done.status, spent=done.spent_total, handoffs=len(harness.runtime.handoffs()))
        else:
            done = _prepared(harness, mission)
            diary = chosen.walk(Robotics(harness, done))
        cpu_s, ended_s = process_time() - worked_s, harness.clock.now().mission_s
        story = (
            story_of(harness, done, intended=intended)
            if chosen.walk is None
            else _noted(harness, done, diary, intended=intended)
        )
        return CaseReport(story, diary.status, diary.spent, diary.handoffs, ended_s - begun_s, cpu_s)


@contextmanager
def _world(case: ArmCase, configured: Configuration, simulator: Simulator) -> Iterator[tuple[Harness, Mission]]:
    """The case's mission, compiled on a fresh robot and a fresh store; it is the second of its robot.

    Before it the harness walks a circuit without faults, so that evidence of another mission is on record.
    """
    site = surroundings(case.mission, aliased=case.condition.aliased)
    wire = MisdeliveringWire if case.condition.misdelivers else directly
    with simulated(
        SIMULATED, simulator=simulator, seed=case.seed, configuration=configured, site=site, wire=wire
    ) as harness:
        earlier = _started(harness, Start(actor=ASKING, robot_id=ROBOT, template="circuit", seed=case.seed))
        harness.supervisor.run(earlier.mission_id)
        labels = {"faults": ",".join(case.condition.faults)} if case.condition.faults else {}
        start = Start(actor=ASKING, robot_id=ROBOT, template=case.mission, seed=case.seed, labels=labels)
        yield harness, _started(harness, start)


def _started(harness: Harness, start: Start) -> Mission:
    decision = harness.runtime.start(start)
    if isinstance(decision, Refused):
        raise ContractInvalid(because("evaluated_mission_refused", why=decision.reason), where=start.template)
    return harness.runtime.missions()[0]


def _prepared(harness: Harness, mission: Mission) -> Mission:
    """The simulated world is told which mission begins, as for the harness; the supervisor's first step moves nothing
    and is its last."""
    harness.supervisor.step(mission.mission_id)
    if harness.starts(mission.mission_id):
        raise ContractInvalid(because("arm_moved_by_harness"), where=mission.mission_id)
    return harness.runtime.mission(mission.mission_id)


def _noted(harness: Harness, mission: Mission, diary: ArmRecord, *, intended: TaskContract | None) -> dict[str, Any]:
    """The story of an arm that keeps a diary and has no log."""
    return {
        **routes_of(required_contract(mission), intended=intended),
        **journals(harness, mission),
        "claims": diary.claims,
        "rejections": diary.rejections,
        "declared": diary.declared,
        "ended_s": harness.clock.now().mission_s,
    }


def _intended_contract(case: ArmCase) -> TaskContract:
    """The contract as the person meant it: compiled where no place is confused with another."""
    template = by_name(case.mission, configuration().templates)
    site = surroundings(case.mission, aliased=False)
    return compile_contract(goal=template.goal, template=template, arguments={}, site=site)
