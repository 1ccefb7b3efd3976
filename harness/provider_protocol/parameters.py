"""Checks the parameters of a request against the capability card it is sent to. Pure."""

import math
from collections.abc import Callable

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.protocol import Parameters


def parameter_problems(card: CapabilityCard, parameters: Parameters) -> tuple[str, ...]:
    """What is wrong with the parameters of a request, as sentences; empty when they fit the card."""
    declared = {parameter.name: parameter for parameter in card.parameters}
    problems = [f"Parameter {name} is not on the card" for name in parameters if name not in declared]
    for name, parameter in declared.items():
        if name not in parameters:
            if parameter.required:
                problems.append(f"Parameter {name} is missing")
        elif not _FITS[parameter.type](parameters[name]):
            problems.append(f"Parameter {name} is not of type {parameter.type}")
        elif parameter.type == "number":
            value = float(parameters[name])  # type: ignore[arg-type]
            lowest, highest = parameter.minimum, parameter.maximum
            if (lowest is not None and value < lowest) or (highest is not None and value > highest):
                problems.append(f"Parameter {name} = {value} lies outside {lowest}..{highest}")
    return tuple(problems)


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
