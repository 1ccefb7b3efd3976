"""Checks that every module of the product is reachable from an entry point of the product, not from tests alone."""

import ast
import re
import tomllib
from collections.abc import Iterable, Iterator

import grimp
import pytest

from tests.architecture.sources import PACKAGES, ROOT, Module, modules

ALEMBIC = "harness.adapters.stores.migrations"
"""Alembic runs this folder's scripts by their place; `sql_schema` names the folder."""


def named_in(source: Module, known: frozenset[str]) -> Iterator[str]:
    """Modules that a module names instead of importing: `-m package`, `import_module("...")`, "module:attribute" in a
    table of commands, and the file of a child process.
    """
    prefixes = ("", *(f"{found}." for found in re.findall(r'f"([\w.]+)\.\{', source.text)))
    siblings = source.name.rpartition(".")[0]
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            word = node.value.partition(":")[0]
            candidates = [f"{prefix}{word}" for prefix in prefixes] + [f"{word}.__main__"]
            if word.endswith(".py"):
                candidates.append(f"{siblings}.{word.removesuffix('.py')}")
            yield from (name for name in candidates if name in known)


def unreached(graph: grimp.ImportGraph, sources: Iterable[Module], entries: Iterable[str]) -> list[str]:
    """Modules that no chain of imports and names connects to an entry point. Empty packages do not count."""
    by_name = {source.name: source for source in sources}
    known = frozenset(by_name)
    reached, waiting = set[str](), list(entries)
    while waiting:
        name = waiting.pop()
        if name in reached or name not in known:
            continue
        reached.add(name)
        waiting += graph.find_modules_directly_imported_by(name)
        waiting += named_in(by_name[name], known)
        if name == ALEMBIC.rpartition(".")[0] + ".sql_schema":
            waiting += (one for one in known if one.startswith(f"{ALEMBIC}."))
    return sorted(one.name for one in by_name.values() if one.name not in reached and one.tree.body and not one.is_init)


def entry_points() -> list[str]:
    """How an installed product can be started: the scripts of pyproject.toml."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    return [target.partition(":")[0] for target in scripts.values()]


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    return grimp.build_graph(*PACKAGES, cache_dir=None)


def test_every_module_is_reached_from_an_entry_point_of_the_product(graph: grimp.ImportGraph) -> None:
    assert unreached(graph, modules(*PACKAGES), entry_points()) == []


def test_a_module_that_only_tests_import_is_found(graph: grimp.ImportGraph) -> None:
    lonely = Module(path="harness/memory/lonely.py", text="x = 1", tree=ast.parse("x = 1"))
    assert "harness.memory.lonely" in unreached(graph, [*modules(*PACKAGES), lonely], entry_points())


def test_what_a_lost_entry_point_alone_reached_is_found(graph: grimp.ImportGraph) -> None:
    assert "app.cli.dossiers" in unreached(graph, modules(*PACKAGES), ["app.main"])
