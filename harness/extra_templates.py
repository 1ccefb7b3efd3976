"""Starts missions whose templates ship beside H_0: offered by name or goal, decomposed by a planner.

They run under their robot's current configuration, are pinned to it and end at the same gate. The compiled contract
is stored in the log; a candidate cannot change their templates.
"""

from dataclasses import replace
from typing import Protocol

from harness.baseline.load import further
from harness.contracts.any_events import AnyEvent
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, RobotId
from harness.contracts.places import Site
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.values import encode
from harness.planning.compile import compile_contract
from harness.planning.decomposition import ONE_AFTER_ANOTHER, Decomposed, StagePlanner, decomposed
from harness.planning.templates import by_name, select
from harness.runtime import Start


class MissionStarter(Protocol):
    """What starting a mission needs of the runtime."""

    @property
    def site(self) -> Site: ...

    def current_configuration(self, robot_id: RobotId) -> Configuration: ...

    def start(self, start: Start, *, template: TaskTemplate | None = None) -> Accepted[AnyEvent] | Refused: ...

    def draft(self, start: Start) -> TaskContract: ...

    def keep(self, body: bytes) -> Digest: ...


def offered(runtime: MissionStarter, robot_id: RobotId) -> tuple[TaskTemplate, ...]:
    """What a person may start on this robot: its configuration's templates, then those beside H_0."""
    own = runtime.current_configuration(robot_id).templates
    names = {template.name for template in own}
    return (*own, *(template for template in further() if template.name not in names))


def begin(
    runtime: MissionStarter, start: Start, *, planner: StagePlanner = ONE_AFTER_ANOTHER
) -> Accepted[AnyEvent] | Refused:
    """Start a mission of any offered template. Raises as `Runtime.start` does; nothing is written then.

    The plan of a template beside H_0 is stored as a blob; the mission's labels name it, its planner, and why the
    harness took its own plan instead, if it did.
    """
    found = _found(runtime, start)
    if found is None:
        return runtime.start(start)
    taken = _taken_apart(found, start, planner)
    labels = {"planner": taken.planner, "plan_refused": taken.refused}
    if taken.plan is not None:
        labels["plan"] = runtime.keep(encode(taken.plan))
    named = {name: text for name, text in labels.items() if text}
    return runtime.start(_labelled(start, named), template=taken.template)


def draft(runtime: MissionStarter, start: Start) -> TaskContract:
    """The contract that `begin` would create now; nothing is written. Raises as `begin` does."""
    found = _found(runtime, start)
    if found is None:
        return runtime.draft(start)
    taken = _taken_apart(found, start, ONE_AFTER_ANOTHER)
    goal, arguments = start.goal or found.goal, start.arguments or {}
    return compile_contract(goal=goal, template=taken.template, arguments=arguments, site=runtime.site)


def _found(runtime: MissionStarter, start: Start) -> TaskTemplate | None:
    """The template beside H_0 that is meant; None if it is one of the configuration's own. Raises UnknownName."""
    every = offered(runtime, start.robot_id)
    chosen = by_name(start.template, every) if start.template else select(start.goal, every)
    return chosen if any(chosen is one for one in further()) else None


def _taken_apart(template: TaskTemplate, start: Start, planner: StagePlanner) -> Decomposed:
    return decomposed(planner, goal=start.goal or template.goal, template=template)


def _labelled(start: Start, labels: dict[str, str]) -> Start:
    return replace(start, labels={**(start.labels or {}), **labels})
