"""Running `regen` as a person would, in processes of its own."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

KEY = "REGEN_SNAPSHOT_KEY_FILE"
ROOT = Path(__file__).resolve().parents[2]


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "app.cli.main", *(str(word) for word in words)]


def environment(**changes: str) -> dict[str, str]:
    """Without settings of the person who runs the tests; snapshots are sealed with the tests' own key."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("REGEN_") or name == KEY}
    return kept | changes


def regen(*words: object, **changes: str) -> subprocess.CompletedProcess[str]:
    """One call of the command line, waited for."""
    return subprocess.run(
        command(*words), cwd=ROOT, env=environment(**changes), capture_output=True, text=True, timeout=200, check=False
    )


def start(*words: object, **changes: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(*words),
        cwd=ROOT,
        env=environment(**changes),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def answer(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """The JSON object it printed; the error output if it printed none."""
    assert done.stdout.strip(), done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def until(true: Callable[[], bool], *, seconds: float, what: str) -> None:
    """Wait for something another process does."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, f"{what} did not happen within {seconds} s"
        time.sleep(0.02)


def truth(data: Path) -> list[dict[str, Any]]:
    """What the robot's process wrote for an adjudicator, every mission, in order of time; whole lines only."""
    lines: list[dict[str, Any]] = []
    for file in sorted((data / "robots" / "vbot-1" / "truth").glob("*.jsonl")):
        lines += [json.loads(line) for line in file.read_text().split("\n")[:-1]]
    return sorted(lines, key=lambda line: line["at_s"])


def starts(data: Path) -> list[dict[str, Any]]:
    """The robot's own start journal."""
    file = data / "robots" / "vbot-1" / "starts.jsonl"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
