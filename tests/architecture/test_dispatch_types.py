"""`make types` finds a command to a provider outside the supervisor by its type, whatever the receiver is called."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT

HEAD = """
from collections.abc import Callable
from typing import Protocol

from harness.contracts.ports import Provider, Robot
from harness.contracts.protocol import InvocationReport, StartRequest
"""
AROUND = {
    "called anything": "def f(teapot: Provider, r: StartRequest) -> None:\n    teapot.start(r)",
    "from a list": "def f(robot: Robot, r: StartRequest) -> None:\n    [x.start(r) for x in robot.providers()]",
    "from a dictionary": "def f(d: dict[str, Provider], h: str) -> None:\n    d['a'].stop(h)",
    "made by a function": "def f(made: Callable[[], Provider], h: str) -> None:\n    made().resume(h)",
    "under another name": "def f(a: Provider, h: str) -> None:\n    b = a\n    c = b\n    c.keepalive(h)",
    "a type of its own": "class Mine(Provider, Protocol): ...\n\ndef f(m: Mine, h: str) -> None:\n    m.stop(h)",
    "either of two": "def f(m: Provider | None, h: str) -> None:\n    if m:\n        m.stop(h)",
    "kept in an object": "class A:\n    def __init__(self, t: Provider) -> None:\n        self.t = t\n"
    "    def f(self, h: str) -> None:\n        self.t.stop(h)",
}
INNOCENT = """
from threading import Thread

def f(t: Thread, p: Provider, h: str) -> InvocationReport:
    t.start()
    return p.report(h)
"""


def types_of(folder: Path, files: dict[str, str]) -> str:
    """What mypy says of these modules, with the project's own settings."""
    for name, text in files.items():
        (folder / f"{name}.py").write_text(HEAD + text + "\n")
    settings = ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(folder / "cache")]
    command = [sys.executable, "-m", "mypy", *settings, *(str(folder / f"{name}.py") for name in files)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    return done.stdout


@pytest.mark.ledger("R78", entry="command line", symbol="tools.dispatch_plugin:refuse_dispatch")
def test_a_dispatch_around_the_supervisor_is_found_by_its_type(tmp_path: Path) -> None:
    named = {what.replace(" ", "_"): text for what, text in AROUND.items()}
    said = types_of(tmp_path, {**named, "innocent": INNOCENT})
    found = {line.split("error: ")[1].split()[0] for line in said.splitlines() if "around the supervisor" in line}
    assert found == set(named), said


def test_the_project_is_checked_with_it() -> None:
    assert 'plugins = ["tools/dispatch_plugin.py"]' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
