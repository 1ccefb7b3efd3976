"""`make ledger-mutants`: break what the ledger marks name, in a copy of the tree, and expect red tests.

A symbol that only raises or returns nothing, and a planted offence, must be noticed by the very tests that name it.
A finer break (a turned comparison, a condition that always holds, a dropped statement) may concern another row:
it must be noticed by them or by any cheap test that imports from the same room.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tools.marks import ROOT, Mark, collected, complaint, module_file, pytest_report
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
        """The room it stands in: harness.gate."""
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
        sample = _sample(_mutants(marks, tree=tree), count=chosen.count, seed=chosen.seed)
        idle = _tests_that_pass_unbroken(sample, tree=tree)
        survivors = _survivors(sample, tree=tree, idle=idle)
    if survivors:
        print(f"\n{len(survivors)} of {len(sample)} mutants survived: their tests do not prove all that they claim")
        for mutant in survivors:
            print(f"  {mutant.operator}: {mutant.place}\n      " + "\n      ".join(mutant.tests))
        raise SystemExit(1)
    print(f"\nall {len(sample)} mutants were noticed")


def _refuse_bad_marks(marks: Sequence[Mark]) -> None:
    for mark in marks:
        named = {"symbol": mark.symbol} if mark.symbol else {"planted": mark.planted}
        wrong = complaint(mark.rows, named)
        if wrong:
            raise SystemExit(f"{mark.test}: {wrong}")


def _environment(tree: Path) -> Mapping[str, str]:
    data = os.environ.get("REGEN_DATA") or str(ROOT.parent / "shared" / "data")
    return {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", "REGEN_DATA": data}


def _refuse_foreign_imports(tree: Path) -> None:
    """The copy must be what is imported, in child processes too: otherwise no mutant would ever be seen."""
    command = [sys.executable, "-c", "import harness; print(harness.__file__)"]
    environment = {**os.environ, **_environment(tree)}
    answer = subprocess.run(command, cwd=tree.parent, env=environment, capture_output=True, text=True, check=True)
    if not answer.stdout.startswith(str(tree)):
        raise SystemExit(f"The copy in {tree} is not what gets imported, but {answer.stdout.strip()}.")


def _mutants(marks: Sequence[Mark], *, tree: Path) -> list[Mutant]:
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


def _tests_that_pass_unbroken(sample: Sequence[Mutant], *, tree: Path) -> set[str]:
    """Run every marked test once without any mutant; returns those that were skipped here."""
    tests = sorted({test for mutant in sample for test in mutant.tests})
    print(f"{len(sample)} mutants, {len(tests)} tests; first all of them unbroken", flush=True)
    report = pytest_report(*tests, root=tree, environment=_environment(tree), timeout_s=3 * RUN_TIMEOUT_S)
    if report["code"] != pytest.ExitCode.OK:
        raise SystemExit(f"Red without any mutant:\n{report['output'][-3000:]}")
    return {test for test, outcome in report["outcomes"].items() if outcome == "skipped"}


def _survivors(sample: Sequence[Mutant], *, tree: Path, idle: set[str]) -> list[Mutant]:
    survivors = []
    for number, mutant in enumerate(sample, start=1):
        tests = [test for test in mutant.tests if test not in idle]
        if not tests:
            print(f"{number:4d} not run    {mutant.operator}: {mutant.place} (its tests were skipped here)", flush=True)
            continue
        started = time.monotonic()
        red = _turns_red(mutant, tests, tree=tree)
        took = f"{time.monotonic() - started:5.1f} s"
        print(f"{number:4d} {'red     ' if red else 'SURVIVED'} {took} {mutant.operator}: {mutant.place}", flush=True)
        if not red:
            survivors.append(mutant)
    return survivors


def _turns_red(mutant: Mutant, tests: Sequence[str], *, tree: Path) -> bool:
    with _broken(mutant):
        red = bool(_run(tests, tree=tree)["code"] != pytest.ExitCode.OK)
    if red or not mutant.is_fine:
        return red
    room = _tests_of_the_room(tree, mutant.package)
    with _broken(mutant):
        return bool(room and _run(room, tree=tree)["code"] != pytest.ExitCode.OK)


@contextmanager
def _broken(mutant: Mutant) -> Iterator[None]:
    original = mutant.path.read_text(encoding="utf-8")
    mutant.path.write_text(mutant.source, encoding="utf-8")
    try:
        yield
    finally:
        mutant.path.write_text(original, encoding="utf-8")


@cache
def _tests_of_the_room(tree: Path, package: str) -> tuple[str, ...]:
    """Cheap test files that import from the package; they must pass unbroken."""
    files = sorted(path for folder in CHEAP for path in (tree / folder).rglob("test_*.py"))
    tests = [path.relative_to(tree).as_posix() for path in files if package in path.read_text(encoding="utf-8")]
    report = _run(tests, tree=tree)
    if tests and report["code"] != pytest.ExitCode.OK:
        raise SystemExit(f"Red without any mutant:\n{report['output'][-3000:]}")
    return tuple(tests)


def _run(tests: Sequence[str], *, tree: Path) -> dict[str, Any]:
    arguments = ("-x", "--timeout=60", "-m", "not mujoco", *tests)
    return pytest_report(*arguments, root=tree, environment=_environment(tree), timeout_s=RUN_TIMEOUT_S)


if __name__ == "__main__":
    main()
