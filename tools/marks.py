"""Reads ledger marks: the rows of docs/ledger.md, the tests that claim them, and the symbols that a mutation must
break.

A mark is `@pytest.mark.ledger("R34", symbol="harness.gate.rules:obsolete_version")`. A structural test, which no
broken function can turn red, names a planted offence instead: `planted="harness.routing.score:provider.start(x)"`.
`entry` says that the test starts where a user does: at the command line, the API or a page. The rows of the table
"To prove again" need such a mark.
"""

import ast
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
ENTRIES = ("command line", "API", "page")
_AGAIN = re.compile(r"^\| ((?:R\d+(?:, )?)+) \| (.+) \|$", re.MULTILINE)
_ROW = re.compile(r"^(R\d+) \[(core|adapter|context)\] (.+)$", re.MULTILINE)
_SECTION = re.compile(r"^## (.+)$", re.MULTILINE)

Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


@dataclass(frozen=True)
class LedgerRow:
    """One requirement: its id, its mark (core, adapter, context), its text and its section."""

    name: str
    mark: str
    text: str
    section: str


@dataclass(frozen=True)
class LedgerMark:
    """One test's claim: `rows` it proves, and what breaks it: a `symbol` or a `planted` offence.

    `entry` is where the test starts, if that is where a user does.
    """

    test: str
    rows: tuple[str, ...]
    symbol: str
    planted: str
    entry: str = ""


@cache
def ledger(root: Path = ROOT) -> Mapping[str, LedgerRow]:
    """All rows by id, in the document's order."""
    text = (root / "docs" / "ledger.md").read_text(encoding="utf-8")
    sections = [(found.start(), found.group(1)) for found in _SECTION.finditer(text)]
    rows = {}
    for found in _ROW.finditer(text):
        section = next(title for start, title in reversed(sections) if start < found.start())
        rows[found.group(1)] = LedgerRow(name=found.group(1), mark=found.group(2), text=found.group(3), section=section)
    return rows


@cache
def to_prove_again(root: Path = ROOT) -> Mapping[str, str]:
    """The rows that a test from an entry point must prove again, with what it must show."""
    text = (root / "docs" / "ledger.md").read_text(encoding="utf-8")
    return {row: found.group(2) for found in _AGAIN.finditer(text) for row in found.group(1).split(", ")}


def module_file(module: str, *, root: Path = ROOT) -> Path | None:
    """The source file of a dotted module name, or None."""
    base = root.joinpath(*module.split("."))
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)


def definition(symbol: str, *, root: Path = ROOT) -> Definition | None:
    """The function, method or class that `module:qualname` names, or None."""
    module, _, qualname = symbol.partition(":")
    path = module_file(module, root=root)
    if path is None or not qualname:
        return None
    return find_definition(ast.parse(path.read_text(encoding="utf-8")), qualname)


def find_definition(tree: ast.Module, qualname: str) -> Definition | None:
    """The definition of that qualified name inside a module's tree, or None."""
    here: ast.AST = tree
    for name in qualname.split("."):
        inside = [node for node in ast.iter_child_nodes(here) if isinstance(node, Definition) and node.name == name]
        if not inside:
            return None
        here = inside[-1]
    return here if isinstance(here, Definition) else None


def complaint(rows: tuple[object, ...], named: Mapping[str, object], *, root: Path = ROOT) -> str:
    """What is wrong with a mark's arguments; empty if nothing is."""
    known = ledger(root)
    unknown = [str(row) for row in rows if row not in known]
    if not rows or unknown:
        return f"ledger mark: no such row: {', '.join(unknown) or '(none given)'}. The rows stand in docs/ledger.md"
    if named.get("entry", ENTRIES[0]) not in ENTRIES:
        return f"ledger mark: a test starts at one of {', '.join(ENTRIES)}"
    named = {name: value for name, value in named.items() if name != "entry"}
    if set(named) not in ({"symbol"}, {"planted"}):
        return "ledger mark: give exactly one of symbol='module:qualname' and planted='module:expression'"
    [(kind, value)] = named.items()
    if kind == "symbol" and definition(str(value), root=root) is None:
        return f"ledger mark: no function, method or class at {value!r}"
    if kind == "planted" and module_file(str(value).partition(":")[0], root=root) is None:
        return f"ledger mark: no module to plant into at {value!r}"
    return ""


def pytest_report(
    *arguments: str, root: Path = ROOT, environment: Mapping[str, str] | None = None, timeout_s: float = 600
) -> dict[str, Any]:
    """Run pytest in `root` and return {"code", "output", "marks", "outcomes"}; a run that hangs has the code -1."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "report.json"
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "tools.reporting"]
        process = subprocess.Popen(
            [*command, f"--report-to={answer}", *arguments],
            cwd=root,
            env={**os.environ, **(environment or {})},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            output, _ = process.communicate(timeout=timeout_s)
            code = process.returncode
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            output, code = process.communicate()[0], -1
        report = json.loads(answer.read_text()) if answer.is_file() else {"marks": [], "outcomes": {}}
    return {"code": code, "output": output, **report}


def collected(*paths: str, root: Path = ROOT) -> list[LedgerMark]:
    """Every ledger mark that pytest collects there, by default everywhere, the tests against foreign programs included.

    Raises SystemExit with pytest's output if collection fails.
    """
    report = pytest_report("--collect-only", "-m", "", *paths, root=root)
    if report["code"] not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise SystemExit(f"pytest cannot collect the tests:\n{report['output'][-3000:]}")
    return [LedgerMark(**{**mark, "rows": tuple(mark["rows"])}) for mark in report["marks"]]
