"""Checks that every option and command of `regen` that a message advises exists."""

import ast
import re
from collections.abc import Iterator
from typing import Any

import click
import pytest
from typer.main import get_command

from app.cli.main import app
from app.i18n.reasons.rendering import REMEDIES, SENTENCES
from tests.architecture.sources import modules

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
COMMAND = re.compile(r"\bregen ((?:[a-z]+ ?){1,2})")
ELSEWHERE = frozenset({"--help", "--head", "--no-deps"})
"""Options of every command, of `ray start` and of `pip install`."""
SAID = frozenset({"do", "where", "what", "param_hint", "help"})
"""Arguments that a person reads."""


def commands(group: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command and group of `regen` with the words that call it."""
    context = click.Context(group)
    for name in group.list_commands(context):
        found = group.get_command(context, name)
        yield (*words, name), found
        if isinstance(found, click.Group) or hasattr(found, "list_commands"):
            yield from commands(found, (*words, name))


def messages() -> Iterator[tuple[str, str]]:
    """(where it stands, text) of everything that a person may read because something went wrong."""
    yield from (("reasons", text) for text in (*SENTENCES.values(), *REMEDIES.values()))
    for source in modules("app", "harness", "rsi_reviews"):
        for node in ast.walk(source.tree):
            if not isinstance(node, ast.Call):
                continue
            raised = isinstance(node.func, ast.Name) and node.func.id[:1].isupper()
            given = [one.value for one in node.keywords if one.arg in SAID] + (node.args[:1] if raised else [])
            for part in (one for value in given for one in ast.walk(value)):
                if isinstance(part, ast.Constant) and isinstance(part.value, str):
                    yield f"{source.path}:{part.lineno}", part.value


@pytest.fixture(scope="module")
def known() -> dict[tuple[str, ...], Any]:
    return dict(commands(get_command(app)))


def unknown_options(known: dict[tuple[str, ...], Any], told: Iterator[tuple[str, str]]) -> list[tuple[str, str]]:
    options = ELSEWHERE | {one for command in known.values() for parameter in command.params for one in parameter.opts}
    return [(where, one) for where, text in told for one in OPTION.findall(text) if one not in options]


def unknown_commands(known: dict[tuple[str, ...], Any], told: Iterator[tuple[str, str]]) -> list[tuple[str, str]]:
    found = []
    for where, text in told:
        for named in COMMAND.findall(text):
            words = tuple(named.split())
            group = (words[0],) in known and hasattr(known[words[:1]], "list_commands")
            if words[:1] not in known or (group and len(words) > 1 and words not in known):
                found.append((where, f"regen {named.strip()}"))
    return found


def test_every_option_that_a_message_names_exists(known: dict[tuple[str, ...], Any]) -> None:
    assert unknown_options(known, messages()) == []


def test_every_command_that_a_message_names_exists(known: dict[tuple[str, ...], Any]) -> None:
    assert unknown_commands(known, messages()) == []


def test_an_option_and_a_command_that_do_not_exist_are_found(known: dict[tuple[str, ...], Any]) -> None:
    planted = [("here", "run `regen mission fly --wings`")]
    assert unknown_options(known, iter(planted)) == [("here", "--wings")]
    assert unknown_commands(known, iter(planted)) == [("here", "regen mission fly")]
