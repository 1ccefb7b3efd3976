"""Measures what each recovery step changes: of each failure class and step, how often what followed was committed."""

import argparse
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal

from experiments.campaigns.code import code_digest
from experiments.campaigns.regen import ROOT
from harness.bootstrap import simulated
from harness.contracts import events
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.ids import RobotId
from harness.contracts.reasons import Reason
from harness.contracts.values import Count, Value
from harness.gate.decide import DECIDER
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.faults import FAULT_NAMES, ON_LEGS
from simulator.in_process import SIMULATOR

PAGE = ROOT / "docs" / "recovery.md"
BEGIN, END = "<!-- figures: written by `make campaign` -->", "<!-- end of figures -->"
ROBOT = RobotId("vbot-1")
ACTOR = Actor(name="campaign", role="operator")
NOTHING_IN = 200
"""A step that never helped in so many tries does not belong in a ladder."""
TEMPLATES = ("circuit", "warehouse-inspection")
ONLY_INSPECTION = ("hidden-passage",)
StepEnd = Literal["committed", "in vain", "passed over"]
PEOPLE = ("human", "stop", "safe_stop")
"""Steps that end the try or ask a person: nothing is committed by them."""


class StepEffect(Value):
    """One failure class and step: how often it was taken, and how often the stage was committed next.

    `passed_over`: how often it was tried and did not apply, since there was no other route; these are not in `taken`.
    """

    failure: str
    action: str
    taken: Count
    committed: Count
    passed_over: Count = 0

    @property
    def ineffective(self) -> bool:
        return self.taken >= NOTHING_IN and self.committed == 0 and self.action not in PEOPLE


class StepReport(Value):
    """All steps of a campaign. `offences` are steps that stand in a ladder and change nothing."""

    missions: Count
    rounds: Count
    """Missions of each fault with each template."""
    seed: Count
    steps: tuple[StepEffect, ...]
    offences: tuple[str, ...]


def recovery_steps(missions: int, *, seed: int, minutes: float | None = None) -> StepReport:
    """So many missions for each fault and template, transient and persistent by turns, on the kinematic robot.

    A round plays each fault with each template once; with `minutes`, no further round begins after that time.
    """
    until_s = math.inf if minutes is None else time.monotonic() + 60.0 * minutes
    taken: Counter[tuple[str, str]] = Counter()
    committed: Counter[tuple[str, str]] = Counter()
    passed: Counter[tuple[str, str]] = Counter()
    count = rounds = 0
    while rounds < missions and (not rounds or time.monotonic() < until_s):
        number, rounds = rounds, rounds + 1
        persistent = ":persistent" if number % 2 else ""
        for fault, template in faults_and_templates():
            log = mission_log(template, f"{fault}{persistent}", seed=seed + number)
            count += 1
            for failure, action, helped in steps_in(log):
                taken[(failure, action)] += helped != "passed over"
                committed[(failure, action)] += helped == "committed"
                passed[(failure, action)] += helped == "passed over"
    steps = tuple(
        StepEffect(failure=one[0], action=one[1], taken=times, committed=committed[one], passed_over=passed[one])
        for one, times in sorted(taken.items())
    )
    offences = tuple(f"{one.action} after {one.failure}: 0 of {one.taken}" for one in steps if one.ineffective)
    return StepReport(missions=count, rounds=rounds, seed=seed, steps=steps, offences=offences)


def faults_and_templates() -> Iterator[tuple[str, str]]:
    """Each fault with each template in which it can strike."""
    for fault in FAULT_NAMES:
        if fault in ON_LEGS:
            continue
        for template in TEMPLATES:
            if template == TEMPLATES[-1] or fault not in ONLY_INSPECTION:
                yield fault, template


def mission_log(template: str, fault: str, *, seed: int) -> list[events.MissionEvent]:
    """The events of one mission at speed 0; it ends when it is over or waits for a person."""
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=seed) as harness:
        start = Start(actor=ACTOR, robot_id=ROBOT, template=template, seed=seed, labels={"faults": fault})
        decision = harness.runtime.start(start)
        assert isinstance(decision, Accepted), decision
        mission_id = next(harness.runtime.newest_missions()).mission_id
        harness.supervisor.run(mission_id)
        return [DECIDER.codec.decode(one) for one in harness.runtime.events(mission_id)]


def steps_in(log: Iterable[events.MissionEvent]) -> Iterator[tuple[str, str, StepEnd]]:
    """Every authorised step with its failure class, and what came of it: its stage was committed before it failed
    again, or not, or the step did not apply.
    """
    waiting: dict[str, tuple[str, str]] = {}
    for event in log:
        match event:
            case events.RecoveryAuthorised():
                waiting[event.node_id] = (event.failure, event.action)
            case events.NodeCommitted() if event.node_id in waiting:
                yield (*waiting.pop(event.node_id), "committed")
            case events.FailureClassified(reason=Reason(code="step_not_applicable")) if event.node_id in waiting:
                yield (*waiting.pop(event.node_id), "passed over")
            case events.FailureClassified() | events.NodeFailed() if event.node_id in waiting:
                yield (*waiting.pop(event.node_id), "in vain")
            case _:
                pass
    for failure, action in waiting.values():
        yield failure, action, "in vain"


def table(report: StepReport) -> str:
    """The figures in Markdown."""
    lines = [
        f"{report.missions:,} missions with a fault each, {report.rounds} of each fault with each template, seeds from "
        f"{report.seed}, kinematic fidelity.",
        "",
        "| failure class | step | taken | committed next | share | did not apply |",
        "|---|---|---:|---:|---:|---:|",
        *map(_row, report.steps),
        "",
        "Steps without effect in 200 tries or more: " + ("; ".join(report.offences) or "none") + ".",
    ]
    return "\n".join(lines)


def _row(step: StepEffect) -> str:
    share = f"{step.committed / step.taken:.0%}" if step.taken else "-"
    return f"| {step.failure} | {step.action} | {step.taken:,} | {step.committed:,} | {share} | {step.passed_over:,} |"


def publish(report: StepReport, *, command: str, code: str, page: Path = PAGE) -> None:
    """Replace the part of the page between its two marks. Raises ValueError without the marks."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    made = f"{table(report)}\n\nMade by `{command}` on code `{code[:12]}`."
    page.write_text(f"{before}{BEGIN}\n\n{made}\n\n{END}{after}", encoding="utf-8")


def run(arguments: argparse.Namespace) -> None:
    """`python -m experiments.campaigns recovery`: print the table; publish it if asked. Exit 1 for a useless step."""
    code = code_digest()
    report = recovery_steps(arguments.missions, seed=arguments.seed, minutes=arguments.minutes)
    print(table(report))
    if arguments.publish:
        sizes = f"--missions {arguments.missions} --seed {arguments.seed}"
        sizes += f" --minutes {arguments.minutes:g}" if arguments.minutes is not None else ""
        publish(report, command=f"python -m experiments.campaigns recovery {sizes} --publish", code=code)
    if report.offences:
        raise SystemExit(1)
