"""Applies the hard filter before any score. Pure and deterministic; refuses whatever is unknown (R58, R173)."""

import math
from collections.abc import Callable

from harness.contracts.capabilities import CapabilityCard, Parameter
from harness.contracts.proposals import Filter
from harness.contracts.protocol import ParameterValue, RobotStatus
from harness.contracts.reasons import Reason, because, several
from harness.routing.requirements import ProviderRequirements

Check = Callable[[CapabilityCard, ProviderRequirements], Reason | None]
_RISKS = ("low", "medium", "high")
_BOUND_LATER = "@{"


def refusal(card: CapabilityCard, need: ProviderRequirements) -> tuple[Filter, Reason] | None:
    """The first filter that refuses this provider, and why; None if none does."""
    for name, check in CHECKS:
        if reason := check(card, need):
            return name, reason
    return None


def _capability(card: CapabilityCard, need: ProviderRequirements) -> Reason | None:
    return (
        None
        if card.capability in need.capabilities
        else because("offers_another_capability", capability=card.capability, wanted=need.capabilities)
    )


def _embodiment(card: CapabilityCard, need: ProviderRequirements) -> Reason | None:
    fits = {"any", need.embodiment} & set(card.embodiments)
    return (
        None
        if fits
        else because("made_for_other_embodiments", embodiments=tuple(card.embodiments), embodiment=need.embodiment)
    )


def _parameters(card: CapabilityCard, need: ProviderRequirements) -> Reason | None:
    stated = need.parameters
    wrong = (
        parameter_problem(parameter, stated.get(parameter.name, stated.get(f"{parameter.name}_from")))
        for parameter in card.parameters
    )
    return next((problem for problem in wrong if problem), None)


def _preconditions(card: CapabilityCard, need: ProviderRequirements) -> Reason | None:
    unmet = (_unmet(name, need.status) for name in card.preconditions)
    return next((reason for reason in unmet if reason), None)


def _freshness(card: CapabilityCard, need: ProviderRequirements) -> Reason | None:
    status = need.status
    if status is None:
        return because("robot_condition_unknown") if card.moves else None
    age_s = need.at_s - status.at_s
    if (card.moves or card.preconditions) and age_s > need.status_age_s:
        return because("robot_condition_old", age_s=age_s, bound_s=need.status_age_s)
    if card.moves and need.map_version and status.map_version != need.map_version:
        return because("robot_on_other_map", robot_map=status.map_version or "none", task_map=need.map_version)
    return None


def _safety(card: CapabilityCard, need: ProviderRequirements) -> Reason | None:
    if _RISKS.index(card.risk) > _RISKS.index(need.node.risk):
        return because("risk_too_high", risk=card.risk, stage_risk=need.node.risk)
    if not card.moves:
        return None
    if need.vetoes:
        return several([because("layer_vetoed", layer=layer, why=why) for layer, why in sorted(need.vetoes.items())])
    if need.status is not None and need.status.charge < need.minimum_charge:
        return because("charge_too_low", charge=need.status.charge, bound=need.minimum_charge)
    return None


def _excluded(card: CapabilityCard, need: ProviderRequirements) -> Reason | None:
    return because("given_up_for_stage") if card.provider_id in need.excluded else None


CHECKS: tuple[tuple[Filter, Check], ...] = (
    ("capability", _capability),
    ("embodiment", _embodiment),
    ("parameters", _parameters),
    ("preconditions", _preconditions),
    ("freshness", _freshness),
    ("safety", _safety),
    ("excluded", _excluded),
)


def parameter_problem(parameter: Parameter, value: ParameterValue | None) -> Reason | None:
    """Why the card would not accept this value; None if it would, or if it is bound later."""
    name = parameter.name
    if value is None:
        return because("parameter_required", name=name) if parameter.required else None
    if isinstance(value, str) and _BOUND_LATER in value:
        return None
    if not _of_type(parameter.type, value):
        return because("parameter_of_another_type", name=name, type=parameter.type)
    if isinstance(value, int | float) and not isinstance(value, bool):
        if parameter.minimum is not None and value < parameter.minimum:
            return because("parameter_too_small", name=name, value=value, bound=parameter.minimum, unit=parameter.unit)
        if parameter.maximum is not None and value > parameter.maximum:
            return because("parameter_too_large", name=name, value=value, bound=parameter.maximum, unit=parameter.unit)
    return None


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


def _unmet(name: str, status: RobotStatus | None) -> Reason | None:
    if status is None:
        return because("precondition_without_condition", precondition=name)
    match name:
        case "localised":
            return None if status.localised else because("not_localised_now")
        case "hardware_stop_released":
            return because("hardware_stop_is_engaged") if status.hardware_stop else None
        case "standing":
            if status.posture == "fallen":
                return because("robot_fell")
            return because("robot_lies_down") if status.posture == "lying" else None
        case "static":
            return because("robot_moves") if status.posture == "moving" else None
        case "disarmed":
            return because("velocity_interface_armed") if status.armed else None
        case _:
            return because("precondition_untestable", precondition=name)
