"""Translates the texts of the task templates that ship; a site's own templates are shown as written. Pure.

A template's text is a message, its open spots are the holes. A contract's text is known by binding the template's text
again with the contract's own bindings: no text is taken apart.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from msgspec import structs, to_builtins

from app.i18n.catalogues import N_
from app.i18n.messages import Message
from harness.baseline import load
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.verdicts import ConditionResult
from harness.planning.composition import TOLERANCE_M

SHOWN = ("subgoal", "text")
"""Keys of a stage or a condition whose values people read."""
CHOSEN = (
    N_("Go to ({x}, {y})"),
    N_("Look around at ({x}, {y})"),
    N_("Go to another viewpoint at ({x}, {y})"),
)
"""Subgoals of the stages that a mission adds to its own graph, at the targets that it chose."""
COMPOSED = (
    N_("The body stayed out of {name} all the time"),
    N_("The body stands within {tolerance_m} m of {name} now"),
    N_("The pictures were taken at {name}"),
    N_("The stage {name} was accepted after what it builds on"),
    N_("The channel acknowledged the message and its pictures"),
)
"""Conditions that a goal adds to those of its templates, about a place, a zone, a stage or a channel."""
RECORDED = ("The body is at its target, which nobody named", "The recorded legs were accepted in their order")
"""Conditions that a replayed recording adds to those of its template: their texts are messages as they stand."""
_SPOT = re.compile(r"\$\{(\w+)(?:\.(\w+))?\}")


def shipped() -> tuple[TaskTemplate, ...]:
    return (*load.baseline().templates, *load.shipped_workspace().missions)


def messages() -> Iterator[tuple[str, str]]:
    """(message, name of its template): everything that the shipped templates say to people."""
    for template in shipped():
        fixed = (template.title, template.goal, *(one.title for one in template.parameters))
        texts = (text for text in (*fixed, *_texts(template)) if not _SPOT.fullmatch(text))
        yield from ((_message(text), f"template {template.name}") for text in texts)
    yield from ((text, "harness/recordings.py") for text in RECORDED)


def task_text(text: str, contract: TaskContract | None) -> str:
    """A text of a contract as a message of its template; unchanged where the template does not ship here."""
    if contract is None:
        return text
    chosen = next((one for one in _chosen(contract) if one == text), None)
    found = chosen or bound_text(text, contract.compiled_from, contract.bindings)
    return found if isinstance(found, Message) else next(_composed(text, contract), text)


def bound_text(text: str, templates: Sequence[str], bindings: Mapping[str, Any]) -> str:
    """A text that was bound from one of these templates, as a message of it; unchanged where it is none of theirs."""
    return next((one for one in _bound(tuple(templates), bindings) if one == text), text)


def in_words(results: Sequence[ConditionResult], contract: TaskContract | None) -> tuple[ConditionResult, ...]:
    """Results of conditions, their texts as `task_text` gives them."""
    return tuple(structs.replace(one, text=task_text(one.text, contract)) for one in results)


def _chosen(contract: TaskContract) -> Iterator[str]:
    """What the stages that were added at each target of a contract are called."""
    for node in contract.nodes:
        match node.parameters.get("target"):
            case (int() | float() as x, int() | float() as y):
                yield from (Message(one, {"x": f"{x:.1f}", "y": f"{y:.1f}"}) for one in CHOSEN)


def _composed(text: str, contract: TaskContract) -> Iterator[str]:
    """The conditions that were added for the clauses of a goal, about anything that the contract names."""
    stages = (node.node_id.rpartition(".")[2] for node in contract.nodes)
    names = dict.fromkeys((*_names(to_builtins(contract)), *stages))
    for message in COMPOSED:
        for name in names:
            fields = {"name": name, "tolerance_m": f"{TOLERANCE_M:.2f}"}
            if message.format(**fields) == text:
                yield Message(message, fields)


def _names(tree: object) -> Iterator[str]:
    """Every name in a value, and what its effects are about."""
    match tree:
        case Mapping():
            for key, value in tree.items():
                yield from (value,) if key in ("name", "object") and isinstance(value, str) else _names(value)
        case list() | tuple():
            for value in tree:
                yield from _names(value)


def _bound(templates: tuple[str, ...], bindings: Mapping[str, Any]) -> Iterator[str]:
    found = (_filled(text, part) for text in _open_texts(templates) for part in _parts(bindings))
    return (one for one in found if one is not None)


def _parts(bindings: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The bindings, and those of each clause by themselves where a contract has several (`1.destination`)."""
    yield bindings
    scopes = dict.fromkeys(name.partition(".")[0] for name in bindings if "." in name)
    for scope in scopes:
        inside = f"{scope}."
        yield {name.removeprefix(inside): value for name, value in bindings.items() if name.startswith(inside)}


@cache
def _open_texts(templates: tuple[str, ...]) -> tuple[str, ...]:
    """The texts of shipped templates that have open spots."""
    return tuple(text for one in shipped() if one.name in templates for text in _texts(one) if _SPOT.search(text))


def _filled(text: str, bindings: Mapping[str, Any]) -> Message | None:
    fields: dict[str, Any] = {}
    for spot in _SPOT.finditer(text):
        name, field = spot.groups()
        value = bindings.get(name)
        value = value.get(field) if field and isinstance(value, Mapping) else value
        if not isinstance(value, str | int | float):
            return None
        fields[_hole(spot)] = value
    return Message(_message(text), fields)


def _message(text: str) -> str:
    return _SPOT.sub(lambda spot: f"{{{_hole(spot)}}}", text)


def _hole(spot: re.Match[str]) -> str:
    return "_".join(filter(None, spot.groups()))


def _texts(template: TaskTemplate) -> Iterator[str]:
    yield from _read([*template.nodes, *template.completion_conditions])


def _read(tree: object) -> Iterator[str]:
    match tree:
        case Mapping():
            for key, value in tree.items():
                if key in SHOWN and isinstance(value, str):
                    yield value
                else:
                    yield from _read(value)
        case list() | tuple():
            for value in tree:
                yield from _read(value)
