"""Publishes what the fuzz campaign counted: runs of one parser with other seeds add up, and each names its code."""

from collections.abc import Mapping
from pathlib import Path

import msgspec
from msgspec import field

from experiments.campaigns.regen import ROOT
from harness.contracts.values import Value, decode

PAGE = ROOT / "docs" / "reliability.md"
RESULTS = ROOT / "docs" / "results" / "fuzz.json"
BEGIN, END = "<!-- fuzz: written by `make campaign` -->", "<!-- end of fuzz -->"


class FuzzRun(Value):
    """One run of one parser: wall seconds, files tried, read, refused with a reason, refused by a limit; offences."""

    seed: int
    seconds: float
    code: str
    tried: int
    read: int
    refused: int
    limited: int
    offences: tuple[str, ...] = ()


class FuzzResults(Value):
    """What is published, by parser. The same seed tries the same files, so that it counts once, as it ran last."""

    parsers: dict[str, tuple[FuzzRun, ...]] = field(default_factory=dict)

    def newer(self, runs: Mapping[str, FuzzRun]) -> "FuzzResults":
        """With these runs."""
        parsers = dict(self.parsers)
        for name, run in runs.items():
            parsers[name] = (*(one for one in parsers.get(name, ()) if one.seed != run.seed), run)
        return FuzzResults(parsers=parsers)


def publish(runs: Mapping[str, FuzzRun], *, page: Path = PAGE, results: Path = RESULTS) -> None:
    """Write the JSON file and the part of the page between its two marks. Raises ValueError without the marks."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    earlier = decode(results.read_bytes(), FuzzResults) if results.exists() else FuzzResults()
    made = earlier.newer(runs)
    results.write_bytes(msgspec.json.format(msgspec.json.encode(made), indent=1) + b"\n")
    page.write_text(f"{before}{BEGIN}\n\n" + "\n".join(table(made)) + f"\n\n{END}{after}", encoding="utf-8")


def table(made: FuzzResults) -> list[str]:
    """One row for each parser, in Markdown."""
    return [
        "| parser | minutes | files | read | refused with a reason | refused by a limit | offences | seeds | on code |",
        "|---|---:|---:|---:|---:|---:|---:|---|---|",
        *(_row(name, runs) for name, runs in sorted(made.parsers.items())),
    ]


def _row(name: str, runs: tuple[FuzzRun, ...]) -> str:
    counts = [
        sum(counted) for counted in zip(*((one.tried, one.read, one.refused, one.limited) for one in runs), strict=True)
    ]
    cells = [f"{sum(one.seconds for one in runs) / 60.0:.1f}", *(f"{count:,}" for count in counts)]
    codes = dict.fromkeys(f"`{one.code[:12]}`" for one in runs)
    seeds = ", ".join(str(one.seed) for one in runs)
    offences = sum(len(one.offences) for one in runs)
    return f"| {name} | {' | '.join(cells)} | {offences} | {seeds} | {' '.join(codes)} |"
