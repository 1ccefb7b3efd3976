"""Runs the whole hostile provider kit and publishes its counts: `python -m experiments.campaigns hostile --publish`."""

import argparse
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
from msgspec import field
from msgspec.structs import replace

from experiments.campaigns.code import code_digest
from experiments.campaigns.hostile_console import met_under_console
from experiments.campaigns.regen import ROOT
from harness.bootstrap import simulated
from harness.conformance.hostile.kit import MODES, MOST_MIB, LieReport, chosen, counted, fuzzed
from harness.conformance.hostile.lies import WHOLE, Mode
from harness.conformance.hostile.missions import KIT, ROBOT, MissionUnderLie, met, met_at
from harness.contracts.events import PacketRetained, VerdictRecorded
from harness.contracts.reasons import plain
from harness.contracts.values import Value, decode
from harness.gate.decide import DECIDER
from harness.provider_protocol.wire import Attachment
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

PAGE = ROOT / "docs" / "reliability.md"
RESULTS = ROOT / "docs" / "results" / "hostile.json"
BEGIN, END = "<!-- hostile robots: written by `make campaign` -->", "<!-- end of hostile robots -->"
COMMAND = "python -m experiments.campaigns hostile"
COPIES = ("image_of_earlier_capture", "image_copies_earlier", "images_are_copies")
"""The reasons for which images are taken for copies."""


PLACES = ("process", "address", "console")
"""Where the kit stands: in one process with the robot, before a simulator at an address, and under `regen up`."""
AT_ONCE = 6
"""How many robots one console has; every one lies in another way."""


def run(arguments: argparse.Namespace) -> None:
    """Every lie, or those that are named, at every place, or at those. Exit 1 if something happened that must not."""
    modes, places = chosen(arguments.modes), tuple(arguments.at or PLACES)
    made_by, made = _made_by(arguments), HostileResults()
    for place in PLACES:
        if place in places:
            report = _met(place, modes, seed=arguments.seed)
            made = made.with_run(place, KitRun(**made_by, report=report))
    if least := 0 if arguments.modes else arguments.second_looks:
        made = replace(made, looks=LooksResult(**made_by, looks=second_looks(least, seed=arguments.seed)))
    print(*counts(made), sep="\n")
    if arguments.publish:
        publish(made)
    refused = made.looks.looks.refused if made.looks is not None else 0
    if refused or not all(one.report.ok for one in made.places.values()):
        raise SystemExit(1)


def _made_by(arguments: argparse.Namespace) -> dict[str, str]:
    """The command without what it says about publishing, and the code that it tries."""
    words = [*COMMAND.split(), *arguments.modes, "--seed", str(arguments.seed)]
    words += [word for place in arguments.at or () for word in ("--at", place)]
    return {"command": shlex.join([*words, "--second-looks", str(arguments.second_looks)]), "code": code_digest()}


def _met(place: str, modes: Sequence[Mode], *, seed: int) -> LieReport:
    match place:
        case "process":
            return fuzzed(modes, lambda mode: met(mode, SIMULATOR, seed=seed), watch=_tell)
        case "address":
            with simulator_at_an_address(seed=seed) as there:
                return fuzzed(
                    modes,
                    lambda mode: met_at(mode, there.url, there.token, seed=seed, folder=there.folder),
                    watch=_tell,
                )
        case _:
            return met_under_console(modes, at_once=AT_ONCE, seed=seed, watch=_tell)


@dataclass(frozen=True)
class SimulatorAtAddress:
    """A simulator in lockstep in a process of its own, and the folder in which it writes the truth."""

    url: str
    token: str
    folder: Path


@contextmanager
def simulator_at_an_address(*, seed: int) -> Iterator[SimulatorAtAddress]:
    """Start one; it ends with the block."""
    with TemporaryDirectory(prefix="simulator-") as folder:
        words = ["--dir", folder, "--port", "0", "--speed", "0", "--fidelity", "kinematic", "--seed", str(seed)]
        child = subprocess.Popen([sys.executable, "-m", "simulator", *words], cwd=ROOT, stdout=subprocess.PIPE)
        try:
            assert child.stdout is not None
            with child.stdout as output:
                found = decode(output.readline(), Attachment)
            yield SimulatorAtAddress(found.base_url, found.token, Path(folder))
        finally:
            child.terminate()
            child.wait()


class SecondLooks(Value):
    """Honest images of one place that one log holds, and the missions of which one was taken for a copy."""

    missions: int
    images: int
    refused: int


class KitRun(Value):
    """Lies that were played at one place, and the run that made them."""

    command: str
    code: str
    report: LieReport

    def without(self, modes: frozenset[str]) -> "KitRun":
        """Without lies that a newer run played."""
        left = tuple(one for one in self.report.met if one.mode not in modes)
        return replace(self, report=counted(left, peak_mib=self.report.peak_mib))


class PlaceResult(Value):
    """The newest runs at one place: each lie is in the newest one that played it."""

    runs: tuple[KitRun, ...] = ()

    @property
    def report(self) -> LieReport:
        """The counts of all runs together."""
        met = {one.mode: one for run in self.runs for one in run.report.met}
        known = [met[mode.name] for mode in MODES if mode.name in met]
        return counted(known, peak_mib=max((run.report.peak_mib for run in self.runs), default=0))

    def newer(self, other: "PlaceResult") -> "PlaceResult":
        """With the other's runs, whose lies count anew. A lie that is no longer in the kit is left out."""
        again = frozenset(one.mode for one in other.report.met)
        gone = frozenset(one.mode for run in self.runs for one in run.report.met) - {mode.name for mode in MODES}
        left = (run.without(again | gone) for run in self.runs)
        return PlaceResult(runs=(*(run for run in left if run.report.met), *other.runs))


class LooksResult(Value):
    """The honest second looks, and the run that made them."""

    command: str
    code: str
    looks: SecondLooks


class HostileResults(Value):
    """What is published: of each lie at each place the newest run."""

    places: dict[str, PlaceResult] = field(default_factory=dict)
    looks: LooksResult | None = None

    def with_run(self, place: str, run: KitRun) -> "HostileResults":
        """With another run at this place, in the order of the places."""
        return self._with(place, PlaceResult(runs=(run,)))

    def _with(self, place: str, result: PlaceResult) -> "HostileResults":
        places = {**self.places, place: self.places.get(place, PlaceResult()).newer(result)}
        return replace(self, places={name: places[name] for name in PLACES if name in places})

    def newer(self, other: "HostileResults") -> "HostileResults":
        """With what the other run made anew."""
        made = self
        for place, result in other.places.items():
            made = made._with(place, result)
        return replace(made, looks=other.looks or made.looks)


def second_looks(least: int, *, seed: int) -> SecondLooks:
    """Honest inspections of one place by one robot, one after the other, until so many images were taken."""
    missions = images = refused = 0
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=seed) as harness:
        while images < least:
            before = {one.mission_id for one in harness.runtime.missions()}
            harness.runtime.start(Start(actor=KIT, robot_id=ROBOT, template=WHOLE, seed=seed + missions))
            (mission_id,) = {one.mission_id for one in harness.runtime.missions()} - before
            harness.supervisor.run(mission_id)
            events = [DECIDER.codec.decode(event) for event in harness.runtime.events(mission_id)]
            packets = [event.packet for event in events if isinstance(event, PacketRetained)]
            verdicts = [event.verdict for event in events if isinstance(event, VerdictRecorded)]
            missions += 1
            images += sum(one.kind == "image" for packet in packets for one in packet.after)
            refused += any(code in plain(one.reason) for one in verdicts for code in COPIES)
    return SecondLooks(missions=missions, images=images, refused=refused)


def publish(made: HostileResults, *, page: Path = PAGE, results: Path = RESULTS) -> None:
    """Replace the part of the page between its two marks, and the figures; a place that was not tried stays as it is.

    Raises ValueError without the marks.
    """
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    if results.exists():
        made = decode(results.read_bytes(), HostileResults).newer(made)
    results.write_bytes(msgspec.json.format(msgspec.json.encode(made), indent=1) + b"\n")
    reports = {place: one.report for place, one in made.places.items()}
    undetectable = tuple(mode.name for mode in MODES if mode.undetectable)
    lines = [
        *counts(made),
        "",
        *_each(reports),
        "",
        "In each cell: how the mission ended, stages accepted / motions begun. Nobody can see through: "
        f"{', '.join(undetectable)}.",
        "",
        "| made by | lies | on code |",
        "|---|---:|---|",
        *(
            f"| {TITLES[place]}: `{run.command}` | {run.report.missions} | `{run.code[:12]}` |"
            for place, one in made.places.items()
            for run in one.runs
        ),
        *([f"| second looks: `{made.looks.command}` | | `{made.looks.code[:12]}` |"] if made.looks else []),
    ]
    page.write_text(f"{before}{BEGIN}\n\n" + "\n".join(lines) + f"\n\n{END}{after}", encoding="utf-8")


def _each(found: Mapping[str, LieReport]) -> Iterator[str]:
    """A table with how each lie's mission ended at each place, with the stages accepted / the motions begun."""
    yield "| lie | " + " | ".join(TITLES[place] for place in found) + " |"
    yield "|---|" + "---|" * len(found)
    met_at_place = {place: {one.mode: one for one in report.met} for place, report in found.items()}
    for mode in MODES:
        several = [met_there.get(mode.name) for met_there in met_at_place.values()]
        if any(several):
            yield f"| {mode.text} | {' | '.join(map(_cell, several))} |"


def _cell(one: MissionUnderLie | None) -> str:
    return f"{one.ended.replace('_', ' ')}, {len(one.committed)} / {one.motions}" if one is not None else "not run"


TITLES = {"process": "one process", "address": "a simulator at an address", "console": "`regen up`"}


def counts(made: HostileResults) -> list[str]:
    """The counts as a table in Markdown."""
    found = {place: one.report for place, one in made.places.items()}
    rows: tuple[tuple[str, Callable[[LieReport], object]], ...] = (
        ("missions, each under one lie", lambda one: one.missions),
        ("of these, accepted stages compared with the simulated truth", lambda one: one.against_truth),
        ("false completions while one required source was honest", lambda one: one.false_completions),
        (
            "second motions while an earlier one was of unknown outcome or under way",
            lambda one: one.second_motions,
        ),
        ("missions that hang", lambda one: one.hangs),
        ("untyped errors", lambda one: one.tracebacks),
        ("leases that stayed held without a holder", lambda one: one.held),
        (f"memory at the peak, of at most {MOST_MIB} MiB", lambda one: f"{one.peak_mib} MiB"),
        ("completions where every source was forged alike (epistemic)", lambda one: one.epistemic),
    )
    return [
        "| what must not happen | " + " | ".join(TITLES[place] for place in found) + " |",
        "|---|" + "---:|" * len(found),
        *(f"| {title} | {' | '.join(str(of(one)) for one in found.values())} |" for title, of in rows),
        *(_looks(made.looks.looks) if made.looks is not None else ()),
    ]


def _looks(looks: SecondLooks) -> tuple[str, str]:
    missions = f"Of {looks.missions} honest missions in one log, with {looks.images} images of one place, "
    return "", f"{missions}{looks.refused} had an image taken for a copy."


def _tell(one: MissionUnderLie) -> None:
    print(f"{'ok' if one.harmless else 'WRONG':<6} {one.mode:<42} {one.ended}", file=sys.stderr, flush=True)
