"""Runs `regen` as a person would, in a process of its own."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KINEMATIC = ("--speed", "0", "--fidelity", "kinematic", "--json")
LONGEST_S = 110.0


def regen(*words: object, before: Callable[[], None] | None = None, **changes: str) -> subprocess.CompletedProcess[str]:
    """One call of the command line, run to its end. `before` runs in the child before the command begins."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("REGEN_")} | changes
    return subprocess.run(
        [sys.executable, "-P", "-m", "app.cli.main", *(str(word) for word in words)],
        cwd=ROOT,
        env={**environment, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
        preexec_fn=before,
    )
