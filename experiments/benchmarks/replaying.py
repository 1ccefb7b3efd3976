"""An MCAP recording replayed end to end by `regen mission replay`, against its own length, and the memory that takes.

    python -m experiments.benchmarks.replaying [--rounds 5] [FILE.mcap ...]

The project's own recording, and those in REGEN_DATA (default ../shared/data) where they are there. Each file is also
cut to a quarter of its length: memory that is flat is the same for both. Files are copied below .bench, never kept.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from mcap.reader import make_reader
from mcap.writer import Writer

from experiments.benchmarks.arms import BENCH, ROOT
from experiments.benchmarks.ours import PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions

OWN = ROOT / "tests" / "fixtures" / "warehouse-inspection.mcap"
REAL = Path("derived/husky_test1.mcap")
QUARTER = 0.25
LONGEST_S = 300.0


def measure(*, files: Sequence[Path], count: int) -> list[Figure]:
    """One row per recording: how many times faster than real time, with peak memory in the detail."""
    BENCH.mkdir(exist_ok=True)
    found = []
    for path in files:
        with TemporaryDirectory(dir=BENCH) as name:
            folder = Path(name)
            quarter = _cut(path, folder / "quarter.mcap", share=QUARTER)
            whole, part = [], []
            for _ in range(count):
                whole.append(_replay(path, folder))
                part.append(_replay(quarter, folder))
        length_s, wall_s = _length_s(path), median(wall for wall, _ in whole)
        found.append(
            figure(
                f"replay an MCAP recording, {path.stem}",
                unit="x real time",
                ours=length_s / wall_s,
                n=count,
                environment={
                    "versions": versions((*PACKAGES, "mcap", "rosbags")),
                    "durability": {"ours": "SQLite, FULL"},
                },
                targets=(Target(">= 50x real time, end to end", 50.0, "higher"),),
                detail={
                    "length_s": round(length_s, 1),
                    "wall_s": round(wall_s, 2),
                    "bytes": path.stat().st_size,
                    "peak_mib": round(median(peak for _, peak in whole), 1),
                    "peak_mib_of_a_quarter": round(median(peak for _, peak in part), 1),
                },
            )
        )
    return found


def _replay(path: Path, folder: Path) -> tuple[float, float]:
    """Seconds of the whole command, start of Python included, and its peak memory in MiB."""
    with TemporaryDirectory(dir=folder) as data, (Path(data) / "said").open("w+b") as output:
        command = [str(Path(sys.executable).parent / "regen"), "mission", "replay", str(path), "--data", data, "--json"]
        start_s = time.perf_counter()
        process = subprocess.Popen(command, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(process.pid, 0)
        wall_s = time.perf_counter() - start_s
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in (0, 1) or wall_s > LONGEST_S:
            output.seek(0)
            raise RuntimeError(f"the replay of {path} ended {process.returncode}: {output.read()[-500:]!r}")
        return wall_s, used.ru_maxrss / 1024


def _length_s(path: Path) -> float:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        raise RuntimeError(f"{path} has no statistics")
    return (summary.statistics.message_end_time - summary.statistics.message_start_time) / 1e9


def _cut(path: Path, to: Path, *, share: float) -> Path:
    """The first part of a recording, message by message."""
    with path.open("rb") as source, to.open("wb") as target:
        reader = make_reader(source)
        header, summary = reader.get_header(), reader.get_summary()
        if summary is None or summary.statistics is None:
            raise RuntimeError(f"{path} has no statistics")
        first = summary.statistics.message_start_time
        until = first + int(share * (summary.statistics.message_end_time - first))
        writer = Writer(target)
        writer.start(profile=header.profile, library="regen-bench")
        channels: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(ending_before=until):
            if channel.id not in channels:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data) if schema else 0
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_id, channel.metadata
                )
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]
    return to


def recordings() -> list[Path]:
    """The project's own recording, and the real ones where they exist; missing ones are reported."""
    real = Path(os.environ.get("REGEN_DATA", ROOT.parent / "shared" / "data")) / REAL
    for path in (OWN, real):
        if not path.exists():
            print(f"MISSING: recording {path.name}", file=sys.stderr)
    return [path for path in (OWN, real) if path.exists()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    figures = measure(files=options.files or recordings(), count=options.rounds)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
