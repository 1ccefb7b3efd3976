"""Checks that docs/reference/asks.md lists exactly the tests that carry the mark `ask`."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ASKED = {
    "navigation2#3257",
    "spot_ros#53",
    "rmf_demos#330",
    "rmf#520",
    "VDA5050#511",
    "flotilla#562",
    "navigation2#5567",
    "mowglinext#486",
    "isar#926",
    "isar#730",
    "flotilla#889",
    "flotilla#1943",
    "flotilla#2613",
    "flotilla#1349",
    "langgraph#8026",
    "langgraph#7895",
    "langgraph#8039",
    "temporalio/ui#2413",
    "ros-mcp-server#283",
    "robocasa#215",
}
"""The issues that this project set out to answer."""


def marked(source: str, path: str) -> Iterator[tuple[str, str]]:
    """Every issue that a test of this source is marked with, and the test."""
    for node in ast.walk(ast.parse(source)):
        for mark in node.decorator_list if isinstance(node, ast.FunctionDef) else ():
            if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.ask":
                yield from ((ast.literal_eval(one), f"{path}::{node.name}") for one in mark.args)  # type: ignore[union-attr]


def listed(page: str) -> set[tuple[str, str]]:
    """The rows of the table: issue and test."""
    return set(re.findall(r"^\| (\S+#\d+): .*? \| .*? \| `(.*?)` \|", page, re.MULTILINE))


def test_the_table_lists_every_ask_with_its_test() -> None:
    found = {
        one
        for path in sorted((ROOT / "tests").rglob("*.py"))
        for one in marked(path.read_text(encoding="utf-8"), str(path.relative_to(ROOT)))
    }
    assert listed((ROOT / "docs" / "reference" / "asks.md").read_text(encoding="utf-8")) == found
    assert {issue for issue, _ in found} == ASKED


def test_a_mark_that_the_table_lacks_is_found() -> None:
    planted = '@pytest.mark.ask("other#1")\ndef test_something() -> None: ...\n'
    assert list(marked(planted, "tests/test_planted.py")) == [("other#1", "tests/test_planted.py::test_something")]
    assert listed("| other#1: Why? | Because | `tests/a.py::test_b` | [x](x.md) |") == {
        ("other#1", "tests/a.py::test_b")
    }
