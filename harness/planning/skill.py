"""The skill role: turns one node, its card and committed facts in C2 into parameters of one invocation. Pure."""

import math
from typing import Any

import msgspec

from harness.contracts.capabilities import Capability, CapabilityCard, Parameter
from harness.contracts.configuration import RecoveryAction
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.errors import ContractInvalid
from harness.contracts.evidence import CommittedFact, DeclaredEffect
from harness.contracts.proposals import SkillProposal
from harness.contracts.protocol import Parameters, ParameterValue
from harness.contracts.reasons import because
from harness.contracts.tasks import Constraints, Node
from harness.contracts.values import Point
from harness.planning.binding import names_in, substitute

LOOK_S, LONG_LOOK_S = 3.0, 6.0
"""How long an observing skill looks, seconds of mission time: longer when an earlier look could not decide."""
TOLD = "text"
"""The parameter that people are told: what is only declared is named in it."""
KEEP_OUT = "keep_out"
FROM = "_from"
"""`images_from: "@{panorama.frames}"` in a node states that `images` is bound at dispatch from a committed fact."""


REPEATED: tuple[RecoveryAction, ...] = ("retry", "local_replan")
SLOWER = 0.6
"""A motion that is repeated where nothing is known to have worked is driven at this part of its speed."""


class _Attempt(msgspec.Struct, frozen=True):
    attempt: int
    action: RecoveryAction | None = None
    heeds_examples: bool = False


class _Example(msgspec.Struct, frozen=True):
    """What worked here, as far as it bears on the parameters of a motion."""

    parameters: dict[str, Any]


def propose_skill(context: Context) -> SkillProposal:
    """The parameters of one invocation by the provider whose card C2 holds. C2 is the only state it sees.

    Reads `node`, `card`, `attempt`, `constraints`, `example`, `facts`, `declared_effects` and `given_up`. A text
    `@{node.argument}` becomes that argument of a committed fact; what the card does not name is dropped.
    Raises ContractInvalid with what the card requires and the node or the facts cannot give.
    """
    node, card = _required(context, "node").read(Node), _required(context, "card").read(CapabilityCard)
    attempt = _required(context, "attempt").read(_Attempt)
    request = requested(node, capability=card.capability, attempt=attempt.attempt, action=attempt.action)
    wishes = {**within(_heeding(request, attempt, context), _constraints(context)), **_kept_out(context)}
    taken = {parameter.name: wishes[parameter.name] for parameter in card.parameters if parameter.name in wishes}
    grounded = substitute(taken, bindings=_arguments(context), sigil="@", path=f"nodes.{node.node_id}.parameters")
    if TOLD + FROM in node.parameters and isinstance(message := grounded.get(TOLD), str):
        grounded[TOLD] = message + _unverified(context)
    parameters = {
        parameter.name: _checked(parameter, grounded.get(parameter.name), card)
        for parameter in card.parameters
        if parameter.required or parameter.name in grounded
    }
    return SkillProposal(
        provider_id=card.provider_id,
        parameters=parameters,
        reason=because(
            "skill_proposed",
            attempt=attempt.attempt,
            node_id=node.node_id,
            subgoal=node.subgoal,
            facts=tuple(sorted(names_in(taken, sigil="@"))) or ("none",),
            dropped=tuple(sorted(wishes.keys() - taken.keys())) or ("none",),
        ),
    )


def requested(
    node: Node, *, capability: Capability, attempt: int = 1, action: RecoveryAction | None = None
) -> Parameters:
    """What is asked of a provider before facts are filled in; routing filters on the same values.

    An observing provider gets a look instead of the node's own parameters. From the second attempt on, `replan` is
    true: the robot no longer stands where the route begins.
    """
    if capability == "observe" and "observe" not in node.capabilities:
        return {"duration_s": LONG_LOOK_S if action == "adjust_view" else LOOK_S, "frames": 1.0}
    stated = {
        name.removesuffix(FROM) if name == TOLD + FROM or (isinstance(value, str) and "@{" in value) else name: value
        for name, value in node.parameters.items()
    }
    return {**stated, **({"replan": True} if attempt > 1 else {})}


def within(parameters: Parameters, constraints: Constraints | None) -> Parameters:
    """The parameters under the limits that hold now: a later restriction binds what the node once stated."""
    speed = parameters.get("speed_cap_mps")
    if constraints is None or not isinstance(speed, int | float) or speed <= constraints.speed_cap_mps:
        return parameters
    return {**parameters, "speed_cap_mps": constraints.speed_cap_mps}


def _heeding(parameters: Parameters, attempt: _Attempt, context: Context) -> Parameters:
    """A repeated motion is no faster than the fastest that worked here; where nothing is known, slower than before."""
    speed = parameters.get("speed_cap_mps")
    if not attempt.heeds_examples or attempt.action not in REPEATED or not isinstance(speed, int | float):
        return parameters
    caps = [one.read(_Example).parameters.get("speed_cap_mps") for one in context.all("example")]
    speeds = [one for one in caps if isinstance(one, int | float)]
    return {**parameters, "speed_cap_mps": min(speed, max(speeds) if speeds else round(SLOWER * speed, 3))}


def _kept_out(context: Context) -> Parameters:
    """The floor that the body may not enter, as closed rings of corners one after another; nothing where all is free.

    A provider whose card names it plans no way over that floor.
    """
    record = context.one("keep_out")
    floors = record.read(dict[str, tuple[Point, ...]]) if record else {}
    rings = tuple(corner for _, floor in sorted(floors.items()) if floor for corner in (*floor, floor[0]))
    return {KEEP_OUT: rings} if rings else {}


def _constraints(context: Context) -> Constraints | None:
    record = context.one("constraints")
    return record.read(Constraints) if record else None


def _arguments(context: Context) -> dict[str, dict[str, Any]]:
    """Arguments of committed facts by node; the newest fact of a node wins where names repeat.

    A declared effect lends its values too, for a message or a report; what tells people of them says so.
    """
    facts = [fact for record in context.all("facts") for fact in record.read(tuple[CommittedFact, ...])]
    arguments: dict[str, dict[str, Any]] = {}
    for effect in _declared(context):
        arguments.setdefault(effect.node_id, {}).update({**effect.measured, **effect.arguments})
    for fact in sorted(facts, key=lambda fact: (fact.k, fact.at_s)):
        arguments.setdefault(fact.node_id, {}).update({**fact.measured, **fact.arguments})
    return arguments


def _declared(context: Context) -> tuple[DeclaredEffect, ...]:
    record = context.one("declared_effects")
    return record.read(tuple[DeclaredEffect, ...]) if record else ()


def _unverified(context: Context) -> str:
    """The sentences that name what is only declared and what failed, after what is told to people; empty where all was
    verified. Spoken, "not verified" is heard as "not clear".
    """
    declared = dict.fromkeys(effect.text.rstrip(".") for effect in _declared(context))
    record = context.one("given_up")
    failed = dict.fromkeys(one.rstrip(".") for one in record.read(tuple[str, ...])) if record else {}
    text = f" Declared, and unverified: {'; '.join(declared)}." if declared else ""
    return text + (f" Failed, and unverified: {'; '.join(failed)}." if failed else "")


def _required(context: Context, kind: str) -> ContextRecord:
    record = context.one(kind)
    if record is None:
        raise ContractInvalid(
            because("context_incomplete", kind=kind),
            where=because("at_role_context", role="C2", node_id=context.node_id or ""),
        )
    return record


def _checked(parameter: Parameter, value: Any, card: CapabilityCard) -> ParameterValue:
    """The value as the card wants it, typed and bounded, or ContractInvalid."""
    where = f"provider {card.provider_id}, parameter {parameter.name}"
    if value is None:
        raise ContractInvalid(because("parameter_missing"), where=where)
    try:
        typed: ParameterValue = msgspec.convert(value, _TYPES[parameter.type], strict=True)
    except msgspec.ValidationError as error:
        raise ContractInvalid(
            because("parameter_mistyped", kind=parameter.type, error=str(error)), where=where
        ) from error
    if isinstance(typed, float):
        _check_bounds(typed, parameter, where)
    return typed


def _check_bounds(value: float, parameter: Parameter, where: str) -> None:
    low = -math.inf if parameter.minimum is None else parameter.minimum
    high = math.inf if parameter.maximum is None else parameter.maximum
    if not (math.isfinite(value) and low <= value <= high):
        raise ContractInvalid(
            because(
                "parameter_outside_bounds",
                value=f"{value:g} {parameter.unit}".strip(),
                low=f"{low:g}",
                high=f"{high:g}",
            ),
            where=where,
        )


_TYPES: dict[str, Any] = {
    "number": float,
    "string": str,
    "frame": str,
    "boolean": bool,
    "point": tuple[float, float],
    "points": tuple[tuple[float, float], ...],
    "digests": tuple[str, ...],
}
