"""Plants known bugs, each in a copy of the tree, and expects the campaigns to find them: one that misses a bug proves
nothing.

Every bug names the check that must fail. The same checks run on an unbroken copy first and must pass there.
"""

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from experiments.campaigns.regen import ROOT
from harness.contracts.values import Value

Check = Literal["simulation", "races", "suspended", "hammer", "declared"]
HALF_WRITTEN = "*.pyc.*"
"""Compiled files are copied with their sources, whose times they were made for; another process may be writing one."""
COPIED = ("harness", "simulator", "rsi_reviews", "experiments", "tools")
PREDICATES = 'return ""'
RED, GREEN = 9, 0
LONGEST_S = 900.0


class Edit(Value):
    """In one function: `old` becomes `new`, or the whole body where `old` is empty."""

    file: str
    function: str
    new: str
    old: str = ""


class Bug(Value):
    """A bug: what is broken, how, and which check must find it."""

    name: str
    check: Check
    edits: tuple[Edit, ...]


class PlantedReport(Value):
    """`caught`: bugs whose check failed. `missed`: the names of the others."""

    total: int
    caught: int
    missed: tuple[str, ...]
    seen: dict[str, str]


RULES = "harness/gate/rules.py"
BUGS: tuple[Bug, ...] = (
    Bug(
        name="no expected-version check in the store",
        check="races",
        edits=(
            Edit(
                file="harness/adapters/stores/chain.py",
                function="link",
                old="if actual != batch.expected_version:",
                new="if False:",
            ),
        ),
    ),
    Bug(
        name="no cycle check at the handoff",
        check="races",
        edits=(
            Edit(
                file="harness/gate/handoffs.py",
                function="_unseen",
                old="if command.cycle != handoff.cycle:",
                new="if False:",
            ),
        ),
    ),
    Bug(
        name="identity check dropped",
        check="simulation",
        edits=(Edit(file=RULES, function="wrong_identity", new=PREDICATES),),
    ),
    Bug(
        name="version check dropped",
        check="simulation",
        edits=(Edit(file=RULES, function="obsolete_version", new=PREDICATES),),
    ),
    Bug(
        name="satisfied check dropped",
        check="simulation",
        edits=(Edit(file=RULES, function="not_satisfied", new=PREDICATES),),
    ),
    Bug(
        name="lease without fencing",
        check="suspended",
        edits=(
            Edit(
                file="simulator/robot.py",
                function="SimulatedRobot.admit",
                old="if token < newest:",
                new="if False:",
            ),
        ),
    ),
    Bug(
        name="veto relaxed",
        check="simulation",
        edits=(
            Edit(file=RULES, function="vetoed", new=PREDICATES),
            Edit(file="harness/gate/dispatch.py", function="unready", old="if mission.vetoes:", new="if False:"),
        ),
    ),
    Bug(
        name="planner text let into C3",
        check="simulation",
        edits=(Edit(file="harness/contexts/selection.py", function="_admissible_evidence", new="return True"),),
    ),
    Bug(
        name="duplicate-start dedup dropped",
        check="simulation",
        edits=(
            Edit(
                file="simulator/robot.py",
                function="SimulatedRobot.begin",
                old="if known is not None:",
                new="if False:",
            ),
        ),
    ),
    Bug(
        name="budget check dropped",
        check="simulation",
        edits=(Edit(file="harness/recovery/state.py", function="unaffordable", new=PREDICATES),),
    ),
    Bug(
        name="outbox not atomic",
        check="hammer",
        edits=(
            Edit(
                file="harness/gate/commit.py",
                function="Gate._append",
                old="self._store.append((*asserted, *batches), (*records, *commands), now)",
                new="for batch in batches:\n            self._store.append([batch], (*records, *commands), now)",
            ),
        ),
    ),
    Bug(
        name="provider's word taken as level 1",
        check="declared",
        edits=(
            Edit(
                file="harness/verification/independence.py",
                function="derived_independence",
                old="levels.append(0)",
                new="levels.append(1)",
            ),
        ),
    ),
    Bug(
        name="declared effect committed",
        check="declared",
        edits=(
            Edit(
                file="harness/gate/completion.py",
                function="complete",
                old="_declared(mission, command, effects)",
                new="_committed(mission, command)",
            ),
        ),
    ),
    Bug(
        name="goal met on a provider's word",
        check="declared",
        edits=(
            Edit(
                file="harness/gate/goal.py",
                function="_partly",
                old='status="partly_verified"',
                new='status="succeeded"',
            ),
        ),
    ),
)


def planted_bugs(*, missions: int, seed: int, names: Sequence[str] = ()) -> PlantedReport:
    """Plant each bug (or those of these names) and run its check. Raises RuntimeError if a check fails without
    any bug.
    """
    bugs = [bug for bug in BUGS if not names or bug.name in names]
    seen: dict[str, str] = {}
    with TemporaryDirectory(prefix="planted-") as folder:
        tree = Path(folder) / "tree"
        _copied(tree)
        for check in dict.fromkeys(bug.check for bug in bugs):
            unbroken = _checked(tree, check, missions=missions, seed=seed)
            if unbroken.returncode != GREEN:
                raise RuntimeError(f"the {check} check is red without any bug:\n{unbroken.stdout[-2000:]}")
        for bug in bugs:
            originals = {edit.file: (tree / edit.file).read_text(encoding="utf-8") for edit in bug.edits}
            for edit in bug.edits:
                (tree / edit.file).write_text(edited((tree / edit.file).read_text(encoding="utf-8"), edit))
            found = _checked(tree, bug.check, missions=missions, seed=seed)
            for file, text in originals.items():
                (tree / file).write_text(text, encoding="utf-8")
            if found.returncode == RED:
                seen[bug.name] = (found.stdout.strip().splitlines() or [""])[0]
            print(f"{'caught' if found.returncode == RED else 'MISSED'}: {bug.name}", file=sys.stderr, flush=True)
    missed = tuple(bug.name for bug in bugs if bug.name not in seen)
    return PlantedReport(total=len(bugs), caught=len(bugs) - len(missed), missed=missed, seen=seen)


def edited(source: str, edit: Edit) -> str:
    """The module with the edit made. Raises ValueError where it does not fit: the code has changed, so the bug must
    change too.
    """
    found = _function(ast.parse(source), edit.function.split("."))
    if found is None or found.end_lineno is None:
        raise ValueError(f"{edit.file} has no {edit.function}")
    lines = source.splitlines(keepends=True)
    first = found.body[0].lineno - 1 if not edit.old else found.lineno - 1
    text = "".join(lines[first : found.end_lineno])
    if edit.old and text.count(edit.old) != 1:
        raise ValueError(f"{edit.file}, {edit.function}: {edit.old!r} stands {text.count(edit.old)} times")
    indent = " " * found.body[0].col_offset
    changed = text.replace(edit.old, edit.new) if edit.old else f"{indent}{edit.new}\n"
    return "".join([*lines[:first], changed, *lines[found.end_lineno :]])


def _function(tree: ast.AST, path: Sequence[str]) -> ast.FunctionDef | None:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == path[0]:
            if len(path) > 1:
                return _function(node, path[1:])
            return node if isinstance(node, ast.FunctionDef) else None
    return None


def _copied(tree: Path) -> None:
    for name in COPIED:
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns(HALF_WRITTEN))


def _checked(tree: Path, check: Check, *, missions: int, seed: int) -> subprocess.CompletedProcess[str]:
    """The check in the copy: exit 0 without a violation, 1 with one, which is the first line it prints."""
    amounts = {"simulation": ("--missions", str(missions), "--seed", str(seed))}.get(check, ())
    return subprocess.run(
        [sys.executable, "-P", "-m", "experiments.campaigns", "check", check, *amounts],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
