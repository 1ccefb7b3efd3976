"""Runs the whole hostile provider kit and publishes its counts: `python -m experiments.campaigns hostile --publish`."""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from experiments.campaigns.regen import ROOT
from harness.bootstrap import simulated
from harness.conformance.hostile.kit import MOST_MIB, LieReport, chosen, fuzzed
from harness.conformance.hostile.lies import WHOLE
from harness.conformance.hostile.missions import KIT, ROBOT, MissionUnderLie, met
from harness.contracts.events import PacketRetained, VerdictRecorded
from harness.contracts.reasons import plain
from harness.gate.decide import DECIDER
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- hostile robots: written by `make campaign` -->", "<!-- end of hostile robots -->"
COMMAND = "python -m experiments.campaigns hostile --publish"
COPIES = ("image_of_earlier_capture", "image_copies_earlier", "images_are_copies")
"""The reasons for which images are taken for copies."""


def run(arguments: argparse.Namespace) -> None:
    """Every lie, or those that are named. Exit 1 if something happened that must not happen."""
    result = fuzzed(chosen(arguments.modes), lambda mode: met(mode, SIMULATOR, seed=arguments.seed), watch=_tell)
    looks = second_looks(0 if arguments.modes else arguments.second_looks, seed=arguments.seed)
    print(*counts(result, looks), sep="\n")
    if arguments.publish:
        publish(result, looks, seed=arguments.seed)
    if not result.ok or looks.refused:
        raise SystemExit(1)


@dataclass(frozen=True)
class SecondLooks:
    """Honest images of one place that one log holds, and the missions of which one was taken for a copy."""

    missions: int
    images: int
    refused: int


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


def publish(result: LieReport, looks: SecondLooks, *, seed: int, page: Path = PAGE) -> None:
    """Replace the part of the page between its two marks. Raises ValueError without the marks."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    rows = [
        f"| {one.text} | {one.ended.replace('_', ' ')} | {len(one.committed)} | {one.motions} |" for one in result.met
    ]
    made = [
        *counts(result, looks),
        "",
        "| lie | mission ended | stages accepted | motions |",
        "|---|---|---:|---:|",
        *rows,
        "",
        f"Made by `{COMMAND} --seed {seed}`. Nobody can see through: {', '.join(result.undetectable)}.",
    ]
    page.write_text(f"{before}{BEGIN}\n\n" + "\n".join(made) + f"\n\n{END}{after}", encoding="utf-8")


def counts(result: LieReport, looks: SecondLooks) -> list[str]:
    """The counts as a table in Markdown."""
    return [
        "| what must not happen | count |",
        "|---|---:|",
        f"| missions, each under one lie | {result.missions} |",
        f"| false completions while one required source was honest | {result.false_completions} |",
        f"| second motions while an earlier one was of unknown outcome or under way | {result.second_motions} |",
        f"| missions that hang | {result.hangs} |",
        f"| untyped errors | {result.tracebacks} |",
        f"| leases that stayed held without a holder | {result.held} |",
        f"| memory at the peak, of at most {MOST_MIB} MiB | {result.peak_mib} MiB |",
        f"| completions where every source was forged alike (epistemic) | {result.epistemic} |",
        f"| honest missions of which an image was taken for a copy, of {looks.missions} in one log, with "
        f"{looks.images} images of one place | {looks.refused} |",
    ]


def _tell(one: MissionUnderLie) -> None:
    print(f"{'ok' if one.harmless else 'WRONG':<6} {one.mode:<42} {one.ended}", file=sys.stderr, flush=True)
