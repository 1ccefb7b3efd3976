"""Checks names: a class name is unique in the project, and retired names do not come back."""

import ast
import io
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT, Module, module, modules

PRODUCT = ("app", "harness", "rsi_reviews", "simulator", "experiments", "tools")
RETIRED = frozenset(
    {
        "Attendant",
        "Begun",
        "Checked",
        "Clerk",
        "Collected",
        "Counted",
        "Crew",
        "Decomposed",
        "Deed",
        "Desk",
        "DeskWatch",
        "Diary",
        "Doorkeeper",
        "Doors",
        "Entered",
        "Evaluated",
        "EvidenceKeeper",
        "Failing",
        "Folds",
        "Forwarded",
        "Fuzzed",
        "GuardedDesk",
        "Habits",
        "HandDriven",
        "HandWheel",
        "Handed",
        "Happened",
        "Heard",
        "Held",
        "Instant",
        "IssuerDoor",
        "Judged",
        "Kept",
        "KeptRobot",
        "Killed",
        "Met",
        "Played",
        "Prepared",
        "Published",
        "Registered",
        "Remaining",
        "Remembered",
        "RosWords",
        "Rung",
        "Senses",
        "Sent",
        "Served",
        "Settled",
        "Shared",
        "Shelf",
        "Shipped",
        "Sought",
        "Spill",
        "Standing",
        "Superseded",
        "Surface",
        "Tape",
        "Threshold",
        "Throttled",
        "Told",
        "Trail",
        "Tried",
        "Unanswered",
        "Unchanged",
        "Understood",
        "Unforeseen",
        "Unheard",
        "Viewed",
        "Vigil",
        "Visitor",
        "Wanted",
        "Watched",
        "Wheel",
        "Word",
        "Worked",
        "Written",
        "attendant",
        "crew",
        "crews",
        "doorkeeper",
        "doors",
        "obey",
        "open_desk",
        "sought",
        "vigil",
        "visitor",
    }
)
"""Names that gave way to the field's terms. What is stored keeps its name: events, records, configuration keys."""
RETIRED_WORD = re.compile(rf"\b(?:{'|'.join(sorted(RETIRED))})\b")
PARTICIPLES = frozenset(
    {
        "asked", "begun", "entered", "evaluated", "happened", "heard", "kept", "killed", "meant", "published", "said",
        "searching", "settled", "shared", "shown", "sought", "told", "wanted", "watched", "worked",
    }
)  # fmt: skip
"""What happened to a thing names neither a function, nor a parameter, nor a variable."""
SPOKEN = ("told_", "said_")
"""How no function's name begins: it is named by what it returns."""
PREDICATES = "harness/verification/predicates"
"""A function here has the name of its predicate, which is stored in contracts."""
DIGESTED = "rsi_reviews/acceptance.py"
"""Its text is part of the digest that stored evaluations name: a renamed variable would be another predicate."""


def classes(tree: ast.AST) -> Iterator[str]:
    """Every class of a module, nested ones too."""
    return (node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef))


def repeated(read: Iterable[Module]) -> dict[str, list[str]]:
    """Class names that occur more than once, each with its modules."""
    found: defaultdict[str, list[str]] = defaultdict(list)
    for one in read:
        for name in classes(one.tree):
            found[name].append(one.path)
    return {name: places for name, places in found.items() if len(places) > 1}


def retired(text: str) -> set[str]:
    """Retired identifiers in a module, the parts of its own name included."""
    if not RETIRED_WORD.search(text):
        return set()
    names = {
        token.string for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type == tokenize.NAME
    }
    return names & RETIRED


def participles(tree: ast.AST) -> set[str]:
    """Functions, parameters and local variables of a module whose name is a participle. Stored fields are exempt."""
    functions = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)]
    inside = [node for one in functions for node in ast.walk(one)]
    names = {one.name for one in functions} | {one.arg for one in inside if isinstance(one, ast.arg)}
    names |= {one.id for one in inside if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
    spoken = {one.name for one in functions if one.name.strip("_").startswith(SPOKEN)}
    return {name for name in names if name.strip("_") in PARTICIPLES} | spoken


def test_a_class_name_stands_for_one_class() -> None:
    assert repeated(modules(*PRODUCT)) == {}


def test_names_that_were_given_up_do_not_come_back() -> None:
    found = {one.path: retired(one.text) for one in modules(*PRODUCT)}
    assert {path: names for path, names in found.items() if names} == {}


def test_a_participle_names_no_function_parameter_or_variable() -> None:
    exempt = (PREDICATES, DIGESTED)
    found = {one.path: participles(one.tree) for one in modules(*PRODUCT) if not one.path.startswith(exempt)}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "text",
    [
        "def _told(): ...",
        "def f(asked): ...",
        "def f():\n    kept = 1",
        "def f():\n    return [said for said in ()]",
        "def _told_again(): ...",
    ],
)
def test_a_participle_is_found(text: str) -> None:
    assert participles(ast.parse(text))


def test_no_module_is_named_by_a_retired_name() -> None:
    stems = {name.lower() for name in RETIRED}
    assert [one.path for one in modules(*PRODUCT) if Path(one.path).stem in stems] == []


@pytest.mark.parametrize("text", ["class Desk: ...", "crew = 1", "def f(visitor): ..."])
def test_a_retired_name_is_found(text: str) -> None:
    assert retired(text)


def test_a_repeated_class_name_is_found() -> None:
    read = [module("a.py", "class One: ..."), module("b.py", "class Two:\n    class One: ...")]
    assert repeated(read) == {"One": ["a.py", "b.py"]}


def test_the_root_of_the_console_holds_few_entries() -> None:
    entries = [one.name for one in (ROOT / "app").iterdir() if not re.match(r"__pycache__", one.name)]
    assert len(entries) <= 14, sorted(entries)
