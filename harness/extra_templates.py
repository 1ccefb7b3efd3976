"""Starts missions: offers the missions of the site's own folder too, and has a planner order the stages of theirs.

Every mission runs under its robot's current configuration, is pinned to it and ends at the same gate. The compiled
contract is stored in the log; a candidate cannot change the templates beside H_0.
"""

from dataclasses import replace
from typing import Protocol

from harness.contracts.any_events import AnyEvent
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, RobotId
from harness.contracts.models import ModelAdvice, ModelUse
from harness.contracts.places import Site
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.values import encode
from harness.goals.understanding import UnderstoodGoal
from harness.planning.clauses import tells_only
from harness.planning.decomposition import ONE_AFTER_ANOTHER, DecompositionResult, StagePlanner, decomposed
from harness.runtime import Start


class MissionStarter(Protocol):
    """What starting a mission needs of the runtime."""

    @property
    def site(self) -> Site: ...

    @property
    def beside(self) -> tuple[TaskTemplate, ...]: ...

    @property
    def stage_planner(self) -> StagePlanner: ...

    def current_configuration(self, robot_id: RobotId) -> Configuration: ...

    def understood(self, start: Start) -> UnderstoodGoal: ...

    def start(self, start: Start, *, template: TaskTemplate | None = None) -> Accepted[AnyEvent] | Refused: ...

    def draft(self, start: Start, *, template: TaskTemplate | None = None) -> TaskContract: ...

    def keep(self, body: bytes) -> Digest: ...


def offered(runtime: MissionStarter, robot_id: RobotId) -> tuple[TaskTemplate, ...]:
    """What a person may start on this robot: its configuration's templates, then the site's own missions.

    A template of the configuration whose places this site does not have is left out, and one that only reports what
    others achieved.
    """
    known = place_names(runtime.site)
    own = tuple(one for one in runtime.current_configuration(robot_id).templates if _at_home(one, known))
    names = {template.name for template in own}
    beside = (template for template in runtime.beside if template.name not in names)
    return (*own, *(template for template in beside if not tells_only(template)))


def place_names(site: Site) -> frozenset[str]:
    """Every name that a place of the site goes by, as names are compared."""
    words = (word for place in site.places for word in (place.place_id, place.name, *place.aliases))
    return frozenset(" ".join(word.casefold().split()) for word in words)


def _at_home(template: TaskTemplate, known: frozenset[str]) -> bool:
    places = (one.default for one in template.parameters if one.type == "place" and one.default is not None)
    return all(str(name).casefold() in known for name in places)


def begin(
    runtime: MissionStarter, start: Start, *, planner: StagePlanner | None = None
) -> Accepted[AnyEvent] | Refused:
    """Start a mission of any offered template, or of several. Raises as `Runtime.start` does; nothing is written then.

    `planner` orders the stages; the runtime's own without one.

    The plan of a template beside H_0 is stored as a blob; the mission's labels name it, its planner, and why the
    harness took its own plan instead, if it did.
    """
    taken = _taken_apart(runtime, start, planner or runtime.stage_planner)
    if taken is None:
        return runtime.start(start)
    labels = {"planner": taken.planner, "plan_refused": taken.refused}
    if taken.plan is not None:
        labels["plan"] = runtime.keep(encode(taken.plan))
    named = {name: text for name, text in labels.items() if text}
    advice = (_advice(taken, taken.use),) if taken.use is not None else ()
    return runtime.start(replace(_labelled(start, named), advice=advice), template=taken.template)


def _advice(taken: DecompositionResult, use: ModelUse) -> ModelAdvice:
    """What the model said as the planner of the stages' order."""
    plan = taken.plan
    order = ", ".join(step.stage for step in plan.steps) if plan else ""
    return ModelAdvice(
        role="planner",
        node_id=None,
        said=(plan.reason if plan else "")[:1000],
        action=order[:200],
        refused=taken.refused,
        use=use,
    )


def draft(runtime: MissionStarter, start: Start) -> TaskContract:
    """The contract that `begin` would create now; nothing is written. Raises as `begin` does."""
    taken = _taken_apart(runtime, start, ONE_AFTER_ANOTHER)
    return runtime.draft(start, template=taken.template if taken else None)


def _taken_apart(runtime: MissionStarter, start: Start, planner: StagePlanner) -> DecompositionResult | None:
    """The stages of the one template beside H_0 that the goal takes, as the planner orders them; None if it takes none.

    The stages of several templates are done in the order that the goal says, and no planner is asked.
    """
    found = runtime.understood(start)
    templates = [part.template for part in found.plan.parts] if found.plan else [found.template]
    names = {template.name for template in templates if template is not None}
    chosen = next((one for one in runtime.beside if {one.name} == names), None)
    return decomposed(planner, goal=found.text, template=chosen) if chosen else None


def _labelled(start: Start, labels: dict[str, str]) -> Start:
    return replace(start, labels={**(start.labels or {}), **labels})
