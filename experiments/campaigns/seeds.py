"""Plays the shipped missions without any fault on many seeds: each must succeed, on more than a provider's own word.

A seed passes where the mission ends as it should and every completion condition is satisfied at independence 1 or more.
The camera task ends PARTLY_VERIFIED: its description is declared, and only conditions that rest on it may stay open.
"""

import argparse
import gc
import math
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import msgspec

from experiments.campaigns.code import code_digest
from experiments.campaigns.recovery_steps import ACTOR, ROBOT
from experiments.campaigns.regen import ROOT
from harness.bootstrap import simulated
from harness.contracts.decisions import Accepted
from harness.contracts.reasons import plain
from harness.contracts.values import Count, Value
from harness.projections.mission import Mission, declared_goals
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

PAGE = ROOT / "docs" / "reliability.md"
RESULTS = ROOT / "docs" / "results" / "seeds.json"
BEGIN, END = "<!-- seeds: written by `make campaign` -->", "<!-- end of seeds -->"
ENDS = {
    "warehouse-inspection": "succeeded",
    "circuit": "succeeded",
    "exploration": "succeeded",
    "camera-report": "partly_verified",
}
"""The shipped missions that need no argument, and how each ends where nothing goes wrong."""
LEAST_INDEPENDENCE = 1


class SeedResult(Value):
    """One mission. `wrong`: what was not as it should be, empty where all was. `failures`: of its stages, before they
    were committed or given up.

    `least`: the lowest independence of a satisfied completion condition.
    """

    template: str
    seed: Count
    status: str
    wrong: tuple[str, ...]
    failures: Count
    least: Count


class TemplateSeeds(Value):
    """All seeds of one template. `recovered`: missions that passed though a stage failed first.

    `failed`: what was wrong, by seed.
    """

    template: str
    expected: str
    missions: Count
    passed: Count
    recovered: Count
    least: Count
    failed: dict[int, tuple[str, ...]]


class SeedReport(Value):
    """A campaign over `missions` seeds from `seed` on, the same for every template."""

    seed: Count
    missions: Count
    command: str
    templates: tuple[TemplateSeeds, ...]
    code: str = ""
    """The digest of what was tried; empty in figures of before it was written down."""

    @property
    def offences(self) -> tuple[str, ...]:
        """Every seed that did not pass, with what was wrong."""
        return tuple(
            f"{one.template}, seed {seed}: {'; '.join(wrong)}"
            for one in self.templates
            for seed, wrong in one.failed.items()
        )


def one_seed(template: str, seed: int) -> SeedResult:
    """The mission of one seed on the kinematic robot in virtual time, and what is wrong with its end."""
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=seed) as harness:
        start = Start(actor=ACTOR, robot_id=ROBOT, template=template, seed=seed)
        decision = harness.runtime.start(start)
        if not isinstance(decision, Accepted):
            raise RuntimeError(f"{template} of seed {seed} was not created: {plain(decision.reason)}")
        mission_id = next(harness.runtime.newest_missions()).mission_id
        harness.supervisor.run(mission_id)
        mission = harness.runtime.mission(mission_id)
    results = mission.goal_verdict.results if mission.goal_verdict else ()
    return SeedResult(
        template=template,
        seed=seed,
        status=mission.status,
        wrong=tuple(wrong_with(mission, expected=ENDS[template])),
        failures=sum(len(node.failures) for node in mission.nodes.values()),
        least=min((one.independence for one in results if one.verdict == "satisfied"), default=0),
    )


def wrong_with(mission: Mission, *, expected: str) -> Iterator[str]:
    """What is not as it should be with the end of a mission without faults."""
    if mission.status != expected:
        yield f"ended {mission.status}: {plain(mission.reason)}"
    if mission.goal_verdict is None:
        yield "the goal was never judged"
        return
    open_allowed = {one.condition_id for one in declared_goals(mission)} if expected == "partly_verified" else set()
    for one in mission.goal_verdict.results:
        if one.verdict == "satisfied" and one.independence < LEAST_INDEPENDENCE:
            yield f"{one.condition_id} rests on independence {one.independence}"
        if one.verdict != "satisfied" and (one.verdict != "ambiguous" or one.condition_id not in open_allowed):
            yield f"{one.condition_id} is {one.verdict}: {plain(one.reason)}"


def all_seeds(
    templates: Iterable[str], *, seed: int, missions: int, processes: int, minutes: float | None
) -> Iterator[SeedResult]:
    """Every template on every seed, the templates by turns, so that a run that is cut short has tried them alike."""
    cases = [(template, seed + number) for number in range(missions) for template in templates]
    until_s = math.inf if minutes is None else time.monotonic() + 60.0 * minutes
    if processes < 2:
        for one in cases:
            if time.monotonic() > until_s:
                return
            yield one_seed(*one)
            gc.collect()
        return
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(one_seed, *one) for one in cases]):
            yield done.result()
            if time.monotonic() > until_s:
                pool.shutdown(wait=False, cancel_futures=True)
                return


def report(results: Iterable[SeedResult], *, seed: int, missions: int, command: str, code: str = "") -> SeedReport:
    """The results by template."""
    known = list(results)
    return SeedReport(
        seed=seed,
        missions=missions,
        command=command,
        code=code,
        templates=tuple(_of_template(name, [one for one in known if one.template == name]) for name in ENDS),
    )


def _of_template(name: str, results: list[SeedResult]) -> TemplateSeeds:
    return TemplateSeeds(
        template=name,
        expected=ENDS[name],
        missions=len(results),
        passed=sum(not one.wrong for one in results),
        recovered=sum(one.failures > 0 and not one.wrong for one in results),
        least=min((one.least for one in results), default=0),
        failed={one.seed: one.wrong for one in sorted(results, key=lambda one: one.seed) if one.wrong},
    )


def table(found: SeedReport) -> str:
    """The figures in Markdown."""
    made_on = f" on code `{found.code[:12]}`" if found.code else ""
    lines = [
        f"Seeds from {found.seed}, kinematic robot in virtual time, no fault.",
        "",
        "| mission | ends | seeds | as it should | of these recovered | lowest independence of a met condition |",
        "|---|---|---:|---:|---:|---:|",
        *(
            f"| {one.template} | {one.expected} | {one.missions} | {one.passed} | {one.recovered} | {one.least} |"
            for one in found.templates
        ),
        "",
        *(f"- {offence}" for offence in found.offences),
        *([""] if found.offences else []),
        f"Made by `{found.command}`{made_on}.",
    ]
    return "\n".join(lines)


def publish(found: SeedReport, *, page: Path = PAGE, results: Path = RESULTS) -> None:
    """Write the JSON file and the part of the page between its two marks. Raises ValueError without the marks."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    results.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=2) + b"\n")
    page.write_text(f"{before}{BEGIN}\n\n{table(found)}\n\n{END}{after}", encoding="utf-8")


def run(arguments: argparse.Namespace) -> None:
    """`python -m experiments.campaigns seeds`: print the table; publish it if asked. Exit 1 where a seed failed."""
    command = f"python -m experiments.campaigns seeds --missions {arguments.missions} --seed {arguments.seed}"
    command += f" --minutes {arguments.minutes:g}" if arguments.minutes is not None else ""
    code = code_digest()
    results = []
    for one in all_seeds(
        arguments.only or ENDS,
        seed=arguments.seed,
        missions=arguments.missions,
        processes=arguments.processes,
        minutes=arguments.minutes,
    ):
        results.append(one)
        word = "; ".join(one.wrong) or one.status
        print(f"{one.template} {one.seed}: {word} ({one.failures} failures)", file=sys.stderr, flush=True)
    found = report(results, seed=arguments.seed, missions=arguments.missions, command=command, code=code)
    print(table(found))
    if arguments.publish:
        publish(found)
    if found.offences:
        raise SystemExit(1)
