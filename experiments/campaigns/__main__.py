"""Fault campaigns: `python -m experiments.campaigns run`, `recovery`, `verifier`, `fleet`, `fuzz`, `hostile`,
`walking`, `replay SEED`, `check NAME`.

`run` does everything, prints what it found and publishes it where it was of the full size (or with --publish).
CAMPAIGN_MISSIONS and CAMPAIGN_SEED, or --missions and --seed, ask for another run; a smaller one leaves docs/ alone.
"""

import argparse
import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import msgspec

from experiments.campaigns import fleet, fuzz, hostile, models, recovery_steps, seeds, walking
from experiments.campaigns.adjudicate import judged
from experiments.campaigns.code import code_digest
from experiments.campaigns.damage import DamageReport, damages
from experiments.campaigns.declared_effects import declared_offences
from experiments.campaigns.hammer import HammerReport, hammer
from experiments.campaigns.hard_faults import HardFaultReport, hard_faults
from experiments.campaigns.kills import KillReport, kill_campaign
from experiments.campaigns.mission import played
from experiments.campaigns.plan import mission_plan
from experiments.campaigns.planted_bugs import RED, Check, PlantedReport, planted_bugs
from experiments.campaigns.publish import publish, stored_figures
from experiments.campaigns.races import RaceReport, races
from experiments.campaigns.random_kills import RandomKillReport, joined, random_kills
from experiments.campaigns.release_races import release_races
from experiments.campaigns.rivals import rival_rounds
from experiments.campaigns.simulate import one_mission, seeds_of, simulated_campaign
from experiments.campaigns.suspended_holders import SuspensionReport, suspensions
from experiments.campaigns.tally import summary
from experiments.campaigns.workers import WorkersReport, worked_missions
from experiments.verifier import campaign as verifier

MISSIONS, SEED = 100_000, 1
MISSIONS_EACH, SEEDS_EACH = 20, 200
PROCESSES = 2
FULL = {
    "answers": 1000,
    "appends": 1000,
    "rivals": 1000,
    "releases": 1000,
    "suspensions": 100,
    "planted": 400,
    "hammer": 10_000,
    "workers": 1000,
    "instants": 200,
    "hard": 20,
}
SMALLEST = {
    "answers": 3,
    "appends": 24,
    "rivals": 10,
    "releases": 9,
    "suspensions": 3,
    "planted": 250,
    "hammer": 300,
    "workers": 12,
    "instants": 6,
    "hard": 1,
}
QUICK = 24
QUICK_DECISIONS, QUICK_KILLS_S = 200, (0.3, 0.9)
PARTS = (
    "planted",
    "races",
    "rivals",
    "releases",
    "suspended",
    "damage",
    "kills",
    "instants",
    "hard",
    "hammer",
    "workers",
    "simulation",
)


Report = (
    RaceReport
    | SuspensionReport
    | DamageReport
    | KillReport
    | HammerReport
    | WorkersReport
    | RandomKillReport
    | HardFaultReport
)


def main() -> None:
    """Exit 1 if anything was found that must not be."""
    parser = argparse.ArgumentParser(prog="python -m experiments.campaigns", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    whole = commands.add_parser("run", help="every campaign")
    whole.add_argument("--missions", type=int, default=int(os.environ.get("CAMPAIGN_MISSIONS", MISSIONS)))
    whole.add_argument("--seed", type=int, default=int(os.environ.get("CAMPAIGN_SEED", SEED)))
    whole.add_argument("--minutes", type=float, default=None, help="simulate, or work, no longer than this")
    whole.add_argument("--processes", type=int, default=PROCESSES)
    whole.add_argument("--only", default="", choices=("", *PARTS), help="one campaign; what is published else, stays")
    whole.add_argument(
        "--first", type=int, default=0, help="of `instants`: add those from this one on to what is published"
    )
    whole.add_argument("--keep", type=Path, default=None, help="folder for missions that a kill kept from succeeding")
    whole.add_argument("--publish", action="store_true", help="write docs/ although the run is smaller")
    steps = commands.add_parser("recovery", help="how often each recovery step helped")
    steps.add_argument("--missions", type=int, default=MISSIONS_EACH, help="missions for each fault and template")
    steps.add_argument("--seed", type=int, default=SEED)
    steps.add_argument("--minutes", type=float, default=None, help="begin no further round after this")
    steps.add_argument("--publish", action="store_true", help="write docs/recovery.md")
    many = commands.add_parser("seeds", help="the shipped missions without a fault")
    many.add_argument("--missions", type=int, default=SEEDS_EACH, help="seeds of each mission")
    many.add_argument("--seed", type=int, default=SEED)
    many.add_argument("--only", action="append", choices=tuple(seeds.ENDS), help="one mission; may be repeated")
    many.add_argument("--minutes", type=float, default=None, help="play no longer than this")
    many.add_argument("--processes", type=int, default=PROCESSES)
    many.add_argument("--publish", action="store_true", help="write docs/reliability.md and docs/results/seeds.json")
    several = commands.add_parser("fleet", help="three workers with eight robots each on one database")
    several.add_argument("--missions", type=int, default=fleet.MISSIONS_EACH, help="of each robot")
    several.add_argument("--seed", type=int, default=SEED)
    several.add_argument("--minutes", type=float, default=None, help="begin no mission after so long")
    several.add_argument("--folder", type=Path, default=None, help="kept: the same command goes on from there")
    several.add_argument("--publish", action="store_true", help="write docs/reliability.md and docs/results/fleet.json")
    fuzzing = commands.add_parser("fuzz", help="changed bytes for every parser of foreign files")
    fuzzing.add_argument("--minutes", type=float, default=10.0, help="for each parser")
    fuzzing.add_argument("--seed", type=int, default=SEED, help="another seed tries other files, and adds to the page")
    fuzzing.add_argument("--only", action="append", choices=tuple(fuzz.PARSERS), help="one parser; may be repeated")
    fuzzing.add_argument("--publish", action="store_true", help="write docs/reliability.md and docs/results/fuzz.json")
    lies = commands.add_parser("hostile", help="missions against robots that lie, flood, hang and break the protocol")
    lies.add_argument("modes", nargs="*", help="lies or groups of lies; all of them without any")
    lies.add_argument("--seed", type=int, default=3)
    lies.add_argument("--at", action="append", choices=hostile.PLACES, help="where the kit stands; may be repeated")
    lies.add_argument("--second-looks", type=int, default=1000, help="honest images of one place, in one log")
    lies.add_argument("--publish", action="store_true", help="write the section of docs/reliability.md")
    cases = commands.add_parser("verifier", help="how often each predicate is right, against the simulated truth")
    cases.add_argument("--cases", type=int, default=verifier.CASES, help="cases of each predicate")
    cases.add_argument("--seed", type=int, default=SEED)
    cases.add_argument("--publish", action="store_true", help="write docs/verifier.md")
    legs = commands.add_parser("walking", help="missions on the robot with legs: commanded, declared, measured, true")
    legs.add_argument("--missions", type=int, default=walking.MISSIONS)
    legs.add_argument("--seed", type=int, default=SEED)
    legs.add_argument("--minutes", type=float, default=None, help="no longer than this; 0 only publishes")
    legs.add_argument("--processes", type=int, default=PROCESSES)
    legs.add_argument("--log", type=Path, default=walking.LOG, help="one line for each mission that has ended")
    legs.add_argument("--publish", action="store_true", help="write docs/walking.md and docs/results/walking.json")
    loop = commands.add_parser("models", help="missions with a model as planner, reader of goals and adviser")
    loop.add_argument("--url", required=True, help="an OpenAI-compatible endpoint, up to /v1")
    loop.add_argument("--model", default="smollm2-135m-instruct-q4_1")
    loop.add_argument("--missions", type=int, default=models.MISSIONS, help="for each role")
    loop.add_argument("--only", nargs="+", choices=models.PARTS, default=models.PARTS, help="the rest stays published")
    loop.add_argument("--minutes", type=float, default=240.0, help="for all roles together, no longer than this")
    loop.add_argument("--trials", type=int, default=12, help="of the ablation of role contexts with the model")
    loop.add_argument("--timeout-s", type=float, default=120.0, dest="timeout_s", help="for one answer")
    loop.add_argument("--every", type=int, default=1, help="try one of so many texts that give orders")
    loop.add_argument("--seed", type=int, default=SEED)
    loop.add_argument("--publish", action="store_true", help="write docs/models.md and docs/results/models.json")
    again = commands.add_parser("replay", help="one mission of a simulation, with all that happened")
    again.add_argument("seed", type=int)
    check = commands.add_parser("check", help="one campaign, until the first offence")
    check.add_argument("name", choices=get_args(Check))
    check.add_argument("--missions", type=int, default=FULL["planted"])
    check.add_argument("--seed", type=int, default=SEED)
    arguments = parser.parse_args()
    match arguments.command:
        case "run":
            _run(arguments)
        case "recovery":
            recovery_steps.run(arguments)
        case "seeds":
            seeds.run(arguments)
        case "fleet":
            fleet.run(arguments)
        case "fuzz":
            fuzz.run(arguments)
        case "hostile":
            hostile.run(arguments)
        case "verifier":
            verifier.run(arguments)
        case "models":
            models.run(arguments)
        case "walking":
            walking.run(arguments)
        case "replay":
            _replay(arguments.seed)
        case _:
            _check(arguments)


def _run(arguments: argparse.Namespace) -> None:
    share = min(1.0, arguments.missions / MISSIONS)
    full = arguments.missions >= MISSIONS and arguments.minutes is None
    made = {"command": _command(arguments), "code": code_digest()}
    found = _found(arguments, share=1.0 if full or arguments.publish else share)
    result: dict[str, Any] = {"seed": arguments.seed, "command": made["command"]}
    for figures, _ in found.values():
        result |= figures
    more = f" from {arguments.first} on" if arguments.first else ""
    result["made_by"] = {f"{name}{more}": made for name in found}
    print(msgspec.json.format(msgspec.json.encode(result), indent=2).decode())
    offences = [offence for _, offences in found.values() for offence in offences]
    for offence in offences:
        print(offence, file=sys.stderr)
    if full or arguments.publish:
        publish(result)
    if offences:
        raise SystemExit(1)


def _found(arguments: argparse.Namespace, *, share: float) -> dict[str, tuple[dict[str, Any], list[str]]]:
    """Of each campaign that was asked for: its figures, and what must not be."""
    sizes = {name: max(SMALLEST[name], round(FULL[name] * share)) for name in FULL}
    points = None if share >= 1.0 else max(4, round(40 * share))
    parts: dict[str, Callable[[], tuple[dict[str, Any], list[str]]]] = {
        "planted": lambda: _planted(planted_bugs(missions=sizes["planted"], seed=arguments.seed)),
        "races": lambda: _plain(
            "races", races(answers=sizes["answers"], appends=sizes["appends"], seed=arguments.seed)
        ),
        "rivals": lambda: _plain("rivals", rival_rounds(sizes["rivals"])),
        "releases": lambda: _plain("release_races", release_races(sizes["releases"])),
        "suspended": lambda: _plain("suspended_holders", suspensions(sizes["suspensions"])),
        "damage": lambda: _plain("damage", damages()),
        "kills": lambda: _kill_report(kill_campaign(most=points, seed=arguments.seed)),
        "instants": lambda: _plain("random_kills", _instants(arguments, sizes["instants"])),
        "hard": lambda: _plain("hard_faults", hard_faults(sizes["hard"], seed=arguments.seed)),
        "hammer": lambda: _plain("hammer", hammer(sizes["hammer"], seed=arguments.seed)),
        "workers": lambda: _plain(
            "workers", worked_missions(sizes["workers"], seed=arguments.seed, minutes=arguments.minutes)
        ),
        "simulation": lambda: _simulated(arguments),
    }
    return {name: part() for name, part in parts.items() if arguments.only in ("", name)}


def _instants(arguments: argparse.Namespace, instants: int) -> RandomKillReport:
    """All kills, or those from one on, together with the published ones before it."""
    made = random_kills(
        instants - arguments.first,
        first=arguments.first,
        seed=arguments.seed,
        minutes=arguments.minutes,
        missions_at_once=arguments.processes,
        keep=arguments.keep,
    )
    if not arguments.first:
        return made
    before = msgspec.convert(stored_figures()["random_kills"], RandomKillReport)
    if before.instants != arguments.first:
        raise SystemExit(f"{before.instants} instants are published: go on with --first {before.instants}")
    return joined(before, made)


def _planted(bugs: PlantedReport) -> tuple[dict[str, Any], list[str]]:
    figures = {"total": bugs.total, "caught": bugs.caught, "seen": bugs.seen}
    return {"planted_bugs": figures}, [f"planted and missed: {name}" for name in bugs.missed]


def _kill_report(report: KillReport) -> tuple[dict[str, Any], list[str]]:
    figures, offences = _plain("kill_campaign", report)
    return {"kills": report.kills + report.second_kills, **figures}, offences


def _plain(name: str, report: Report) -> tuple[dict[str, Any], list[str]]:
    return {name: msgspec.to_builtins(report)}, list(report.offences)


def _simulated(arguments: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    seeds = seeds_of(arguments.seed, arguments.missions)
    tally = simulated_campaign(seeds, processes=arguments.processes, minutes=arguments.minutes)
    return summary(tally), [
        f"{offence}\n    python -m experiments.campaigns replay {seed}" for seed, offence in tally.offences
    ]


def _command(arguments: argparse.Namespace) -> str:
    words = [
        "python",
        "-m",
        "experiments.campaigns",
        "run",
        "--missions",
        str(arguments.missions),
        "--seed",
        str(arguments.seed),
    ]
    words += ["--processes", str(arguments.processes)]
    words += ["--only", arguments.only] if arguments.only else []
    words += ["--first", str(arguments.first)] if arguments.first else []
    words += ["--minutes", f"{arguments.minutes:g}"] if arguments.minutes is not None else []
    return shlex.join([*words, *(["--publish"] if arguments.publish else [])])


def _replay(seed: int) -> None:
    """The plan, the log and the findings of one mission; the same seed tells the same story."""
    with played(mission_plan(seed)) as mission:
        findings = judged(mission)
        print(msgspec.json.format(msgspec.json.encode(mission.plan), indent=2).decode())
        for event in mission.log:
            print(f"{event.position:5d} {event.mission_s:.2f} {event.stream} {event.body.decode()[:400]}")
        print(f"struck: {mission.struck}; ended {mission.mission.status}; {mission.course}")
        print(msgspec.json.format(msgspec.json.encode(findings), indent=2).decode())
    if findings.offences:
        raise SystemExit(1)


def _check(arguments: argparse.Namespace) -> None:
    """Until the first offence, which is printed; exit RED then: what merely breaks down has found nothing."""
    match arguments.name:
        case "simulation":
            found = next(
                (
                    t.offences[0][1]
                    for t in map(one_mission, seeds_of(arguments.seed, arguments.missions))
                    if t.offences
                ),
                "",
            )
        case "races":
            found = next(iter(races(answers=2, appends=QUICK, seed=arguments.seed).offences), "")
        case "hammer":
            hammered = hammer(QUICK_DECISIONS, seed=arguments.seed, callers=2, between_s=QUICK_KILLS_S)
            found = next(iter(hammered.offences), "")
        case "declared":
            found = next(declared_offences(seed=arguments.seed), "")
        case _:
            found = next(iter(suspensions(2).offences), "")
    if found:
        print(found)
        raise SystemExit(RED)


if __name__ == "__main__":
    main()
