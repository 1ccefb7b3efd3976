"""Running `regen` as a person would, in processes of its own.

They are forked from a server that has the command line's modules loaded: loading them anew takes longer than most
commands. `command` is for what must be a fresh interpreter.
"""

import atexit
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import Any

from app.cli.main import main

KEY = "REGEN_SNAPSHOT_KEY_FILE"
LONGEST_S = 200.0
ROOT = Path(__file__).resolve().parents[2]


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "app.cli.main", *(str(word) for word in words)]


def environment(**changes: str) -> dict[str, str]:
    """Without settings of the person who runs the tests; snapshots are sealed with the tests' own key."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("REGEN_") or name == KEY}
    return kept | changes


class RunningCommand:
    """A call of the command line that is under way. Its exit code is negative for a signal."""

    def __init__(self, words: tuple[str, ...], changed: dict[str, str]) -> None:
        self.words = words
        self._folder = tempfile.TemporaryDirectory()
        self._process = _forks().Process(target=_called, args=(words, changed, self._folder.name))
        self._process.start()
        assert self._process.pid is not None
        self.pid = self._process.pid

    def communicate(self, timeout: float = LONGEST_S) -> tuple[str, str]:
        """Waits for its end: standard output and standard error."""
        self._process.join(timeout)
        if self._process.exitcode is None:
            os.kill(self.pid, signal.SIGKILL)
            self._process.join()
            raise subprocess.TimeoutExpired(list(self.words), timeout)
        self.returncode = self._process.exitcode
        self._process.close()
        written = [(Path(self._folder.name) / name).read_text(encoding="utf-8") for name in ("out", "err")]
        self._folder.cleanup()
        return written[0], written[1]


@cache
def _forks() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    commands = [f"app.cli.{file.stem}" for file in (ROOT / "app" / "cli").glob("[a-z]*.py")]
    context.set_forkserver_preload([*commands, "tests.integration.preloaded"])
    return context


def _called(words: tuple[str, ...], changed: dict[str, str], folder: str) -> None:
    """Becomes the command: in the child."""
    os.chdir(ROOT)
    os.environ.clear()
    os.environ.update(changed)
    for number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(f"{folder}/{name}", os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
    sys.argv = ["regen", *words]
    try:
        main()
    finally:
        atexit._run_exitfuncs()


def start(*words: object, **changes: str) -> RunningCommand:
    return RunningCommand(tuple(map(str, words)), environment(**changes))


def regen(*words: object, **changes: str) -> subprocess.CompletedProcess[str]:
    """One call of the command line, waited for."""
    running = start(*words, **changes)
    out, err = running.communicate()
    return subprocess.CompletedProcess(list(running.words), running.returncode, out, err)


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
        time.sleep(0.05)


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
