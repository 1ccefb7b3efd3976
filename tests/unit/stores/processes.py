"""Starting the programs of `children.py` from tests."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PROGRAMS = Path(__file__).with_name("children.py")


@contextmanager
def running(*arguments: str) -> "Iterator[subprocess.Popen[str]]":
    """The program, its output as text lines; killed at the latest when the block ends."""
    with subprocess.Popen(
        [sys.executable, str(PROGRAMS), *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    ) as child:
        try:
            yield child
        finally:
            child.kill()


def lines(child: "subprocess.Popen[str]", number: int) -> list[str]:
    """The next `number` lines the child prints; fewer if it ends."""
    assert child.stdout is not None
    return [line.strip() for _, line in zip(range(number), child.stdout, strict=False)]


def kill(child: "subprocess.Popen[str]") -> list[str]:
    """SIGKILL the child, wait for it, and return the lines it had still printed."""
    assert child.stdout is not None
    child.kill()
    rest = child.stdout.read().split()
    child.wait(timeout=60)
    return rest
