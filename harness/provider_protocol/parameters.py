"""Checks the parameters of a request against the capability card it is sent to. Pure."""

import math
from collections.abc import Callable

from harness.contracts.capabilities import CapabilityCard, Parameter
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import Reason, because


def parameter_problems(card: CapabilityCard, parameters: Parameters) -> tuple[Reason, ...]:
    """What is wrong with the parameters of a request; empty when they fit the card."""
    declared = {parameter.name: parameter for parameter in card.parameters}
    problems = [because("parameter_undeclared", name=name) for name in parameters if name not in declared]
    for name, parameter in declared.items():
        if name not in parameters:
            if parameter.required:
                problems.append(because("parameter_required", name=name))
        elif not _FITS[parameter.type](parameters[name]):
            problems.append(because("parameter_of_another_type", name=name, type=parameter.type))
        elif parameter.type == "number":
            value = float(parameters[name])  # type: ignore[arg-type]
            problems += _outside(parameter, value)
    return tuple(problems)


def _outside(parameter: Parameter, value: float) -> list[Reason]:
    name, low, high, unit = parameter.name, parameter.minimum, parameter.maximum, parameter.unit
    if low is not None and value < low:
        return [because("parameter_too_small", name=name, value=value, bound=low, unit=unit)]
    if high is not None and value > high:
        return [because("parameter_too_large", name=name, value=value, bound=high, unit=unit)]
    return []


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _point(value: object) -> bool:
    return isinstance(value, tuple) and len(value) == 2 and all(_number(part) for part in value)


def _digest(value: object) -> bool:
    return isinstance(value, str) and len(value) == 64 and set(value) <= set("0123456789abcdef")


_FITS: dict[str, Callable[[object], bool]] = {
    "number": _number,
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "frame": lambda value: isinstance(value, str) and value != "",
    "point": _point,
    "points": lambda value: isinstance(value, tuple) and all(_point(part) for part in value),
    "digests": lambda value: isinstance(value, tuple) and all(_digest(part) for part in value),
}
