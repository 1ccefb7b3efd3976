"""Every reason that the code gives has a sentence, every sentence a reason, and its holes are the facts given."""

import ast
from collections.abc import Iterator
from string import Formatter

from app.catalogues import LOCALES
from app.reasons.rendering import BETWEEN, SENTENCES
from app.settings import ROOT
from harness.contracts.reasons import RECORDED, SEVERAL
from tools import translations

SPEAKERS = ("harness", "rsi_reviews", "app")
MAKERS = ("because", "refused")


def given() -> Iterator[tuple[str, frozenset[str], str]]:
    """(code, names of its facts, where) of every reason that the sources make."""
    for path in sorted(path for part in SPEAKERS for path in (ROOT / part).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and _name(node.func) in MAKERS and not _has_reason(node):
                facts = frozenset(str(one.arg) for one in node.keywords)
                where = f"{path.relative_to(ROOT)}:{node.lineno}"
                yield from ((code, facts, where) for code in _codes(node.args[0]))


def _name(function: ast.expr) -> str:
    return getattr(function, "id", None) or getattr(function, "attr", "")


def _has_reason(call: ast.Call) -> bool:
    """Whether a refusal has a reason of its own, so that its rule is no code."""
    return _name(call.func) == "refused" and len(call.args) > 1


def _codes(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Constant(value=str(code)):
            yield code
        case ast.IfExp(body=body, orelse=other):
            yield from _codes(body)
            yield from _codes(other)
        case ast.Name(id="RECORDED" | "SEVERAL"):
            yield {"RECORDED": RECORDED, "SEVERAL": SEVERAL}[node.id]
        case _:
            raise AssertionError(f"a code is a literal: {ast.unparse(node)}")


def holes(message: str) -> frozenset[str]:
    return frozenset(name for _, name, _, _ in Formatter().parse(message) if name)


def test_every_code_has_a_sentence_and_every_sentence_a_user() -> None:
    used = {code for code, _, _ in given()}
    assert used - SENTENCES.keys() == set()
    assert SENTENCES.keys() - used == set()


def test_the_holes_of_a_sentence_are_the_facts_that_are_given() -> None:
    wrong = [(code, where, facts ^ holes(SENTENCES[code])) for code, facts, where in given() if code in SENTENCES]
    assert [one for one in wrong if one[2]] == []


def test_every_sentence_keeps_its_holes_in_every_language() -> None:
    for tag in set(BETWEEN) - {"en"}:
        catalogue = translations.read(LOCALES[tag])
        assert [one for one in SENTENCES.values() if holes(catalogue.get(one, one)) != holes(one)] == []
