"""Runs the course of one mission: the supervisor's steps, outside acts at their times, and a person's answers."""

from collections import Counter
from dataclasses import dataclass

from experiments.campaigns.plan import Disturbance, MissionPlan
from experiments.campaigns.wire import SteppedClock
from harness.bootstrap import Harness
from harness.contracts.actors import Actor
from harness.contracts.commands import (
    AcquireLease,
    ApproveHandoff,
    ChangeEpoch,
    ClearVeto,
    MissionCommand,
    RaiseVeto,
    ReleaseLease,
)
from harness.contracts.decisions import Accepted
from harness.contracts.errors import HarnessError
from harness.contracts.ids import InvocationId, MissionId, ResourceId, lease_stream
from harness.contracts.ports import Clock
from harness.gate.commit import CommandEnvelope

OPERATORS = (Actor(name="ada", role="operator"), Actor(name="ben", role="operator"))
BASE = ResourceId("vbot-1/mobile_base")
FOREIGN = InvocationId("inv_of_somebody_else")
ELSEWHERE = MissionId("mis_of_somebody_else")
MOST_STEPS = 6000
LONGEST_S = 2400.0
LAYER = "campaign"
FROM_OUTSIDE = ("lease-conflict", "epoch-change", "veto")


@dataclass
class MissionCourse:
    """What happened around the steps. `escaped`: an error that no step handled; `endless`: stopped without an end."""

    steps: int = 0
    answered: int = 0
    accepted: int = 0
    escaped: str = ""
    endless: bool = False


@dataclass(frozen=True)
class OutsideAct:
    """An act on the mission from outside: the beginning of a disturbance, or its end."""

    at_s: float
    disturbance: Disturbance
    begins: bool


def run(
    harness: Harness, mission_id: MissionId, *, plan: MissionPlan, clock: SteppedClock, struck: Counter[str]
) -> MissionCourse:
    """Step until the mission is over or waits for a person who does not answer; at most MOST_STEPS and LONGEST_S."""
    course, begun_s = MissionCourse(), clock.true_s
    due = _acts(plan, begun_s)
    while True:
        while due and due[0].at_s <= clock.true_s:
            _do(harness, mission_id, due.pop(0), struck)
        course.steps += 1
        if course.steps > MOST_STEPS or clock.true_s - begun_s > LONGEST_S:
            course.endless = True
            return course
        try:
            wake_s = harness.supervisor.step(mission_id)
            if wake_s is None and not answered(harness, mission_id, plan, course):
                return course
            if wake_s is not None:
                clock.wait_until(wake_s)
        except Exception as error:  # noqa: BLE001 - whatever leaves a step is a finding, with its seed
            course.escaped = f"{type(error).__name__}: {error}"
            return course


def turn(
    harness: Harness,
    mission_id: MissionId,
    plan: MissionPlan,
    course: MissionCourse,
    *,
    clock: Clock,
    begun_s: float,
    raised: tuple[type[HarnessError], ...] = (),
) -> bool:
    """One step of a mission that shares its worker with others; whether it is over.

    Errors of the kinds `raised` are the worker's own matter; any other is a finding of the mission.
    """
    course.steps += 1
    course.endless = course.steps > MOST_STEPS or clock.now().mission_s - begun_s > LONGEST_S
    if course.endless:
        return True
    try:
        wake_s = harness.supervisor.step(mission_id)
        if wake_s is None:
            return not answered(harness, mission_id, plan, course)
        clock.wait_until(wake_s)
    except raised:
        raise
    except Exception as error:  # noqa: BLE001 - whatever leaves a step is a finding, with its seed
        course.escaped = f"{type(error).__name__}: {error}"
        return True
    return False


def _acts(plan: MissionPlan, begun_s: float) -> list[OutsideAct]:
    mine = [one for one in plan.disturbances if one.name in FROM_OUTSIDE]
    begin = [OutsideAct(begun_s + one.at_s, one, True) for one in mine]
    end = [OutsideAct(begun_s + one.at_s + one.for_s, one, False) for one in mine if one.name != "epoch-change"]
    return sorted([*begin, *end], key=lambda act: act.at_s)


def _do(harness: Harness, mission_id: MissionId, act: OutsideAct, struck: Counter[str]) -> None:
    """One act; an act that the gate refuses does not count as having struck."""
    runtime, name = harness.runtime, act.disturbance.name
    if name == "lease-conflict":
        lease = runtime.lease(BASE)
        request = (
            AcquireLease(
                resource=BASE,
                mission_id=ELSEWHERE,
                invocation_id=FOREIGN,
                token=lease.token + 1,
                expires_s=act.at_s + act.disturbance.for_s + act.disturbance.size_s,
            )
            if act.begins
            else ReleaseLease(invocation_id=FOREIGN, reason="done")
        )
        decision = runtime.commit([CommandEnvelope(lease_stream(BASE), request, None)])
    else:
        command: MissionCommand = RaiseVeto(layer=LAYER, reason="somebody is in the way")
        if name == "epoch-change":
            command = ChangeEpoch(map_version="site-1", reason="the localiser was started again")
        elif not act.begins:
            command = ClearVeto(layer=LAYER, reason="the way is free")
        decision = runtime.submit(mission_id, command)
    if act.begins and isinstance(decision, Accepted):
        struck[name] += 1


def answered(harness: Harness, mission_id: MissionId, plan: MissionPlan, course: MissionCourse) -> bool:
    """Two people approve the same question at once; at most one may be accepted. False: nobody answered."""
    mission = harness.runtime.mission(mission_id)
    if mission.handoff_id is None or course.answered >= plan.approvals:
        return False
    handoff = harness.runtime.handoff(mission.handoff_id)
    opened = handoff.opened
    if opened is None:
        return False
    course.answered += 1
    taken = 0
    for person in OPERATORS:
        decision = harness.supervisor.answer(
            mission.handoff_id,
            ApproveHandoff(
                actor=person,
                reason="I looked, go on",
                key=f"{person.name}-{mission.handoff_id}",
                cycle=handoff.cycle,
                subject=opened.subject,
                evidence=opened.evidence,
            ),
        )
        taken += isinstance(decision, Accepted) and bool(decision.events)
    course.accepted = max(course.accepted, taken)
    return taken > 0
