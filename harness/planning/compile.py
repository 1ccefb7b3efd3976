"""Compiles a goal and a template into a task contract T = (g, G, C_g, S, R), or raises a typed error (R1, R2). Pure."""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from harness.contracts import tasks
from harness.contracts.effects import Condition, Relational, Temporal
from harness.contracts.errors import ContractInvalid
from harness.contracts.listed_values import why_invalid
from harness.contracts.places import Place, Route, Site
from harness.contracts.reasons import because
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.values import Point, encode
from harness.planning import binding
from harness.planning.clauses import WAITING
from harness.planning.templates import goal_of

Argument = str | float
_LONGEST_TEXT = 200
UNSTORED = ("goal", "site", "ending", "ground", "waiting", "achieved")
"""What a template may refer to that is no choice, place or route of the contract."""
LOOK_LONGER_S, LATE_S = 1.0, 30.0
AROUND_M = 0.8
"""Half the width of the floor that counts as a place whose region nobody surveyed."""


def compile_contract(
    *,
    goal: str,
    template: tasks.TaskTemplate,
    arguments: Mapping[str, Argument],
    site: Site,
    origin: Place | None = None,
    stays: bool = False,
    achieved: str = "",
    rules: RulesVersion = CURRENT_RULES,
) -> tasks.TaskContract:
    """The contract of one request. `arguments` fill the template's parameters; its defaults fill the rest.

    `rules`: the version that the mission will be pinned to.

    Besides its parameters a template may refer to `goal`, `site`, and, where it has the places for them, `outbound`
    (from `origin`, or home, to the destination), `inbound` (from there home), `circuit` (home to home), `home_zone`
    (around home), `passage` (of the destination), `waiting` (how long a look lasts that covers its `seconds`, and these
    in words), `achieved` (what the stages before it achieved, for one that reports) and `ending` (where the robot is at
    the end: at home, or at the destination if it `stays`).
    Raises ContractInvalid with the path of what is wrong, UnknownName for a place, route or argument.
    """
    goal_text = goal_of(goal)
    chosen = _arguments(template, arguments)
    bindings = _bindings(goal_text, chosen, template, site, origin=origin, stays=stays)
    bindings |= {"achieved": {"text": achieved}} if achieved else {}
    draft = binding.substitute(
        {
            "nodes": template.nodes,
            "completion_conditions": [_uncited(one) for one in template.completion_conditions],
            "constraints": template.constraints,
        },
        bindings=bindings,
    )
    contract = _typed(
        {
            **draft,
            "goal": msgspec.to_builtins(goal_text),
            "recovery_total": template.recovery_total,
            "template": template.name,
            "frame": chosen.get("frame", site.frame),
            "map_version": chosen.get("map_version", site.map_version),
            "bindings": {name: value for name, value in bindings.items() if name not in UNSTORED},
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
    chosen = {name: _argument_value(contract.bindings[name]) for name in named}
    return compile_contract(goal=contract.goal.text, template=template, arguments=chosen, site=site, rules=rules)


def _argument_value(bound: Any) -> Argument:
    """The original argument: a place is bound to its record; everything else stays as it was given."""
    value: Argument = bound["place_id"] if isinstance(bound, Mapping) else bound
    return value


def _arguments(template: tasks.TaskTemplate, arguments: Mapping[str, Argument]) -> dict[str, Argument]:
    parameters = {parameter.name: parameter for parameter in template.parameters}
    for name in arguments:
        if name not in parameters:
            raise binding.unknown(
                "parameter", name, known=parameters, where=because("at_template", template=template.name)
            )
    chosen = {}
    for name, parameter in parameters.items():
        value = arguments.get(name, parameter.default)
        if value is None:
            raise ContractInvalid(
                because("argument_missing", title=parameter.title, kind=parameter.type),
                where=because("at_argument", argument=name),
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
            raise ContractInvalid(because("argument_no_number", value=str(value)[:80]), where=where)
        return number
    if not isinstance(value, str) or not value.strip():
        raise ContractInvalid(because("argument_no_text", value=str(value)[:80], kind=parameter.type), where=where)
    if len(value) > _LONGEST_TEXT:
        raise ContractInvalid(because("argument_too_long", characters=len(value), limit=_LONGEST_TEXT), where=where)
    return value


def _uncited(condition: Mapping[str, Any]) -> dict[str, Any]:
    """The condition without the act that its template tests it for: only a reading says which clause that is."""
    return {name: value for name, value in condition.items() if name != "clause"}


def _bindings(
    goal: tasks.Goal,
    chosen: Mapping[str, Argument],
    template: tasks.TaskTemplate,
    site: Site,
    *,
    origin: Place | None,
    stays: bool,
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
        **_journeys(places, used, site, origin=origin),
        **_ending(places, stays=stays),
        **_ground(places),
        **_waiting(chosen),
    }
    builtins: dict[str, Any] = msgspec.json.decode(encode(bound))
    return builtins


def _ending(places: Mapping[str, Place], *, stays: bool) -> dict[str, str]:
    home, destination = places.get("home"), places.get("destination")
    if stays and destination:
        return {"ending": f"I am still at {destination.name}."}
    return {"ending": f"I am back at {home.name}."} if home else {}


def _ground(places: Mapping[str, Place]) -> dict[str, Any]:
    """The floor that counts as being at the destination: its region, else a square around where it is approached."""
    place = places.get("destination")
    return {"ground": {"region_m": ground_m(place)}} if place else {}


def _waiting(chosen: Mapping[str, Argument]) -> dict[str, Any]:
    """How long a look lasts whose samples cover a whole wait, and when it is late."""
    seconds = chosen.get(WAITING)
    if not isinstance(seconds, float):
        return {}
    spoken = {"spoken": " and ".join(_spoken_time(round(seconds)))}
    return {"waiting": {"duration_s": seconds + LOOK_LONGER_S, "timeout_s": seconds + LATE_S, **spoken}}


def _spoken_time(seconds: int) -> Iterator[str]:
    """Minutes and seconds as they are said."""
    for number, unit in zip(divmod(seconds, 60), ("minute", "second"), strict=True):
        if number:
            yield f"{number} {unit}{'s' if number > 1 else ''}"


def outcome_in_words(sentence: str, contract: tasks.TaskContract) -> str:
    """The sentence that says what a contract achieved, with its own places and times."""
    return str(binding.substitute(sentence, bindings={**contract.bindings, **_waiting(contract.bindings)}))


def ground_m(place: Place) -> tuple[Point, ...]:
    """The floor of a place, metres in its frame."""
    if len(place.region_m) > 2:
        return place.region_m
    x, y = place.approach_m
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return tuple((x + right * AROUND_M, y + up * AROUND_M) for right, up in corners)


def _journeys(places: Mapping[str, Place], used: frozenset[str], site: Site, *, origin: Place | None) -> dict[str, Any]:
    home, destination = places.get("home"), places.get("destination")
    found: dict[str, Any] = {}
    if home and "circuit" in used:
        found["circuit"] = binding.bind_route(home, home, site=site)
    if home and destination and "outbound" in used:
        found["outbound"] = _way(origin or home, destination, site)
    if home and destination and "inbound" in used:
        found["inbound"] = _way(destination, home, site)
    if home and "home_zone" in used:
        found["home_zone"] = binding.bind_zone(home, site=site)
    if destination and "passage" in used:
        found["passage"] = binding.bind_passage(destination, site=site)
    return found


def _way(start: Place, end: Place, site: Site) -> Route:
    """The route between two places. Where a leg would begin where it ends, any route that leads there will do."""
    return binding.bind_route(start, end, site=site) if start != end else binding.bind_way(end, site=site)


def _typed(draft: Mapping[str, Any], template: tasks.TaskTemplate) -> tasks.TaskContract:
    _check_finite(draft, "$")
    try:
        return msgspec.convert(draft, tasks.TaskContract, strict=True)
    except msgspec.ValidationError as error:
        what, path = why_invalid(error, tasks.TaskContract)
        raise ContractInvalid(
            because("template_invalid", error=what) if isinstance(what, str) else what,
            where=because("at_template_field", template=template.name, field=_named(path, draft)),
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
        raise ContractInvalid(because("number_not_finite", value=str(value)), where=path)
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
        raise ContractInvalid(because("no_spanning_condition"), where="completion_conditions")


def _spans(condition: Condition) -> bool:
    match condition.effect:
        case Temporal(nodes=nodes):
            return len(set(nodes)) > 1
        case Relational(subject=subject, object=other):
            return subject != other
        case _:
            return False
