"""`make run` in a folder that holds nothing but the sources, to the first page, on a warm package cache.

    python -m experiments.benchmarks.first_page [--rounds 2]

The sources are copied below .bench as git would clone them. One round more than asked runs first, to warm the cache.
"""

import argparse
import os
import re
import shutil
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from experiments.benchmarks.arms import BENCH, ROOT
from experiments.benchmarks.ours import PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions

LONGEST_S = 300.0
LINK = re.compile(rb"http://127\.0\.0\.1:\d+/\S+")


def measure(*, count: int) -> list[Figure]:
    """One row: seconds from `make run` to the sign-in link's page."""
    times = [_first_page_s() for _ in range(count + 1)]
    return [
        figure(
            "make run to first page, warm package cache",
            unit="s",
            ours=median(times[1:]),
            n=count,
            environment={"versions": versions((*PACKAGES, "pip")), "durability": {"ours": "SQLite, FULL"}},
            targets=(Target("<= 30 s", 30.0, "lower"),),
            detail={"first_s": round(times[0], 1)},
        )
    ]


def _first_page_s() -> float:
    BENCH.mkdir(exist_ok=True)
    with TemporaryDirectory(dir=BENCH) as name:
        folder = Path(name) / "clone"
        _clone(folder)
        log = Path(name) / "said"
        with log.open("wb") as output:
            start_s = time.perf_counter()
            process = subprocess.Popen(
                ["make", "run"],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env=os.environ | {"REGEN_PORT": str(_free_port())},
            )
            try:
                _wait_for_page(process, log, until=start_s + LONGEST_S)
                return time.perf_counter() - start_s
            finally:
                os.killpg(process.pid, signal.SIGTERM)
                process.wait(timeout=30)


def _clone(folder: Path) -> None:
    """The files that git tracks, and no others."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout
    for path in filter(None, listed.decode().split("\0")):
        if (ROOT / path).is_file():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / path, folder / path)


def _wait_for_page(process: subprocess.Popen[bytes], output: Path, *, until: float) -> None:
    while time.perf_counter() < until:
        link = LINK.search(output.read_bytes())
        if link is not None and _answers(link.group().decode()):
            return
        if process.poll() is not None:
            break
        time.sleep(0.05)
    raise RuntimeError(f"`make run` showed no page: {output.read_bytes()[-1000:].decode(errors='replace')}")


def _answers(link: str) -> bool:
    try:
        with urllib.request.urlopen(link, timeout=5) as answer:
            return bool(answer.status == 200 and answer.read())
    except (urllib.error.URLError, OSError):
        return False


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=2)
    options = parser.parse_args()
    figures = measure(count=options.rounds)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
