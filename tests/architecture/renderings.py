"""Finds where the console renders which template, and the class of its page, by annotations."""

import ast
import importlib
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from tests.architecture.pages import is_record, plain
from tests.architecture.sources import Function, Module, functions


@dataclass(frozen=True)
class Rendering:
    """One `render("x.html", page)`: the position, the template, and the page's class, None if it cannot be
    determined.
    """

    where: str
    template: str
    page: Any


def renderings(source: Module) -> Iterator[Rendering]:
    """Every rendering of a page in one module, which must be importable."""
    for function in functions(source.tree):
        for call in ast.walk(function):
            template, page = _given(call) if isinstance(call, ast.Call) else ("", None)
            if template and page:
                kind = _Names(importlib.import_module(source.name), function).kind(page)
                yield Rendering(f"{source.path}:{page.lineno}", template, kind if is_record(kind) else None)


def _given(call: ast.Call) -> tuple[str, ast.expr | None]:
    """The template's name and the page: the argument after the name, or the keyword `page`."""
    for index, argument in enumerate(call.args):
        if isinstance(argument, ast.Constant) and str(argument.value).endswith(".html"):
            named = [keyword.value for keyword in call.keywords if keyword.arg == "page"]
            return str(argument.value), next(iter((*call.args[index + 1 :], *named)), None)
    return "", None


class _Names:
    """The types of the names inside one function, as far as annotations give them."""

    def __init__(self, module: types.ModuleType, function: Function) -> None:
        self.module, self.function = module, function
        arguments = (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
        self.parameters = {argument.arg: argument.annotation for argument in arguments}

    def kind(self, expression: ast.expr) -> object:
        """The type of a value, or None."""
        match expression:
            case ast.Call(func=called):
                made = self._callable(called)
                return made if isinstance(made, type) else _returned(made)
            case ast.IfExp(body=body):
                return self.kind(body)
            case ast.Name(id=name) if self.parameters.get(name) is not None:
                annotation = self.parameters[name]
                assert annotation is not None
                return plain(eval(ast.unparse(annotation), vars(self.module)))
            case ast.Name(id=name):
                return self._assigned(name)
            case ast.Attribute(value=owner, attr=name):
                kind = self.kind(owner)
                return plain(typing.get_type_hints(kind).get(name)) if isinstance(kind, type) else None
        return None

    def _assigned(self, name: str) -> object:
        for node in ast.walk(self.function):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
                return self.kind(node.value)
        return None

    def _callable(self, called: ast.expr) -> object:
        """The function, method or class that a call names."""
        if isinstance(called, ast.Name):
            return getattr(self.module, called.id, None)
        if isinstance(called, ast.Attribute):
            owner = self._owner(called.value)
            return getattr(owner, called.attr, None)
        return None

    def _owner(self, owner: ast.expr) -> object:
        if isinstance(owner, ast.Name) and isinstance(getattr(self.module, owner.id, None), types.ModuleType):
            return getattr(self.module, owner.id)
        return self.kind(owner)


def _returned(made: object) -> object:
    return plain(typing.get_type_hints(made).get("return")) if callable(made) else None
