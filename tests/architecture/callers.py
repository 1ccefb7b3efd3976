"""Finds code that uses a port's guarded methods, by the receiver's name and by its annotated type."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

from tests.architecture.sources import Module, functions


@dataclass(frozen=True)
class Guard:
    """Methods of a port that few modules may call; the receiver is recognised by its name or its annotated type."""

    methods: frozenset[str]
    receiver: re.Pattern[str]
    types: frozenset[str]


EVENT_STORE = Guard(
    methods=frozenset({"append"}),
    receiver=re.compile(r"(^|[._])(event_?)?store(\(\))?$|(^|[._])event_?log(\(\))?$", re.IGNORECASE),
    types=frozenset(
        {"EventStore", "SqlLog", "SqlEventStore", "PostgresEventStore", "MemoryEventStore", "FailpointStore"}
    ),
)
PROVIDER = Guard(
    methods=frozenset({"start", "stop", "resume", "keepalive"}),
    receiver=re.compile(r"providers?(\(.*\)|\[.*\])*$|provider_\w+\(.*\)$", re.IGNORECASE),
    types=frozenset({"Provider", "HttpProvider"}),
)


def touches(module: Module, guard: Guard) -> Iterator[tuple[int, str]]:
    """(line, text) of every use of a guarded method, called or passed on as a value."""
    typed = frozenset(_typed_names(module.tree, guard.types))
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Attribute) and node.attr in guard.methods and isinstance(node.ctx, ast.Load):
            receiver = ast.unparse(node.value)
            if guard.receiver.search(receiver) or receiver in typed:
                yield node.lineno, ast.unparse(node)


def forwarded(module: Module, guard: Guard) -> frozenset[int]:
    """Lines inside methods that are themselves the guarded method: a decorator of the port that passes the call on."""
    lines: set[int] = set()
    for function in functions(module.tree):
        if function.name in guard.methods:
            lines.update(range(function.lineno, (function.end_lineno or function.lineno) + 1))
    return frozenset(lines)


def _typed_names(tree: ast.Module, types: frozenset[str]) -> Iterator[str]:
    """Names, and attributes of self, that are annotated with one of the types."""
    for node in ast.walk(tree):
        if isinstance(node, ast.arg) and _mentions(node.annotation, types):
            yield node.arg
            yield f"self.{node.arg}"
            yield f"self._{node.arg}"
        elif isinstance(node, ast.AnnAssign) and _mentions(node.annotation, types):
            yield ast.unparse(node.target)
            yield f"self.{ast.unparse(node.target)}"
        elif isinstance(node, ast.For | ast.comprehension) and _mentions_provider(node.iter, types):
            yield ast.unparse(node.target)


def _mentions(annotation: ast.expr | None, types: frozenset[str]) -> bool:
    if annotation is None:
        return False
    return bool(types & set(re.findall(r"\w+", ast.unparse(annotation)))) and not _is_collection(annotation)


def _is_collection(annotation: ast.expr) -> bool:
    """A dict or a sequence of ports is not itself a port; an element is recognised by its name or by the loop."""
    return isinstance(annotation, ast.Subscript) and ast.unparse(annotation.value) != "Annotated"


def _mentions_provider(iterated: ast.expr, types: frozenset[str]) -> bool:
    return "Provider" in types and bool(re.search(r"providers?(\(\)|\.values\(\))?$", ast.unparse(iterated)))
