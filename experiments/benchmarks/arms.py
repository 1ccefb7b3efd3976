"""Runs the arms of a benchmark side by side: each system is its own process, and only the one whose turn it is runs.

The order of turns shifts every round, so that a slow minute of the machine affects every arm.
"""

import json
import os
import selectors
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BENCH = ROOT / ".bench"
PEERS = BENCH / "peers" / "bin" / "python"
LONGEST_TURN_S = 300.0


class ArmFailed(Exception):
    """A process of the benchmark ended or stopped answering; the message is its last output."""


@dataclass(frozen=True)
class Recipe:
    """How to start an arm: a module or a file, its arguments after the folder, and whether it runs beside the peers.

    `checkout`: the sources that it imports, such as those of an earlier commit.
    """

    key: str
    module: str
    arguments: tuple[str, ...] = ()
    peer: bool = False
    checkout: Path = ROOT

    def command(self, folder: Path) -> list[str]:
        """What is started. A file is started by its path, so that it can drive a checkout that does not have it."""
        python = PEERS if self.peer else Path(sys.executable)
        started = (self.module,) if self.module.endswith(".py") else ("-m", self.module)
        return [str(python), *started, str(folder), *self.arguments]


class RunningArm:
    """A running arm. Between turns it is stopped, its background threads included."""

    def __init__(self, recipe: Recipe, folder: Path) -> None:
        self._errors = (folder / "errors.log").open("w+b")
        self._process = subprocess.Popen(
            recipe.command(folder),
            cwd=recipe.checkout,
            env={**os.environ, "PYTHONPATH": str(recipe.checkout)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )
        try:
            self.said = self._line()
        except ArmFailed:
            self.close()
            raise
        self._pause()

    def turn(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """One turn of this arm. Raises ArmFailed."""
        self._process.send_signal(signal.SIGCONT)
        if self._process.stdin is None:
            raise ArmFailed("the arm takes no requests")
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise self._failed() from None
        reply = self._line()
        self._pause()
        return reply

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            if stream is not None:
                stream.close()

    def _pause(self) -> None:
        self._process.send_signal(signal.SIGSTOP)

    def _line(self) -> dict[str, Any]:
        if self._process.stdout is None:
            raise ArmFailed("the arm says nothing")
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            if not selector.select(LONGEST_TURN_S):
                raise ArmFailed(f"no answer within {LONGEST_TURN_S:.0f} s")
        line = self._process.stdout.readline()
        if not line:
            raise self._failed()
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _failed(self) -> ArmFailed:
        self._errors.seek(0)
        return ArmFailed(self._errors.read().decode(errors="replace")[-2000:] or "the arm ended without a word")


@contextmanager
def arms(recipes: Sequence[Recipe]) -> Iterator[dict[str, RunningArm]]:
    """All arms that can be started, by key; a peer that cannot be started is reported. Ours and the baseline
    must start.
    """
    BENCH.mkdir(exist_ok=True)
    with ExitStack() as stack:
        started: dict[str, RunningArm] = {}
        for recipe in recipes:
            folder = Path(stack.enter_context(TemporaryDirectory(dir=BENCH)))
            try:
                if recipe.peer and not PEERS.exists():
                    raise ArmFailed("its environment .bench/peers is not there; run `make bench`")
                arm = RunningArm(recipe, folder)
            except ArmFailed as why:
                if not recipe.peer:
                    raise
                print(f"MISSING: {recipe.key}: {why}", file=sys.stderr, flush=True)
                continue
            stack.callback(arm.close)
            started[recipe.key] = arm
        yield started


def rounds(
    started: Mapping[str, RunningArm], requests: Mapping[str, Sequence[Mapping[str, Any]]], *, count: int
) -> dict[tuple[str, int], list[dict[str, Any]]]:
    """Replies by (arm, number of its request). In each round every arm answers each of its requests once."""
    cells = [(key, number) for key in started for number in range(len(requests[key]))]
    replies: dict[tuple[str, int], list[dict[str, Any]]] = {cell: [] for cell in cells}
    for turn in range(count):
        shift = turn * len(cells) // count
        for key, number in (*cells[shift:], *cells[:shift]):
            replies[key, number].append(started[key].turn(requests[key][number]))
    return replies


def load() -> float:
    """The machine's load over the last minute."""
    return os.getloadavg()[0]
