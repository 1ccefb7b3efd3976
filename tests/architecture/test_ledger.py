"""Tests the requirements ledger and its tools: every row is there, a false mark is found, a mutation breaks
what it names.
"""

import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tools.ledger import still_to_prove
from tools.marks import ROOT, LedgerMark, complaint, definition, ledger, to_prove_again
from tools.mutations import OPERATORS, mutated, planted

USES = {
    "command line": (
        "from app.cli.main import app",
        "tests.integration.runs import",
        "test_own_models import",
        '"-m", "mypy"',
    ),
    "API": ("tests.builders.serving", "TestClient", "tests.builders.consoles"),
    "page": ("tests.builders.serving", "TestClient", "tests.builders.consoles", "playwright"),
}
"""How a test module of an entry point looks: it runs the program, or asks the served console."""
SYMBOL = "harness.contracts.values:digest"
SOURCE = '''
def within(value, limit, *, strict):
    """Whether a value keeps its limit."""
    known = value is not None
    if strict and not known:
        return False
    return value <= limit


class Window:
    size: int
    step: int
'''


def test_the_ledger_has_every_row_once() -> None:
    rows = ledger()
    assert list(rows) == [f"R{number}" for number in range(1, 236)]
    assert Counter(row.mark for row in rows.values()) == {"core": 208, "adapter": 19, "context": 8}
    assert all(row.text and row.section for row in rows.values())


def test_a_mark_that_names_a_row_and_a_symbol_is_fine() -> None:
    assert complaint(("R34", "R112"), {"symbol": SYMBOL}) == ""
    assert complaint(("R34",), {"symbol": SYMBOL, "entry": "API"}) == ""
    assert complaint(("R78",), {"planted": "harness.routing:provider.start(1)"}) == ""


@pytest.mark.parametrize(
    ("rows", "named"),
    [
        ((), {"symbol": SYMBOL}),
        (("R236",), {"symbol": SYMBOL}),
        (("R34",), {}),
        (("R34",), {"symbol": SYMBOL, "planted": "harness.routing:f()"}),
        (("R34",), {"symbol": "harness.contracts.values:nowhere"}),
        (("R34",), {"symbol": "harness.nowhere:digest"}),
        (("R34",), {"planted": "harness.nowhere:f()"}),
        (("R34",), {"symbol": SYMBOL, "entry": "a builder"}),
    ],
)
def test_a_false_mark_is_found(rows: tuple[str, ...], named: dict[str, str]) -> None:
    assert complaint(rows, named).startswith("ledger mark: ")


def test_every_row_to_prove_again_is_a_row_of_the_ledger_and_says_what_to_show() -> None:
    again = to_prove_again()
    assert set(again) <= set(ledger())
    assert all(len(must_show) > 20 for must_show in again.values())


def test_a_row_leaves_the_list_with_a_test_from_an_entry_point_alone() -> None:
    mark = LedgerMark(test="t", rows=("R33",), symbol=SYMBOL, planted="")
    assert "R33" in still_to_prove({"R33": [mark]})
    assert "R33" not in still_to_prove({"R33": [mark, replace(mark, entry="API")]})


def entries() -> Iterator[tuple[Path, str]]:
    """Every test module with an entry point that its marks name."""
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "ledger":
                named = [one.value for one in node.keywords if one.arg == "entry"]
                yield from ((path, str(one.value)) for one in named if isinstance(one, ast.Constant))


def test_a_test_that_claims_an_entry_point_uses_it() -> None:
    strays = [
        f"{path.name}: {entry}"
        for path, entry in entries()
        if not any(words in path.read_text(encoding="utf-8") for words in USES[entry])
    ]
    assert strays == []


def test_a_symbol_may_be_a_method(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text("class A:\n    class B:\n        async def run(self): ...\n")
    assert definition("module:A.B.run", root=tmp_path) is not None
    assert definition("module:A.run", root=tmp_path) is None


def answer(operator: str, value: int | None, *, strict: bool = True) -> object:
    """The result of `within(value, 10)` after the operator."""
    source = mutated(SOURCE, qualname="within", operator=operator)
    assert source is not None
    names: dict[str, object] = {}
    exec(source, names)
    within = names["within"]
    assert callable(within)
    return within(value, 10, strict=strict)


def test_each_operator_breaks_the_function_in_its_own_way() -> None:
    with pytest.raises(AssertionError, match="broken on purpose"):
        answer("raise", 1)
    assert answer("return None", 1) is None
    assert answer("negate comparisons", 11, strict=False) is True
    assert answer("drop the last statement", 1) is None
    assert answer("conditions always hold", 1, strict=False) is True
    assert answer("conditions never hold", 11) is False


def test_an_operator_that_changes_nothing_makes_no_mutant() -> None:
    assert mutated("def f():\n    return 1\n", qualname="f", operator="negate comparisons") is None
    assert mutated(SOURCE, qualname="nowhere", operator="raise") is None


def test_a_class_without_methods_loses_its_last_field() -> None:
    broken = {name: mutated(SOURCE, qualname="Window", operator=name) for name in OPERATORS}
    assert [name for name, source in broken.items() if source] == ["drop the last statement"]
    assert "step" not in (broken["drop the last statement"] or "")


def test_an_offence_is_planted_as_a_function_of_its_module() -> None:
    assert "return store.append([])" in planted("x = 1", expression="store.append([])")
