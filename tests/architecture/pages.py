"""Compares what templates read with what page classes offer; types are followed through loops, includes and macros."""

import dataclasses
import inspect
import types
import typing
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field

import jinja2
import msgspec
from jinja2 import nodes

Scope = dict[str, object]
SAME_TYPE = frozenset({"list", "sort", "reverse", "selectattr", "rejectattr", "unique", "default"})
NAMES_AS_TEXT = frozenset({"selectattr", "rejectattr", "map", "sort", "groupby", "sum", "attr"})


@dataclass
class Reading:
    """What templates read: fields of known classes, names on unknown ones, and fields that do not exist."""

    environment: jinja2.Environment
    fields: set[tuple[type, str]] = field(default_factory=set)
    names: set[str] = field(default_factory=set)
    wrong: set[str] = field(default_factory=set)
    seen: set[tuple[str, str]] = field(default_factory=set)

    def template(self, name: str, scope: Scope) -> None:
        """Follow a template, and all it extends and includes, with these variables."""
        key = (name, str(sorted((key, str(value)) for key, value in scope.items())))
        if key in self.seen or self.environment.loader is None:
            return
        self.seen.add(key)
        source = self.environment.loader.get_source(self.environment, name)[0]
        _Walk(self, name, scope).all(self.environment.parse(source).body)


def class_of(kind: object) -> object:
    """The class itself of a class that is given its parameters, as `TabbedList[MissionItem]`."""
    origin = typing.get_origin(kind)
    return origin if dataclasses.is_dataclass(origin) else kind


def offered(given: object) -> Mapping[str, object]:
    """Name -> type of everything a template may read of an instance."""
    kind = class_of(given)
    assert isinstance(kind, type)
    known = dict(zip(getattr(kind, "__parameters__", ()), typing.get_args(given), strict=False))
    hints = {name: _with(hint, known) for name, hint in typing.get_type_hints(kind).items()}
    found: dict[str, object] = {name: hint for name, hint in hints.items() if not name.startswith("_")}
    for name, member in inspect.getmembers(kind):
        if name.startswith("_") or name in found:
            continue
        target = member.fget if isinstance(member, property) else getattr(member, "func", member)
        found[name] = typing.get_type_hints(target).get("return") if callable(target) else type(member)
    return found


def _with(hint: typing.Any, known: Mapping[object, object]) -> object:
    """A type with its parameters filled, as far as they are known."""
    parameters = getattr(hint, "__parameters__", ())
    return hint[tuple(known.get(one, one) for one in parameters)] if parameters and known else hint


def fields_of(kind: type) -> Collection[str]:
    """Names of the fields a page class declares."""
    return [item.name for item in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else []


def is_record(given: object) -> bool:
    """Whether a template may read named fields of this type."""
    kind = class_of(given)
    return isinstance(kind, type) and (dataclasses.is_dataclass(kind) or issubclass(kind, msgspec.Struct))


def inside(kind: object) -> Iterator[type]:
    """Every record class reachable from a page class through its fields and properties, itself included."""
    stack, seen = [kind], set()
    while stack:
        here = stack.pop()
        stack.extend(argument for argument in typing.get_args(here) if argument is not Ellipsis)
        here = class_of(here)
        if isinstance(here, type) and is_record(here) and here not in seen:
            seen.add(here)
            stack.extend(typing.get_type_hints(here).values())
            stack.extend(_computed(here))
            yield here


def _computed(kind: type) -> Iterator[object]:
    """Types of the properties of a class, cached or not."""
    for _, member in inspect.getmembers(kind):
        getter = member.fget if isinstance(member, property) else getattr(member, "func", None)
        if getter is not None:
            yield typing.get_type_hints(getter).get("return")


def plain(kind: object) -> object:
    """A type without its None and its annotations."""
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        rest = [argument for argument in typing.get_args(kind) if argument is not type(None)]
        return plain(rest[0]) if len(rest) == 1 else None
    if typing.get_origin(kind) is typing.Annotated:
        return plain(typing.get_args(kind)[0])
    return kind


def item_of(kind: object) -> object:
    """What a loop over this type yields, or None where that is not known."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        return arguments[0] if len(arguments) == 2 and arguments[1] is Ellipsis else None
    known = isinstance(origin, type) and issubclass(origin, Collection) and not issubclass(origin, Mapping)
    return arguments[0] if known and arguments else None


class _Walk:
    """Walks one template's body with its variables."""

    def __init__(self, reading: Reading, name: str, scope: Scope) -> None:
        self.reading, self.name, self.scope = reading, name, dict(scope)

    def all(self, body: Collection[nodes.Node]) -> None:
        for node in body:
            self.visit(node)

    def visit(self, node: nodes.Node) -> None:
        """Follow one statement or expression."""
        match node:
            case nodes.Expr():
                self.kind(node)
            case nodes.For():
                self._loop(node)
            case nodes.Assign():
                self._bind(node.target, self.kind(node.node))
            case nodes.Include() | nodes.Extends():
                for text in self._texts(node.template):
                    self.reading.template(text, self.scope)
            case nodes.FromImport():
                self._import(node)
            case nodes.Import():
                self.scope[node.target] = self._macros(node.template)
            case nodes.Macro():
                self.scope[node.name] = node
            case _:
                self.all(list(node.iter_child_nodes()))

    def kind(self, node: nodes.Node) -> object:
        """The type of an expression; records everything read on the way."""
        match node:
            case nodes.Name():
                return self.scope.get(node.name)
            case nodes.Getattr():
                return self._attribute(plain(self.kind(node.node)), node.attr)
            case nodes.Getitem():
                return item_of(plain(self.kind(node.node)))
            case nodes.Filter():
                return self._filtered(node)
            case nodes.Call():
                return self._called(node)
            case nodes.CondExpr():
                kinds = [self.kind(child) for child in node.iter_child_nodes()]
                return kinds[1] if len(kinds) > 1 else None
        for child in node.iter_child_nodes():
            self.kind(child)
        return None

    def _attribute(self, owner: object, name: str) -> object:
        if isinstance(owner, dict):
            return owner.get(name)
        kind = class_of(owner)
        if not isinstance(kind, type) or not is_record(kind):
            self.reading.names.add(name)
            return None
        self.reading.fields.add((kind, name))
        if name not in offered(owner):
            self.reading.wrong.add(f"{self.name} reads {name}, which {kind.__name__} does not offer")
        return offered(owner).get(name)

    def _filtered(self, node: nodes.Filter) -> object:
        if node.name in NAMES_AS_TEXT:
            self.reading.names |= {str(child.value) for child in node.find_all(nodes.Const)}
        kinds = [self.kind(child) for child in node.iter_child_nodes()]
        return kinds[0] if kinds and node.name in SAME_TYPE else None

    def _called(self, node: nodes.Call) -> object:
        macro = self.kind(node.node)
        given = [self.kind(argument) for argument in node.args]
        named = {keyword.key: self.kind(keyword.value) for keyword in node.kwargs}
        if isinstance(macro, nodes.Macro):
            names = [argument.name for argument in macro.args]
            scope = {**self.scope, **dict.fromkeys(names), **dict(zip(names, given, strict=False)), **named}
            key = (f"{macro.name}:{macro.lineno}", str(sorted((name, str(scope[name])) for name in names)))
            if key not in self.reading.seen:
                self.reading.seen.add(key)
                _Walk(self.reading, f"{self.name} ({macro.name})", scope).all(macro.body)
            return None
        return macro if typing.get_origin(macro) or is_record(macro) else None

    def _loop(self, node: nodes.For) -> None:
        walk = _Walk(self.reading, self.name, self.scope)
        walk._bind(node.target, item_of(plain(self.kind(node.iter))))
        for part in (*([node.test] if node.test else ()), *node.body, *node.else_):
            walk.visit(part)

    def _bind(self, target: nodes.Node, kind: object) -> None:
        if isinstance(target, nodes.Name):
            self.scope[target.name] = kind
        elif isinstance(target, nodes.Tuple):
            parts = typing.get_args(kind) if typing.get_origin(kind) is tuple else ()
            for index, item in enumerate(target.items):
                self._bind(item, parts[index] if index < len(parts) else None)

    def _import(self, node: nodes.FromImport) -> None:
        macros = self._macros(node.template)
        for name in node.names:
            original, alias = name if isinstance(name, tuple) else (name, name)
            self.scope[alias] = macros.get(original)

    def _macros(self, template: nodes.Expr) -> dict[str, object]:
        """The macros of an imported template, and what that template imports itself."""
        found: Scope = {}
        for text in self._texts(template):
            loader = self.reading.environment.loader
            assert loader is not None
            tree = self.reading.environment.parse(loader.get_source(self.reading.environment, text)[0])
            walk = _Walk(self.reading, text, {})
            walk.all([n for n in tree.body if isinstance(n, nodes.Macro | nodes.FromImport | nodes.Import)])
            found.update(walk.scope)
        self.scope.update({name: macro for name, macro in found.items() if name not in self.scope})
        return found

    def _texts(self, template: nodes.Expr) -> list[str]:
        return [
            str(node.value) for node in [template, *template.find_all(nodes.Const)] if isinstance(node, nodes.Const)
        ]
