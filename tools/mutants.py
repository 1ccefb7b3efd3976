"""`make ledger-mutants`: break what the ledger marks name, in a copy of the tree, and expect red tests.

A symbol that only raises or returns nothing, and a planted offence, must be noticed by the very tests that name it.
A finer break (a turned comparison, a condition that always holds, a dropped statement) may concern another row:
it must be noticed by them or by any cheap test that imports from the same room.
"""

import argparse
import compileall
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from py_compile import PycInvalidationMode
from typing import Any

import pytest

from tools.marks import ROOT, LedgerMark, collected, complaint, module_file
from tools.mutations import BLUNT, OPERATORS, mutated, planted

LEFT_BEHIND = (
    ".git",
    ".venv",
    "var",
    "build",
    "artefacts",
    ".bench",
    "__pycache__",
    "*.egg-info",
    ".*_cache",
    ".hypothesis",
)
CHEAP = ("tests/unit", "tests/contract", "tests/replay")
RUN_TIMEOUT_S = 300
HUNG = -1
CHOSEN = ("-x", "--timeout=30", "-m", "not mujoco")


@dataclass(frozen=True)
class Mutant:
    """One way to break one symbol (or plant one offence), and the tests that must notice."""

    place: str
    operator: str
    path: Path
    source: str
    tests: tuple[str, ...]

    @property
    def package(self) -> str:
        """The package it belongs to: harness.gate."""
        return self.place.partition(":")[0].rpartition(".")[0]

    @property
    def is_fine(self) -> bool:
        """Whether it changes less than the whole symbol."""
        return self.operator in OPERATORS and self.operator not in BLUNT


def main() -> None:
    """Run a sample of the mutants; exit 1 if one survives or if a marked test is red without any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", default="20", help="how many mutants to run, or `all`")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="only symbols that contain this")
    parser.add_argument("--blunt", action="store_true", help="whole symbols and planted offences: every mark, fast")
    parser.add_argument("paths", nargs="*", help="only tests under these paths")
    chosen = parser.parse_args()
    marks = [mark for mark in collected(*chosen.paths) if chosen.only in (mark.symbol or mark.planted)]
    if not marks:
        raise SystemExit("No test carries a ledger mark that matches: nothing to break.")
    _refuse_bad_marks(marks)
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
        _refuse_foreign_imports(tree)
        compileall.compile_dir(tree, quiet=1, invalidation_mode=PycInvalidationMode.CHECKED_HASH)
        mutants = [one for one in _mutants(marks, tree=tree) if not (chosen.blunt and one.is_fine)]
        sample = _sample(mutants, count=chosen.count, seed=chosen.seed)
        with closing(Runs(tree, _environment(tree))) as runs:
            idle = _tests_that_pass_unbroken(sample, runs=runs)
            survivors = _survivors(sample, runs=runs, idle=idle)
    if survivors:
        print(f"\n{len(survivors)} of {len(sample)} mutants survived: their tests do not prove all that they claim")
        for mutant in survivors:
            print(f"  {mutant.operator}: {mutant.place}\n      " + "\n      ".join(mutant.tests))
        raise SystemExit(1)
    print(f"\nall {len(sample)} mutants were noticed")


def _refuse_bad_marks(marks: Sequence[LedgerMark]) -> None:
    for mark in marks:
        named = {"symbol": mark.symbol} if mark.symbol else {"planted": mark.planted}
        wrong = complaint(mark.rows, named)
        if wrong:
            raise SystemExit(f"{mark.test}: {wrong}")


def _environment(tree: Path) -> Mapping[str, str]:
    data = os.environ.get("REGEN_DATA") or str(ROOT.parent / "shared" / "data")
    return {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", "REGEN_DATA": data}


def _refuse_foreign_imports(tree: Path) -> None:
    """Require that the copy is what is imported, in child processes too: otherwise no mutant would take effect."""
    command = [sys.executable, "-c", "import harness; print(harness.__file__)"]
    environment = {**os.environ, **_environment(tree)}
    answer = subprocess.run(command, cwd=tree.parent, env=environment, capture_output=True, text=True, check=True)
    if not answer.stdout.startswith(str(tree)):
        raise SystemExit(f"The copy in {tree} is not what gets imported, but {answer.stdout.strip()}.")


def _mutants(marks: Sequence[LedgerMark], *, tree: Path) -> list[Mutant]:
    """Every mutant of every named symbol; tests that name the same symbol share its mutants."""
    tests: dict[tuple[str, str], set[str]] = defaultdict(set)
    for mark in marks:
        tests[(mark.symbol, mark.planted)].add(mark.test)
    mutants = []
    for (symbol, offence), names in sorted(tests.items()):
        module, _, rest = (symbol or offence).partition(":")
        path = module_file(module, root=tree)
        if path is None:
            raise SystemExit(f"There is no module {module} in the copy.")
        source = path.read_text(encoding="utf-8")
        if symbol:
            broken = {name: mutated(source, qualname=rest, operator=name) for name in OPERATORS}
        else:
            broken = {"plant": planted(source, expression=rest)}
        place = symbol or offence
        mutants += [
            Mutant(place=place, operator=operator, path=path, source=changed, tests=tuple(sorted(names)))
            for operator, changed in broken.items()
            if changed
        ]
    return mutants


def _sample(mutants: list[Mutant], *, count: str, seed: int) -> list[Mutant]:
    if count == "all" or int(count) >= len(mutants):
        return mutants
    return random.Random(seed).sample(mutants, int(count))


class Runs:
    """Runs of pytest in the copy, forked from one process that has imported the libraries already."""

    def __init__(self, tree: Path, environment: Mapping[str, str]) -> None:
        self.tree = tree
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tools.forking"],
            cwd=tree,
            env={**os.environ, **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def report(self, *arguments: str, timeout_s: float = RUN_TIMEOUT_S) -> dict[str, Any]:
        """{"code", "output", "marks", "outcomes"} of one run; a run that hangs has the code HUNG.

        Raises SystemExit where the process itself is gone.
        """
        if self._process.stdin is None or self._process.stdout is None:
            raise SystemExit("The runs have no pipes")
        with tempfile.TemporaryDirectory() as folder:
            answer = Path(folder) / "report.json"
            options = ["-q", "--assert=plain", "-p", "no:cacheprovider", "-p", "tools.reporting"]
            words = [*options, f"--report-to={answer}", *arguments]
            order = {"arguments": words, "folder": folder, "timeout_s": timeout_s}
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
            if not line:
                raise SystemExit(f"The process that runs the tests ended with {self._process.wait()}")
            log = Path(folder) / "output"
            output = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
            report = json.loads(answer.read_text()) if answer.is_file() else {"marks": [], "outcomes": {}}
        return {**json.loads(line), "output": output, **report}

    def close(self) -> None:
        """Let the process end."""
        self._process.communicate()


def _tests_that_pass_unbroken(sample: Sequence[Mutant], *, runs: Runs) -> set[str]:
    """Run every marked test once without any mutant; returns those that were skipped here."""
    tests = sorted({test for mutant in sample for test in mutant.tests})
    print(f"{len(sample)} mutants, {len(tests)} tests; first all of them unbroken", flush=True)
    report = _green(runs, *tests, timeout_s=6 * RUN_TIMEOUT_S)
    _green(runs, tests[0])  # once more, now that the process has imported the libraries
    return {test for test, outcome in report["outcomes"].items() if outcome == "skipped"}


def _survivors(sample: Sequence[Mutant], *, runs: Runs, idle: set[str]) -> list[Mutant]:
    survivors = []
    rooms: dict[str, tuple[str, ...]] = {}
    for number, mutant in enumerate(sample, start=1):
        tests = [test for test in mutant.tests if test not in idle]
        if not tests:
            print(f"{number:4d} not run    {mutant.operator}: {mutant.place} (its tests were skipped here)", flush=True)
            continue
        started = time.monotonic()
        red = _turns_red(mutant, tests, runs=runs, rooms=rooms)
        took = f"{time.monotonic() - started:5.1f} s"
        print(f"{number:4d} {'red     ' if red else 'SURVIVED'} {took} {mutant.operator}: {mutant.place}", flush=True)
        if not red:
            survivors.append(mutant)
    return survivors


def _turns_red(mutant: Mutant, tests: Sequence[str], *, runs: Runs, rooms: dict[str, tuple[str, ...]]) -> bool:
    with _broken(mutant):
        red = bool(_run(tests, runs=runs)["code"] != pytest.ExitCode.OK)
    if red or not mutant.is_fine:
        return red
    if mutant.package not in rooms:
        rooms[mutant.package] = _tests_of_the_room(mutant.package, runs=runs)
    room = rooms[mutant.package]
    with _broken(mutant):
        return bool(room and _run(room, runs=runs)["code"] != pytest.ExitCode.OK)


@contextmanager
def _broken(mutant: Mutant) -> Iterator[None]:
    original = mutant.path.read_text(encoding="utf-8")
    mutant.path.write_text(mutant.source, encoding="utf-8")
    try:
        yield
    finally:
        mutant.path.write_text(original, encoding="utf-8")


def _tests_of_the_room(package: str, *, runs: Runs) -> tuple[str, ...]:
    """Cheap test files that import from the package and pass unbroken; the others are named."""
    files = sorted(path for folder in CHEAP for path in (runs.tree / folder).rglob("test_*.py"))
    tests = [path.relative_to(runs.tree).as_posix() for path in files if package in path.read_text(encoding="utf-8")]
    if not tests:
        return ()
    report = runs.report(*CHOSEN[1:], *tests)
    red = {test.partition("::")[0] for test, outcome in report["outcomes"].items() if outcome == "failed"}
    if report["code"] == HUNG:
        print(f"     not asked: the tests of {package} did not end in {RUN_TIMEOUT_S} s", flush=True)
        return ()
    if report["code"] != pytest.ExitCode.OK and not red:
        raise SystemExit(f"Red without any mutant:\n{report['output'][-3000:]}")
    for test in sorted(red):
        print(f"     not asked: {test} is red without any mutant", flush=True)
    return tuple(test for test in tests if test not in red)


def _run(tests: Sequence[str], *, runs: Runs) -> dict[str, Any]:
    return runs.report(*CHOSEN, *tests)


def _green(runs: Runs, *arguments: str, timeout_s: float = RUN_TIMEOUT_S) -> dict[str, Any]:
    """The report of a run without any mutant. Raises SystemExit if it is red: then red proves nothing."""
    report = runs.report(*arguments, timeout_s=timeout_s)
    if report["code"] != pytest.ExitCode.OK:
        raise SystemExit(f"Red without any mutant:\n{report['output'][-3000:]}")
    return report


if __name__ == "__main__":
    main()
