"""Compiles a goal and a template into a task contract T = (g, G, C_g, S, R), or raises a typed error (R1, R2). Pure."""

import math
import re
from collections.abc import Mapping
from typing import Any

import msgspec

from harness.contracts import tasks
from harness.contracts.effects import Condition, Relational, Temporal
from harness.contracts.errors import ContractInvalid
from harness.contracts.places import Place, Site
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.values import encode
from harness.planning import binding
from harness.planning.templates import goal_of

Argument = str | float
_LONGEST_TEXT = 200


def compile_contract(
    *,
    goal: str,
    template: tasks.TaskTemplate,
    arguments: Mapping[str, Argument],
    site: Site,
    rules: RulesVersion = CURRENT_RULES,
) -> tasks.TaskContract:
    """The contract of one request. `arguments` fill the template's parameters; its defaults fill the rest.

    `rules`: the version that the mission will be pinned to.

    Besides its parameters a template may refer to `goal`, `site`, and, where it has the places for them, `outbound`
    (home to destination), `inbound` (back), `circuit` (home to home), `home_zone` (around home) and `passage` (nearest
    to the destination).
    Raises ContractInvalid with the path of what is wrong, UnknownName for a place, route or argument.
    """
    said = goal_of(goal)
    chosen = _arguments(template, arguments)
    bindings = _bindings(said, chosen, template, site)
    draft = binding.substitute(
        {
            "nodes": template.nodes,
            "completion_conditions": template.completion_conditions,
            "constraints": template.constraints,
        },
        bindings=bindings,
    )
    contract = _typed(
        {
            **draft,
            "goal": msgspec.to_builtins(said),
            "recovery_total": template.recovery_total,
            "template": template.name,
            "frame": chosen.get("frame", site.frame),
            "map_version": chosen.get("map_version", site.map_version),
            "bindings": {name: value for name, value in bindings.items() if name not in ("goal", "site")},
        },
        template,
    )
    tasks.check(contract, rules=rules)
    _check_spans_nodes(contract)
    return contract


def compile_again(
    contract: tasks.TaskContract, *, template: tasks.TaskTemplate, site: Site, rules: RulesVersion = CURRENT_RULES
) -> tasks.TaskContract:
    """The request behind a contract under another version of its template, with the person's own choices (D35).

    Raises as `compile_contract` does.
    """
    named = (parameter.name for parameter in template.parameters if parameter.name in contract.bindings)
    chosen = {name: _said(contract.bindings[name]) for name in named}
    return compile_contract(goal=contract.goal.text, template=template, arguments=chosen, site=site, rules=rules)


def _said(bound: Any) -> Argument:
    """The original argument: a place is bound to its record; everything else stays as it was given."""
    said: Argument = bound["place_id"] if isinstance(bound, Mapping) else bound
    return said


def _arguments(template: tasks.TaskTemplate, arguments: Mapping[str, Argument]) -> dict[str, Argument]:
    parameters = {parameter.name: parameter for parameter in template.parameters}
    for name in arguments:
        if name not in parameters:
            raise binding.unknown("parameter", name, known=parameters, where=f"template {template.name}")
    chosen = {}
    for name, parameter in parameters.items():
        value = arguments.get(name, parameter.default)
        if value is None:
            raise ContractInvalid(
                f"{parameter.title} is not given", where=f"argument {name}", do=f"give a {parameter.type}"
            )
        chosen[name] = _argument(parameter, value)
    return chosen


def _argument(parameter: tasks.TemplateParameter, value: Argument) -> Argument:
    where = f"argument {parameter.name}"
    if parameter.type == "number":
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if isinstance(value, bool) or not math.isfinite(number):
            raise ContractInvalid(f"{str(value)[:80]!r} is not a number", where=where, do="give a finite number")
        return number
    if not isinstance(value, str) or not value.strip():
        raise ContractInvalid(f"{value!r} is not a {parameter.type}", where=where, do="give its name as text")
    if len(value) > _LONGEST_TEXT:
        raise ContractInvalid(f"The text has {len(value)} characters", where=where, do=f"use at most {_LONGEST_TEXT}")
    return value


def _bindings(
    goal: tasks.Goal, chosen: Mapping[str, Argument], template: tasks.TaskTemplate, site: Site
) -> dict[str, Any]:
    places = {
        parameter.name: binding.bind_place(str(chosen[parameter.name]), site=site)
        for parameter in template.parameters
        if parameter.type == "place"
    }
    used = binding.names_in((template.nodes, template.completion_conditions, template.constraints))
    bound: dict[str, Any] = {
        "goal": goal,
        "site": {"name": site.name, "frame": site.frame, "map_version": site.map_version},
        **{name: value for name, value in chosen.items() if name not in places},
        **places,
        **_journeys(places, used, site),
    }
    builtins: dict[str, Any] = msgspec.json.decode(encode(bound))
    return builtins


def _journeys(places: Mapping[str, Place], used: frozenset[str], site: Site) -> dict[str, Any]:
    home, destination = places.get("home"), places.get("destination")
    found: dict[str, Any] = {}
    if home and "circuit" in used:
        found["circuit"] = binding.bind_route(home, home, site=site)
    if home and destination and "outbound" in used:
        found["outbound"] = binding.bind_route(home, destination, site=site)
    if home and destination and "inbound" in used:
        found["inbound"] = binding.bind_route(destination, home, site=site)
    if home and "home_zone" in used:
        found["home_zone"] = binding.bind_zone(home, site=site)
    if destination and "passage" in used:
        found["passage"] = binding.bind_passage(destination, site=site)
    return found


def _typed(draft: Mapping[str, Any], template: tasks.TaskTemplate) -> tasks.TaskContract:
    _check_finite(draft, "$")
    try:
        return msgspec.convert(draft, tasks.TaskContract, strict=True)
    except msgspec.ValidationError as error:
        what, _, path = str(error).partition(" - at `")
        raise ContractInvalid(
            what,
            where=f"template {template.name}, {_named(path.rstrip('`') or '$', draft)}",
            do="correct the template",
        ) from error


def _named(path: str, draft: Mapping[str, Any]) -> str:
    """The path with the node's id in the place of its index, where it has one."""
    found = re.match(r"\$\.nodes\[(\d+)\]", path)
    if found is None:
        return path
    node = draft["nodes"][int(found.group(1))]
    name = node.get("node_id", found.group(1)) if isinstance(node, Mapping) else found.group(1)
    return f"$.nodes.{name}{path[found.end() :]}"


def _check_finite(value: Any, path: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ContractInvalid(f"{value} is not a finite number", where=path, do="give a number with a bound")
    if isinstance(value, Mapping):
        for key, item in value.items():
            _check_finite(item, f"{path}.{key}")
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            _check_finite(item, f"{path}[{index}]")


def _check_spans_nodes(contract: tasks.TaskContract) -> None:
    """D20: the goal of several nodes needs a condition that no node tests by itself."""
    own = [condition.effect for node in contract.nodes for condition in node.success_conditions]
    spanning = (
        condition for condition in contract.completion_conditions if _spans(condition) and condition.effect not in own
    )
    if len(contract.nodes) > 1 and next(spanning, None) is None:
        raise ContractInvalid(
            "No completion condition spans several nodes",
            where="completion_conditions",
            do="add one that no node tests by itself, such as in_order or linked",
        )


def _spans(condition: Condition) -> bool:
    match condition.effect:
        case Temporal(nodes=nodes):
            return len(set(nodes)) > 1
        case Relational(subject=subject, object=other):
            return subject != other
        case _:
            return False
