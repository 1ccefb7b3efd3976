"""Starts `regen up` on a new data folder, as a person would, and ends it; nothing of it runs in this process."""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STARTS_WITHIN_S, ENDS_WITHIN_S = 300.0, 30.0
LINK = re.compile(r"Sign in once: (\S+)")


@dataclass(frozen=True)
class ServedConsole:
    """A console that answers: its one-time link, and how long it took from the command to the link."""

    link: str
    address: str
    started_s: float


@contextmanager
def served_console(options: Sequence[str]) -> Iterator[ServedConsole]:
    """`regen up` with these options until the block ends."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("REGEN_")}
    command = [sys.executable, "-P", "-m", "app.cli.main", "up", "--port", "0", *options]
    with tempfile.TemporaryDirectory() as folder, (Path(folder) / "output").open("w+") as output:
        began_s = time.monotonic()
        process = subprocess.Popen(
            [*command, "--data", str(Path(folder) / "var")],
            cwd=ROOT,
            env={**environment, "PYTHONPATH": str(ROOT)},
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            link = _link(process, Path(output.name), until_s=began_s + STARTS_WITHIN_S)
            yield ServedConsole(link, link.partition("/account/")[0], time.monotonic() - began_s)
        finally:
            process.terminate()
            try:
                process.wait(ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _link(process: subprocess.Popen[bytes], output: Path, *, until_s: float) -> str:
    while time.monotonic() < until_s and process.poll() is None:
        if found := LINK.search(output.read_text()):
            return found[1]
        time.sleep(0.1)
    raise SystemExit(f"The console gave no link:\n{output.read_text()}")
