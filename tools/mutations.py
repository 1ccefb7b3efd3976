"""Breaks one definition on its syntax tree. Pure: source in, broken source out, or None if nothing changes."""

import ast
import copy
from collections.abc import Callable

from tools.marks import Definition, find_definition

_OPPOSITE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}


def mutated(source: str, *, qualname: str, operator: str) -> str | None:
    """The module with one definition broken by the operator of that name; None if it does not apply."""
    tree = ast.parse(source)
    found = find_definition(tree, qualname)
    if found is None:
        return None
    before = ast.dump(found)
    for target in _functions(found) or [found]:
        OPERATORS[operator](target)
    if ast.dump(found) == before:
        return None
    return ast.unparse(ast.fix_missing_locations(tree))


def planted(source: str, *, expression: str) -> str:
    """The module with a function appended that evaluates a forbidden expression."""
    return f"{source}\n\ndef planted(store, provider, robot):\n    return {expression}\n"


def raises(target: Definition) -> None:
    """The body only raises."""
    if not isinstance(target, ast.ClassDef):
        target.body = ast.parse("raise AssertionError('broken on purpose')").body


def returns_nothing(target: Definition) -> None:
    """The body returns None, or yields nothing if it was a generator."""
    if not isinstance(target, ast.ClassDef):
        nothing = "return\nyield" if _is_generator(target) else "return None"
        target.body = ast.parse(f"def body():\n    {nothing.replace(chr(10), chr(10) + '    ')}").body[0].body  # type: ignore[attr-defined]


def negates_comparisons(target: Definition) -> None:
    """Every single comparison is inverted."""
    for node in ast.walk(target):
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            node.ops = [_OPPOSITE[type(node.ops[0])]()]


def drops_the_last_statement(target: Definition) -> None:
    """Removes the last statement of the body; for a class without methods, its last field."""
    body = [node for node in target.body if not _is_docstring(node)]
    if len(body) > 1 or isinstance(target, ast.ClassDef):
        target.body = [*body[:-1], ast.Pass()]


def conditions_always_hold(target: Definition) -> None:
    """Every `if` and every conditional expression takes its first branch; every `not` is dropped."""
    _Folded(always=True).visit(target)


def conditions_never_hold(target: Definition) -> None:
    """Every `if` and every conditional expression takes its second branch; every boolean constant is False."""
    _Folded(always=False).visit(target)


OPERATORS: dict[str, Callable[[Definition], None]] = {
    "raise": raises,
    "return None": returns_nothing,
    "negate comparisons": negates_comparisons,
    "drop the last statement": drops_the_last_statement,
    "conditions always hold": conditions_always_hold,
    "conditions never hold": conditions_never_hold,
}

BLUNT = frozenset({"raise", "return None"})


class _Folded(ast.NodeTransformer):
    def __init__(self, *, always: bool) -> None:
        self.always = ast.Constant(value=always)

    def visit_If(self, node: ast.If) -> ast.If:
        self.generic_visit(node)
        node.test = copy.copy(self.always)
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.IfExp:
        self.generic_visit(node)
        node.test = copy.copy(self.always)
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        return copy.copy(self.always) if isinstance(node.value, bool) else node


def _functions(found: Definition) -> list[Definition]:
    """The functions to break: the definition itself, or a class's methods."""
    if not isinstance(found, ast.ClassDef):
        return [found]
    return [node for node in found.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _is_generator(target: Definition) -> bool:
    return any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(target))
