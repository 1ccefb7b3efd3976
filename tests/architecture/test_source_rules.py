"""Checks rules of style over the sources: names, module docstrings, imports, unfinished work."""

import ast
import re
from collections.abc import Callable, Iterator

import pytest

from tests.architecture.sources import PACKAGES, Module, functions, module, modules

BANNED_WORDS = frozenset({"manager", "helper", "helpers", "util", "utils", "common", "misc", "v2", "enhanced", "smart"})
BANNED_LAST = frozenset({"data", "info"})
BANNED_VERBS = frozenset({"handle", "process"})


def unopened(source: Module) -> Iterator[str]:
    """Reports a module without a docstring."""
    if not source.is_init and not ast.get_docstring(source.tree):
        yield "opens without a sentence that says what the module is for"


def furnished(source: Module) -> Iterator[str]:
    """Reports an __init__ that is not empty."""
    if source.is_init and source.text.strip():
        yield "is not empty"


LATE = frozenset(
    {
        "alembic",
        "alembic.config",
        "app.background.foxglove_feed",
        "app.background.trace_export",
        "app.cli.local_api",
        "app.cli.output",
        "app.web.dossier_export",
        "app.web.report_pdf",
        "apprise",
        "foxglove",
        "harness.adapters.providers.topics.dds",
        "harness.adapters.providers.topics.foxglove",
        "harness.adapters.providers.topics.rosbridge",
        "harness.adapters.providers.topics.websocket_link",
        "harness.adapters.providers.vda5050.broker",
        "harness.adapters.stores.bucket_blobs",
        "laspy",
        "mcp.server.mcpserver",
        "mcp.server.mcpserver.exceptions",
        "rapidocr",
        "ruamel.yaml",
        "ruamel.yaml.comments",
        "simulator.in_process",
        "simulator.walking.body",
        "simulator.walking.sensors",
        "trimesh",
    }
)
"""What takes long to load and what few commands use: imported where it is used. None of it closes a circle."""


def hidden_imports(source: Module) -> Iterator[str]:
    """Reports an import inside a function or a class, a relative or star import, or one behind TYPE_CHECKING."""
    top = {id(node) for node in source.tree.body}
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = {node.module} if isinstance(node, ast.ImportFrom) else {alias.name for alias in node.names}
            if id(node) not in top and not names <= LATE:
                yield f"line {node.lineno}: an import that is not at the top"
            if isinstance(node, ast.ImportFrom) and (node.level or any(alias.name == "*" for alias in node.names)):
                yield f"line {node.lineno}: a relative or star import"
        if isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node).endswith("TYPE_CHECKING"):
            yield f"line {node.lineno}: TYPE_CHECKING hides a cycle"


def banned_names(source: Module) -> Iterator[str]:
    """Reports a file, class or function with a banned name."""
    named = [(source.path.rpartition("/")[2].removesuffix(".py"), 1)]
    named += [(node.name, node.lineno) for node in ast.walk(source.tree) if isinstance(node, ast.ClassDef)]
    named += [(node.name, node.lineno) for node in functions(source.tree)]
    given = {
        id(method) for kind in ast.walk(source.tree) if isinstance(kind, ast.ClassDef) for method in _overrides(kind)
    }
    verbs = {node.name for node in functions(source.tree) if id(node) not in given}
    for name, line in named:
        words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z][a-z0-9]*|[a-z0-9]+", name)]
        if not words:
            continue
        if BANNED_WORDS & set(words) or words[-1] in BANNED_LAST or (name in verbs and words[0] in BANNED_VERBS):
            yield f"line {line}: the name {name} says nothing"


def _overrides(kind: ast.AST) -> list[ast.stmt]:
    """Methods of a class with bases: a library may give their names."""
    return kind.body if isinstance(kind, ast.ClassDef) and kind.bases else []


def doubts(source: Module) -> Iterator[str]:
    """Reports unfinished work left in the code."""
    for number, line in enumerate(source.text.splitlines(), start=1):
        if re.search(r"\b(TODO|FIXME|XXX|HACK)\b|NotImplementedError", line):
            yield f"line {number}: unfinished: {line.strip()}"


RULES: tuple[Callable[[Module], Iterator[str]], ...] = (
    unopened,
    furnished,
    hidden_imports,
    banned_names,
    doubts,
)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_every_file_keeps_the_rule(rule: Callable[[Module], Iterator[str]]) -> None:
    everywhere = modules(*PACKAGES, "experiments/benchmarks", "tools")
    assert [f"{source.path}: {wrong}" for source in everywhere for wrong in rule(source)] == []


@pytest.mark.parametrize(
    ("rule", "path", "text"),
    [
        (unopened, "harness/x.py", "x = 1"),
        (furnished, "harness/__init__.py", "from harness.x import y"),
        (hidden_imports, "harness/x.py", "def f():\n    import os"),
        (hidden_imports, "harness/x.py", "from . import y"),
        (hidden_imports, "harness/x.py", "import typing\nif typing.TYPE_CHECKING:\n    x = 1"),
        (banned_names, "harness/utils.py", ""),
        (banned_names, "harness/x.py", "class LeaseManager: ..."),
        (banned_names, "harness/x.py", "def handle_event(): ..."),
        (banned_names, "harness/x.py", "def pose_data(): ..."),
        (doubts, "harness/x.py", "x = 1  # TO" + "DO later"),
    ],
)
def test_a_breach_of_the_rule_is_found(rule: Callable[[Module], Iterator[str]], path: str, text: str) -> None:
    assert list(rule(module(path, text)))


def test_nouns_that_share_a_letter_with_a_banned_word_are_free() -> None:
    text = "class RobotProcess: ...\ndef invocation_handle(): ...\ndef data_folder(): ..."
    text += "\nclass Quiet(Server):\n    def handle_exit(self): ..."
    assert list(banned_names(module("harness/x.py", text))) == []
