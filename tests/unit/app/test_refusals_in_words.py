"""Every reason of a refusal has one sentence, every sentence a user, and its holes are the facts that are given."""

import ast
import re
from collections.abc import Iterator
from string import Formatter

import pytest

from app.catalogues import LOCALES, translated
from app.reasons import console, gate, planning, rendering, restrictions, reviews, supervision
from app.settings import ROOT
from harness.contracts.reasons import because
from harness.gate.rules import GATE_RULES

TABLES = (console, gate, planning, restrictions, reviews, supervision)
MADE = ("harness/gate", "harness/planning", "harness/exploration", "harness/recovery", "harness/supervisor",
        "harness/runtime.py", "rsi_reviews", "app")  # fmt: skip
EXAMPLES = (
    (because("too_few_people", quorum=2, reviewers=1, releasers=1), "2 approvals and a releaser", "需要 2 个批准"),
    (because("lease_held", resource="base", invocation_id="inv_1", mission_id="msn_1"), "base is held", "base"),
    (because("stage_missing", stages=("go", "look")), "go, look", "go、look"),
    (because("target_too_far", at="(1.00, 2.00)", way_m=9.04, longest_m=8.0), "9.0 m away", "9.0"),
    (because("robot_on_another_map", robot_map="b", way_map="a"), "on map b, the way on a", "b"),
    (because("ladder_end", limit=8), "within 8 rungs", "8"),
    (because("no_supervisor_here"), "No supervisor runs here", "没有监督者"),
)


def given() -> Iterator[tuple[str, frozenset[str] | None]]:
    """(code, names of its facts) wherever one is made in the sources; None where a dict is handed on."""
    for part in MADE:
        top = ROOT / part
        for path in [top] if top.is_file() else top.rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                    yield from of_call(node, node.func.id)


def of_call(node: ast.Call, name: str) -> Iterator[tuple[str, frozenset[str] | None]]:
    at = {"because": 0, "refused": 0, "_refusal": 4}.get(name)
    if at is None or len(node.args) <= at or (name == "refused" and len(node.args) > 1):
        return
    facts = None if any(one.arg is None for one in node.keywords) else frozenset(str(one.arg) for one in node.keywords)
    for code in ast.walk(node.args[at]):
        if isinstance(code, ast.Constant) and isinstance(code.value, str):
            yield code.value, facts


def holes(message: str) -> frozenset[str]:
    return frozenset(name for _, name, _, _ in Formatter().parse(message) if name)


def test_no_two_tables_say_the_same_code() -> None:
    codes = [code for table in TABLES for code in table.SENTENCES]
    assert len(codes) == len(set(codes))


def test_every_code_that_is_given_has_a_sentence_whose_holes_are_its_facts() -> None:
    wrong = []
    for code, facts in given():
        message = rendering.SENTENCES.get(code)
        if message is None:
            wrong.append(f"{code} has no sentence")
        elif facts is not None and holes(message) != facts:
            wrong.append(f"{code}: {sorted(facts)} fill {message!r}")
    assert wrong == []


def test_every_sentence_is_said_somewhere() -> None:
    sources = "".join(
        path.read_text(encoding="utf-8")
        for part in ("harness", "rsi_reviews", "app")
        for path in (ROOT / part).rglob("*.py")
        if "reasons" not in path.parts
    )
    said = set(re.findall(r'"(\w+)"', sources))
    assert [code for table in TABLES for code in table.SENTENCES if code not in said] == []


def test_every_rule_of_the_gate_has_a_sentence_of_its_name() -> None:
    assert [rule.__name__ for rule in GATE_RULES if rule.__name__ not in gate.SENTENCES] == []


@pytest.mark.parametrize("table", TABLES)
def test_a_translation_has_the_holes_of_its_message(table: object) -> None:
    messages = getattr(table, "SENTENCES").values()  # noqa: B009  (a module has no type of its own)
    for language in LOCALES:
        assert [one for one in messages if holes(translated(one, language)) != holes(one)] == []


@pytest.mark.parametrize(("reason", "english", "chinese"), EXAMPLES)
def test_each_table_is_said_in_the_reader_s_language(reason: rendering.Reason, english: str, chinese: str) -> None:
    assert english in rendering.sentence(reason)
    assert chinese in rendering.sentence(reason, "zh-Hans")
