"""Combines restrictions: the tighter of two wins, and none can be loosened (R172). Pure."""

from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import ResourceId
from harness.contracts.reasons import because
from harness.contracts.tasks import Constraints


def tightest(one: Constraints, other: Constraints) -> Constraints:
    """The combination of two restrictions. An empty list of resources states no limit; two lists leave what both allow.

    Raises ContractInvalid if they allow no resource together: an empty list would read as no limit.
    """
    return Constraints(
        speed_cap_mps=min(one.speed_cap_mps, other.speed_cap_mps),
        keep_out=tuple(sorted({*one.keep_out, *other.keep_out})),
        resources=_allowed(one, other),
        minimum_charge=max(one.minimum_charge, other.minimum_charge),
    )


def loosened(before: Constraints, after: Constraints) -> tuple[str, ...]:
    """The names of the limits that `after` would relax; empty if it keeps or tightens every one."""
    both = tightest(before, after)
    relaxed = {
        "speed_cap_mps": after.speed_cap_mps > both.speed_cap_mps,
        "keep_out": not {*before.keep_out} <= {*after.keep_out},
        "resources": {*both.resources} != {*after.resources},
        "minimum_charge": after.minimum_charge < both.minimum_charge,
    }
    return tuple(name for name, is_relaxed in relaxed.items() if is_relaxed)


def _allowed(one: Constraints, other: Constraints) -> tuple[ResourceId, ...]:
    if not one.resources or not other.resources:
        return tuple(sorted({*one.resources, *other.resources}))
    common = {*one.resources} & {*other.resources}
    if not common:
        raise ContractInvalid(
            because("no_common_resource"),
            where=because("at_resources", first=tuple(one.resources), second=tuple(other.resources)),
        )
    return tuple(sorted(common))
