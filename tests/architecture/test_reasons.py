"""Checks that every reason in the code has a sentence, that every sentence has a reason, and that its holes are the
facts given.
"""

import ast
import importlib
import pkgutil
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from string import Formatter

import pytest

from app.i18n import reasons as subjects
from app.i18n.catalogues import LOCALES
from app.i18n.reasons import rendering
from app.i18n.reasons.rendering import BETWEEN, REMEDIES, SENTENCES
from harness.contracts import errors
from harness.contracts.reasons import RECORDED, SEVERAL
from harness.provider_protocol.wire import ROBOT_REASONS
from rsi_reviews.regression import errors as regression_errors
from tests.architecture.sources import Module, modules
from tools import translations

SPEAKERS = ("harness", "rsi_reviews", "app", "simulator")
ROBOTS = ("simulator/", "harness/provider_protocol/")
"""What runs at the robot's end of the provider protocol."""
MAKERS = {"because": 0, "refused": 0, "_refusal": 4}
"""Functions that make a reason, and which of their arguments is its code."""
UNSAID = {"first_eligible": {"subgoal"}, "first_waiting": {"subgoal"}, "skill_proposed": {"subgoal"}}
"""Facts for programs: the text of a stage, which the console says in the reader's language beside its name."""


@cache
def given() -> tuple[tuple[str, frozenset[str] | None, str], ...]:
    """(code, names of its facts, position) of every reason in the sources; None for the names where a dict is
    passed on.
    """
    return tuple(found for source in modules(*SPEAKERS) for found in _given_in(source))


def _given_in(source: Module) -> Iterator[tuple[str, frozenset[str] | None, str]]:
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and _makes_code(node, node.func.id):
            handed_on = any(one.arg is None for one in node.keywords)
            facts = None if handed_on else frozenset(str(one.arg) for one in node.keywords)
            where = f"{source.path}:{node.lineno}"
            codes = _codes(node.args[MAKERS[node.func.id]], handed_on=handed_on)
            yield from ((code, facts, where) for code in codes)


def _makes_code(call: ast.Call, name: str) -> bool:
    """Whether the call creates a code: a refusal with its own reason does; `refused` in the web's middleware
    has a scope.
    """
    if name not in MAKERS or len(call.args) <= MAKERS[name]:
        return False
    return name != "refused" or (len(call.args) == 1 and ast.unparse(call.args[0]) != "scope")


def _codes(node: ast.expr, *, handed_on: bool) -> Iterator[str]:
    match node:
        case ast.Constant(value=str(code)):
            yield code
        case ast.IfExp(body=body, orelse=other):
            yield from _codes(body, handed_on=handed_on)
            yield from _codes(other, handed_on=handed_on)
        case ast.Name(id="RECORDED" | "SEVERAL"):
            yield {"RECORDED": RECORDED, "SEVERAL": SEVERAL}[node.id]
        case ast.Name(id="code" | "rule") if handed_on:
            return
        case _:
            raise AssertionError(f"a code is a literal: {ast.unparse(node)}")


def tables() -> Iterator[Mapping[str, str]]:
    """The table of each subject: two of them with the same code would hide one another's sentence."""
    for module in pkgutil.iter_modules(subjects.__path__, prefix=f"{subjects.__name__}."):
        if module.name != rendering.__name__:
            yield importlib.import_module(module.name).SENTENCES


def test_a_code_stands_in_the_table_of_one_subject() -> None:
    counts = Counter(code for table in tables() for code in table)
    assert len(counts) > 500 and [code for code, count in counts.items() if count > 1] == []


def holes(message: str) -> frozenset[str]:
    return frozenset(name for _, name, _, _ in Formatter().parse(message) if name)


def test_every_code_has_a_sentence_and_every_sentence_a_user() -> None:
    used = {code for code, _, _ in given()}
    assert used - SENTENCES.keys() == set()
    assert SENTENCES.keys() - used == set()


def test_the_holes_of_a_sentence_and_of_what_to_do_are_the_facts_that_are_given() -> None:
    told = [one for one in given() if one[0] in SENTENCES and one[1] is not None]
    assert [
        one
        for one in told
        if one[1] - UNSAID.get(one[0], set()) != holes(SENTENCES[one[0]]) | holes(REMEDIES.get(one[0], ""))
    ] == []


def test_what_a_robots_program_says_crosses_the_protocol_and_nothing_else_does() -> None:
    said = {code: facts for code, facts, where in given() if where.startswith(ROBOTS)}
    assert {code: facts for code, facts in said.items() if ROBOT_REASONS.get(code) != facts} == {}
    unsaid = ROBOT_REASONS.keys() - said.keys()
    assert unsaid == set()


def spoken(tree: ast.AST) -> list[str]:
    """What a module raises or explains with a sentence of its own, where a code with facts belongs."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            name = ast.unparse(node.exc.func).rpartition(".")[2]
            given_words = [*node.exc.args[:1], *(one.value for one in node.exc.keywords if one.arg in ("what", "do"))]
            if isinstance(getattr(errors, name, getattr(regression_errors, name, None)), type):
                found += [ast.unparse(one) for one in given_words if _sentence(one)]
    return found


def _sentence(node: ast.expr) -> bool:
    text = node.values if isinstance(node, ast.JoinedStr) else [node]
    words = "".join(str(one.value) for one in text if isinstance(one, ast.Constant)).split()
    return len([word for word in words if word.isalpha()]) > 1


def test_below_the_console_an_error_is_raised_by_code_and_not_in_a_language() -> None:
    found = {source.path: spoken(source.tree) for source in modules("harness", "rsi_reviews", "simulator")}
    assert {path: sentences for path, sentences in found.items() if sentences} == {}


@pytest.mark.parametrize(
    "text",
    [
        'raise ProviderFailed("The robot is busy")',
        'raise errors.StoreUnavailable(f"No folder {name}")',
        'raise WorkersLost(because("worker_silent"), do="try again")',
    ],
)
def test_an_error_that_speaks_is_found(text: str) -> None:
    assert spoken(ast.parse(text))


def test_what_to_do_is_said_of_a_code_that_has_a_sentence() -> None:
    assert REMEDIES.keys() - SENTENCES.keys() == set()


def test_every_sentence_keeps_its_holes_in_every_language() -> None:
    for tag in set(BETWEEN) - {"en"}:
        catalogue = translations.read(LOCALES[tag])
        assert [
            one for one in (*SENTENCES.values(), *REMEDIES.values()) if holes(catalogue.get(one, one)) != holes(one)
        ] == []
