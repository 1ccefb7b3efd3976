"""Values are not tracked by the garbage collector, because none of them can be in a cycle."""

import gc
import pkgutil
from collections.abc import Iterator
from importlib import import_module

import msgspec

import harness
from harness.contracts.effects import Condition, Symbolic
from harness.contracts.values import Moment, Value

LEFT_OUT = ("harness.adapters.providers", "harness.conformance", "harness.bootstrap", "harness.assembly")


def all_values() -> Iterator[type[Value]]:
    """Every value of contracts, projections and the pure packages."""
    for module in pkgutil.walk_packages(harness.__path__, "harness."):
        if not module.name.startswith(LEFT_OUT) and not module.ispkg and "harness.adapters" not in module.name:
            import_module(module.name)
    ahead = list(Value.__subclasses__())
    while ahead:
        kind = ahead.pop()
        ahead.extend(kind.__subclasses__())
        if kind.__module__.startswith("harness."):
            yield kind


def test_a_value_holds_values_texts_numbers_and_containers_of_them_only() -> None:
    """An object of any other class could be changed to hold the value, which would then never be freed."""
    kinds = list(all_values())
    assert len(kinds) > 200
    found = msgspec.inspect.multi_type_info(kinds)
    assert "CustomType" not in str(found)


def test_only_what_caches_something_about_itself_is_tracked() -> None:
    tracked = {kind.__name__ for kind in all_values() if kind.__struct_config__.gc is not False}
    assert tracked == {"Context", "Mission", "TaskContract"}


def test_a_value_with_containers_is_not_tracked() -> None:
    condition = Condition(
        condition_id="done",  # type: ignore[arg-type]
        text="Done",
        effect=Symbolic(predicate="recorded_request", arguments={"digest": "0"}),
    )
    assert not gc.is_tracked(condition) and not gc.is_tracked(Moment(mission_s=0.0, wall_s=0.0))
