"""Runs pytest in forks of one process that has already imported the libraries, so that no run imports them again.

It runs in the tree whose tests it runs, reads one order per line from its input and answers each with one line. It
learns from the first run what to import beforehand: every module outside the tree that the run had imported.
"""

import importlib
import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import pytest

LOOK_S = 0.02
HUNG = -1


def main() -> None:
    """Orders: {"arguments": [...], "folder": where output, report and modules go, "timeout_s": ...}."""
    sys.path.insert(0, os.getcwd())
    learnt = False
    for line in sys.stdin:
        order = json.loads(line)
        code = _run(order["arguments"], Path(order["folder"]), timeout_s=float(order["timeout_s"]))
        if not learnt:
            learnt = True
            _learn(Path(order["folder"]) / "modules.json")
        print(json.dumps({"code": code}), flush=True)


def _run(arguments: list[str], folder: Path, *, timeout_s: float) -> int:
    """The exit code of one run in a fork; HUNG for one that was killed after `timeout_s`."""
    child = os.fork()
    if child == 0:
        os._exit(_forked(arguments, folder))
    until = time.monotonic() + timeout_s
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(LOOK_S)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return HUNG


def _forked(arguments: list[str], folder: Path) -> int:
    """Runs in the fork; never returns an exception to the loop that forked it."""
    os.setsid()
    output = os.open(folder / "output", os.O_CREAT | os.O_WRONLY | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(output, stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    try:
        code = int(pytest.main(arguments))
        (folder / "modules.json").write_text(json.dumps(_outside(Path.cwd())), encoding="utf-8")
    except BaseException as error:  # noqa: BLE001 - whatever it is, the fork ends here
        print(f"pytest itself broke: {type(error).__name__}: {error}", flush=True)
        code = int(pytest.ExitCode.INTERNAL_ERROR)
    sys.stdout.flush()
    sys.stderr.flush()
    return code


def _outside(tree: Path) -> list[str]:
    """Imported modules with a file outside the tree, in the order of their import."""
    found: list[tuple[str, Any]] = [(name, getattr(module, "__file__", None)) for name, module in sys.modules.items()]
    return [name for name, file in found if file and not Path(file).is_relative_to(tree) and name != "__main__"]


def _learn(file: Path) -> None:
    """Import what a run needed; a module that cannot be imported by itself is left to the runs."""
    for name in json.loads(file.read_text(encoding="utf-8")) if file.is_file() else ():
        try:
            importlib.import_module(name)
        except Exception as error:  # noqa: BLE001 - somebody else's module, which some other import makes possible
            print(f"not imported beforehand: {name} ({type(error).__name__})", file=sys.stderr)


if __name__ == "__main__":
    main()
