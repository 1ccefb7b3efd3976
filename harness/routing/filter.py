"""Pure: the hard filter. Deterministic, before any score; fails closed on what is unknown (R58, R173)."""

import math
from collections.abc import Callable

from harness.contracts.capabilities import CapabilityCard, Parameter
from harness.contracts.proposals import Filter
from harness.contracts.protocol import ParameterValue, RobotStatus
from harness.routing.need import Need

Check = Callable[[CapabilityCard, Need], str]
_RISKS = ("low", "medium", "high")
_BOUND_LATER = "@{"


def refusal(card: CapabilityCard, need: Need) -> tuple[Filter, str]:
    """The first filter that refuses this provider, and why; two empty texts if none does."""
    for name, check in CHECKS:
        if reason := check(card, need):
            return name, reason
    return "", ""


def _capability(card: CapabilityCard, need: Need) -> str:
    wanted = ", ".join(need.capabilities)
    return "" if card.capability in need.capabilities else f"offers {card.capability}, not {wanted}"


def _embodiment(card: CapabilityCard, need: Need) -> str:
    fits = {"any", need.embodiment} & set(card.embodiments)
    return "" if fits else f"made for {', '.join(card.embodiments)}, not for {need.embodiment}"


def _parameters(card: CapabilityCard, need: Need) -> str:
    stated = need.parameters
    wrong = (
        parameter_problem(parameter, stated.get(parameter.name, stated.get(f"{parameter.name}_from")))
        for parameter in card.parameters
    )
    return next((problem for problem in wrong if problem), "")


def _preconditions(card: CapabilityCard, need: Need) -> str:
    unmet = (_unmet(name, need.status) for name in card.preconditions)
    return next((reason for reason in unmet if reason), "")


def _freshness(card: CapabilityCard, need: Need) -> str:
    status = need.status
    if status is None:
        return "the robot's condition is unknown" if card.moves else ""
    age_s = need.at_s - status.at_s
    if (card.moves or card.preconditions) and age_s > need.status_age_s:
        return f"the robot's condition is {age_s:.1f} s old, at most {need.status_age_s:.1f} s"
    if card.moves and need.map_version and status.map_version != need.map_version:
        return f"the robot is on map {status.map_version or 'none'}, the task on {need.map_version}"
    return ""


def _safety(card: CapabilityCard, need: Need) -> str:
    if _RISKS.index(card.risk) > _RISKS.index(need.node.risk):
        return f"risk {card.risk} exceeds the node's {need.node.risk}"
    if not card.moves:
        return ""
    if need.vetoes:
        return "; ".join(f"{layer} vetoed: {reason}" for layer, reason in sorted(need.vetoes.items()))
    if need.status is not None and need.status.charge < need.minimum_charge:
        return f"charge {need.status.charge:.2f} is below {need.minimum_charge:.2f}"
    return ""


def _excluded(card: CapabilityCard, need: Need) -> str:
    return "given up for this node" if card.provider_id in need.excluded else ""


CHECKS: tuple[tuple[Filter, Check], ...] = (
    ("capability", _capability),
    ("embodiment", _embodiment),
    ("parameters", _parameters),
    ("preconditions", _preconditions),
    ("freshness", _freshness),
    ("safety", _safety),
    ("excluded", _excluded),
)


def parameter_problem(parameter: Parameter, value: ParameterValue | None) -> str:
    """Why the card would not take this value; empty if it would, or if it is bound later."""
    name = parameter.name
    if value is None:
        return f"parameter {name} is required" if parameter.required else ""
    if isinstance(value, str) and _BOUND_LATER in value:
        return ""
    if not _of_type(parameter.type, value):
        return f"parameter {name} is no {parameter.type}"
    if isinstance(value, int | float) and not isinstance(value, bool):
        if parameter.minimum is not None and value < parameter.minimum:
            return f"parameter {name} = {value:g} is below {parameter.minimum:g} {parameter.unit}".rstrip()
        if parameter.maximum is not None and value > parameter.maximum:
            return f"parameter {name} = {value:g} is above {parameter.maximum:g} {parameter.unit}".rstrip()
    return ""


def _of_type(kind: str, value: object) -> bool:
    match kind:
        case "number":
            return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        case "boolean":
            return isinstance(value, bool)
        case "point":
            return isinstance(value, tuple) and len(value) == 2 and all(_of_type("number", part) for part in value)
        case "points":
            return isinstance(value, tuple) and all(_of_type("point", part) for part in value)
        case "digests":
            return isinstance(value, tuple) and all(isinstance(part, str) for part in value)
        case _:
            return isinstance(value, str)


def _unmet(name: str, status: RobotStatus | None) -> str:
    if status is None:
        return f"precondition {name}: the robot's condition is unknown"
    match name:
        case "localised":
            return "" if status.localised else "the robot is not localised"
        case "hardware_stop_released":
            return "the hardware stop is engaged" if status.hardware_stop else ""
        case "standing":
            return "the robot lies down" if status.posture == "lying" else ""
        case "static":
            return "the robot moves" if status.posture == "moving" else ""
        case "disarmed":
            return "the velocity interface is armed" if status.armed else ""
        case _:
            return f"precondition {name} cannot be tested"
