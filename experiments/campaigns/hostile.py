"""Runs the whole hostile provider kit and publishes its counts: `python -m experiments.campaigns hostile --publish`."""

import argparse
import sys
from pathlib import Path

from experiments.campaigns.regen import ROOT
from harness.conformance.hostile.kit import MOST_MIB, LieReport, chosen, fuzzed
from harness.conformance.hostile.missions import MissionUnderLie, met
from simulator.in_process import SIMULATOR

PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- hostile robots: written by `make campaign` -->", "<!-- end of hostile robots -->"
COMMAND = "regen provider fuzz --builtin --json"


def run(arguments: argparse.Namespace) -> None:
    """Every lie, or those that are named. Exit 1 if something happened that must not happen."""
    result = fuzzed(chosen(arguments.modes), lambda mode: met(mode, SIMULATOR, seed=arguments.seed), watch=_tell)
    print(*counts(result), sep="\n")
    if arguments.publish:
        publish(result, seed=arguments.seed)
    if not result.ok:
        raise SystemExit(1)


def publish(result: LieReport, *, seed: int, page: Path = PAGE) -> None:
    """Replace the part of the page between its two marks. Raises ValueError without the marks."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    rows = [
        f"| {one.text} | {one.ended.replace('_', ' ')} | {len(one.committed)} | {one.motions} |" for one in result.met
    ]
    made = [
        *counts(result),
        "",
        "| lie | mission ended | stages accepted | motions |",
        "|---|---|---:|---:|",
        *rows,
        "",
        f"Made by `{COMMAND} --seed {seed}`. Nobody can see through: {', '.join(result.undetectable)}.",
    ]
    page.write_text(f"{before}{BEGIN}\n\n" + "\n".join(made) + f"\n\n{END}{after}", encoding="utf-8")


def counts(result: LieReport) -> list[str]:
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
    ]


def _tell(one: MissionUnderLie) -> None:
    print(f"{'ok' if one.harmless else 'WRONG':<6} {one.mode:<42} {one.ended}", file=sys.stderr, flush=True)
