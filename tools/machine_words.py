"""Extracts the sentences of the runtime that pages show: texts of the sources, and of the task templates.

A text with expressions in it is one message; each hole is named by its expression.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import yaml

from app.settings import ROOT
from harness.contracts.fields import fields

SPEAKERS = ("harness", "simulator", "rsi_reviews", "app")
FIELDS = "fields of a configuration"
HEARD = (
    "harness/verification", "harness/recovery", "harness/routing", "harness/baseline/templates",
    "harness/baseline/further", FIELDS,
    "rsi_reviews/acceptance.py", "rsi_reviews/canary.py", "rsi_reviews/pointer_rules.py", "rsi_reviews/release.py",
    "rsi_reviews/review.py", "rsi_reviews/approval_policy.py",
)  # fmt: skip
"""Whose every sentence must be told in every language: what a person reads before deciding."""
SPOKEN = ("title", "goal", "subgoal", "text")
"""Keys of a task template whose values people read."""
LOOSE = (
    "{disagreement_m} m, bound {bound_m} m", "{text}: {verdict}, {reason}", "{failure} ({said})",
    "{layer} vetoed: {reason}", "Where: {where}", "{either}. Goal: {goal}", "that", "not that",
)  # fmt: skip
"""Shorter than a sentence, and said all the same."""
PIECED = {"{action} by {provider}": "harness/recovery/ladder.py"}
"""Put together from pieces where it is said."""
RAISED = "raised in "
_WORDS = re.compile(r"[A-Za-z]{2,}\W+(?:\w+\W+)*[A-Za-z]{2,}")
_CODE = re.compile(r"^<|\w=|=\W?\"|\n|%s|--|\\|^\W*$|\.py\b")
_SLUGS = re.compile(r"\bone of |^matches |\w\.\w+\.\{")
_SPOT = re.compile(r"\$\{(\w+)(?:\.(\w+))?\}")


@cache
def sentences() -> dict[str, str]:
    """Every sentence -> the first place it occurs."""
    found: dict[str, str] = {}
    for path in sorted((ROOT / "harness" / "baseline").rglob("*.yaml")):
        for message in _of_template(yaml.safe_load(path.read_text(encoding="utf-8"))):
            found.setdefault(message, path.relative_to(ROOT).as_posix())
    for field in fields():
        for message in (field.meaning, field.bound, field.unit):
            found.setdefault(message, FIELDS)
    for path in sorted(path for part in SPEAKERS for path in (ROOT / part).rglob("*.py")):
        for message, raised in _of_code(path):
            found.setdefault(message.strip(), f"{RAISED if raised else ''}{path.relative_to(ROOT).as_posix()}")
    return PIECED | {message: where for message, where in found.items() if _is_sentence(message)}


def heard() -> dict[str, tuple[str, ...]]:
    """Sentences that must be translated into every language, with their place: without raised ones and without
    lists of slugs.
    """
    every = sentences().items()
    return {one: (where,) for one, where in every if where.startswith(HEARD) and not _SLUGS.search(one)}


def _is_sentence(message: str) -> bool:
    plain = re.sub(r"\{\w+\}", "", message)
    return message in LOOSE or (bool(_WORDS.search(plain)) and not _CODE.search(message))


def _of_code(path: Path) -> Iterator[tuple[str, bool]]:
    """(message, whether it is raised): every text but documentation and parts of other texts."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    raised = {id(part) for node in nodes if isinstance(node, ast.Raise) for part in ast.walk(node)}
    skipped = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(part) for part in node.values if isinstance(part, ast.Constant)}
    for node in nodes:
        if id(node) in skipped:
            continue
        if isinstance(node, ast.JoinedStr):
            yield _holed(node), id(node) in raised
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value, id(node) in raised


def _holed(text: ast.JoinedStr) -> str:
    names: list[str] = []
    parts = []
    for part in text.values:
        if isinstance(part, ast.Constant):
            parts.append(str(part.value))
        elif isinstance(part, ast.FormattedValue):
            name = _name(part.value)
            names.append(name)
            parts.append(f"{{{name}{'' if names.count(name) == 1 else f'_{names.count(name)}'}}}")
    return "".join(parts)


def _name(node: ast.expr) -> str:
    """The subject of an expression, in one word."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case ast.Subscript(value=value):
            return _name(value)
        case ast.Call(func=ast.Name(), args=[first, *_]):
            return _name(first)
        case ast.Call(func=func):
            return _name(func)
        case ast.BoolOp(values=[*_, ast.Constant(value=str(instead))]) if " " in instead:
            return "either"
        case _:
            return "value"


def _of_template(tree: object) -> Iterator[str]:
    match tree:
        case dict():
            for key, value in tree.items():
                if key in SPOKEN and isinstance(value, str):
                    yield _SPOT.sub(lambda spot: f"{{{'_'.join(filter(None, spot.groups()))}}}", value)
                else:
                    yield from _of_template(value)
        case list():
            for value in tree:
                yield from _of_template(value)
