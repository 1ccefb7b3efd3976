"""Pins a contract to the installed predicates that its conditions name (D57). Pure."""

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from harness.contracts import ports
from harness.contracts.effects import Condition, Temporal
from harness.contracts.errors import Unsatisfiable
from harness.contracts.predicates import PinnedPredicate, is_installed_name
from harness.contracts.reasons import because
from harness.contracts.tasks import TaskContract


def with_pins(contract: TaskContract, *, predicates: ports.Predicates, vouched: Sequence[str]) -> TaskContract:
    """The contract with what is installed now under each name, and whether its site vouches for it.

    Raises Unsatisfiable for a name that is not installed, and for one of another type of effect.
    """
    pins: dict[str, PinnedPredicate] = {}
    for where, condition in conditions(contract):
        effect = condition.effect
        inner = effect.inner if isinstance(effect, Temporal) else None
        if inner is not None and is_installed_name(inner.predicate):
            raise Unsatisfiable(
                because("predicate_only_alone", condition_id=condition.condition_id, predicate=inner.predicate),
                where=where,
            )
        name = effect.predicate
        if not is_installed_name(name):
            continue
        found = predicates.installed.get(name)
        if found is None:
            raise Unsatisfiable(
                because(
                    "condition_names_no_predicate",
                    condition_id=condition.condition_id,
                    predicate=name,
                    installed=tuple(predicates.installed) or ("none",),
                ),
                where=where,
            )
        if found.effect != effect.__struct_config__.tag:
            raise Unsatisfiable(
                because(
                    "predicate_of_other_effect",
                    condition_id=condition.condition_id,
                    predicate=name,
                    effect=found.effect,
                ),
                where=where,
            )
        pins[name] = PinnedPredicate(installed=found, vouched=name in vouched)
    return replace(contract, predicates=pins) if pins else contract


def conditions(contract: TaskContract) -> Iterator[tuple[str, Condition]]:
    """Every condition with where it stands."""
    for node in contract.nodes:
        yield from ((f"nodes.{node.node_id}.success_conditions", one) for one in node.success_conditions)
    yield from (("completion_conditions", one) for one in contract.completion_conditions)
