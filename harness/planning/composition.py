"""Compiles the plan of a reading to one task contract: the parts one after the other, one return at the end. Pure.

Stages of several parts get scoped names (`1.go`, `2.panorama`); each completion condition cites the clause, or the
default of the mission profile, that it is tested for (D42).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from harness.contracts import tasks
from harness.contracts.effects import AnyEffect, Condition, Metric, Relational, Symbolic, Temporal, Visual
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import ConditionId, Digest, NodeId, PlaceId, ResourceId
from harness.contracts.places import Place, Site, SiteChannel
from harness.contracts.readings import PROFILE, Act, Clause, clause_id
from harness.contracts.reasons import because
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.planning.binding import bind_place
from harness.planning.clauses import LOOKING, GoalPlan, Part, home_of, region_of, removable
from harness.planning.compile import Argument, compile_contract, ground_m, outcome_in_words
from harness.planning.outcomes import AchievedPart, report_of, with_outcomes
from harness.planning.recipients import of_channel, recipient, sent_to

MISSION_BUDGET = 8
"""Recovery steps of one mission (D24), unless one of its templates has more."""
TOLERANCE_M = 0.40
_SPOT = re.compile(r"@\{([a-z][a-z0-9_-]*)")


@dataclass(frozen=True)
class Compiled:
    """A part as it was compiled alone, and what of it is left out or comes later."""

    part: Part
    contract: tasks.TaskContract
    scope: str
    clause: str

    def named(self, node_id: str) -> NodeId:
        """A stage's name in the whole mission; the request is one for all."""
        return NodeId(f"{self.scope}{node_id}") if node_id != self.request else REQUEST

    @property
    def request(self) -> str:
        """The stage that takes down the request; empty where the template has none."""
        found = (node.node_id for node in self.contract.nodes if "take_request" in node.capabilities)
        return next(found, "")


REQUEST = NodeId("request")


@dataclass
class _Mission:
    """What has been put together so far."""

    nodes: list[tasks.Node] = field(default_factory=list)
    conditions: list[Condition] = field(default_factory=list)
    bindings: dict[str, Any] = field(default_factory=dict)
    parts: list[Compiled] = field(default_factory=list)
    tail: NodeId | None = None


def compile_plan(
    plan: GoalPlan,
    *,
    text: str,
    arguments: Mapping[str, Argument],
    templates: Sequence[tasks.TaskTemplate],
    site: Site,
    confirmed: Digest | None = None,
    rules: RulesVersion = CURRENT_RULES,
) -> tasks.TaskContract:
    """The contract of a planned reading. `arguments` are what a person chose beside the text.

    Raises ContractInvalid for an argument that breaks the tie with the text, UnknownName for a place or route.
    """
    return _Composition(plan, text, arguments, templates, site, rules).compiled(confirmed)


class _Composition:
    def __init__(
        self,
        plan: GoalPlan,
        text: str,
        arguments: Mapping[str, Argument],
        templates: Sequence[tasks.TaskTemplate],
        site: Site,
        rules: RulesVersion,
    ) -> None:
        self._rules = rules
        self._plan, self._text, self._arguments, self._site = plan, text, arguments, site
        self._ways = [one for one in templates if any(serve.act == "go" for serve in one.serves or ())]
        self._home = home_of(site)
        self._scoped = len(plan.parts) > 1
        self._mission = _Mission()
        self._at: Place | None = None
        """Where the body is after the parts so far; None before the first, and after one that ends anywhere."""

    def compiled(self, confirmed: Digest | None) -> tasks.TaskContract:
        self._check_arguments()
        for part in self._plan.parts:
            self._add(part)
        self._return()
        self._report()
        self._cover()
        reading = self._plan.reading
        names = tuple(dict.fromkeys(part.template.name for part in self._plan.parts))
        contracts = [one.contract for one in self._mission.parts]
        whole = tasks.TaskContract(
            goal=contracts[0].goal,
            nodes=tuple(self._mission.nodes),
            completion_conditions=tuple(self._mission.conditions),
            constraints=self._constraints(contracts),
            recovery_total=_budget(contracts),
            template="+".join(names),
            frame=contracts[0].frame,
            map_version=contracts[0].map_version,
            bindings=self._mission.bindings,
            reading=reading,
            templates=names if len(names) > 1 else UNSET,
        )
        whole = replace(whole, confirmed=confirmed) if confirmed else whole
        tasks.check(whole, rules=self._rules)
        return whole

    # parts ----------------------------------------------------------------------------------------------------------

    def _add(self, part: Part) -> None:
        """One part with the way to where it begins, if the body is elsewhere."""
        names = {parameter.name for parameter in part.template.parameters}
        home = self._place(str(self._arguments.get("home", ""))) or self._home
        destination = self._place(str(part.place or ""))
        if self._at is not None and destination is None and "home" in names and home and self._at != home:
            self._way(home, part.clause)
        stays = destination is not None and "return" in self._plan.declined
        compiled = self._compile(part, stays=stays)
        later = self._later(part)
        self._take(compiled, leave=later, there=self._at is not None and destination == self._at)
        if part.clause.act == "explore":
            self._at = None
        elif destination is not None:
            self._at = destination
        elif "home" in names:
            self._at = home
        elif any("observe" not in node.capabilities for node in compiled.contract.nodes if _moves(node)):
            self._at = None

    def _compile(self, part: Part, *, stays: bool) -> Compiled:
        parameters = {parameter.name for parameter in part.template.parameters}
        chosen = {name: value for name, value in self._arguments.items() if name in parameters}
        chosen |= part.arguments
        if part.parameter and part.place:
            chosen[part.parameter] = part.place
        achieved = self._achieved(part)
        contract = compile_contract(
            goal=self._text,
            template=part.template,
            arguments=chosen,
            site=self._site,
            origin=self._at,
            stays=stays,
            achieved=report_of(achieved),
            rules=self._rules,
        )
        if achieved:
            contract = with_outcomes(contract, achieved)
        scope = f"{len(self._mission.parts) + 1}." if self._scoped else ""
        return Compiled(part=part, contract=contract, scope=scope, clause=clause_id(self._plan.number(part.clause)))

    def _achieved(self, part: Part) -> list[AchievedPart]:
        """What the parts that a report tells of achieved, in order, with the stages that had to be accepted for it."""
        found = []
        for one, sentence in zip(part.tells, part.outcomes, strict=True):
            compiled = next(made for made in reversed(self._mission.parts) if made.part is one)
            nodes = {node.node_id: node for node in self._mission.nodes}
            stages = [
                nodes[name] for node in compiled.contract.nodes if (name := compiled.named(node.node_id)) in nodes
            ]
            accepted = tuple(node.node_id for node in stages if node.node_id != REQUEST and not node.declared)
            found.append(
                AchievedPart(outcome_in_words(sentence, compiled.contract), accepted, _places(compiled.contract))
            )
        return found

    def _later(self, part: Part) -> set[NodeId]:
        """Stages that are left out here: defaults that are declined, or done once at the end."""
        found: set[NodeId] = set()
        for default in ("return", "report"):
            stage = removable(part.template, default)
            if stage is not None:
                found.add(stage)
        return found

    def _take(self, compiled: Compiled, *, leave: set[NodeId], there: bool) -> None:
        """Add a part's stages but `leave`, chained behind what is there; `there`: the way to its place is behind it."""
        mission = self._mission
        contract = compiled.contract
        target = next((one.approach_m for one in self._site.places if one.place_id == compiled.part.place), None)
        skipped = set(leave)
        if there and target is not None:
            skipped |= {node.node_id for node in contract.nodes if node.parameters.get("target") == target}
        before = mission.tail
        for node_id in tasks.order(contract):
            node = contract.node(node_id)
            if node_id == compiled.request and any(one.node_id == REQUEST for one in mission.nodes):
                continue
            if node_id not in skipped:
                self._append(compiled, node, skipped)
        scope = compiled.scope
        mission.bindings |= {f"{scope}{name}": value for name, value in contract.bindings.items()}
        mission.parts.append(compiled)
        mission.conditions.extend(self._conditions(compiled, skipped - leave, before=before))
        mission.conditions.extend(self._looked(compiled))

    def _append(self, compiled: Compiled, node: tasks.Node, skipped: set[NodeId]) -> None:
        mission = self._mission
        known = {one.node_id for one in mission.nodes}
        depends = [compiled.named(name) for name in _resolved(node, compiled.contract, skipped)]
        depends = [name for name in depends if name in known]
        if self._scoped or not depends:
            depends = [*depends, *([mission.tail] if mission.tail and mission.tail not in depends else [])]
        node = sent_to(node, self._recipient(compiled.part))
        made = replace(
            node,
            node_id=compiled.named(node.node_id),
            depends_on=tuple(depends),
            parameters={name: _rescoped(value, compiled) for name, value in node.parameters.items()},
            success_conditions=tuple(_renamed(one, compiled) for one in node.success_conditions),
            evidence=_declaring(node.evidence, compiled),
        )
        if made.node_id == REQUEST and mission.nodes:
            first = mission.nodes[0]
            mission.nodes[0] = replace(first, depends_on=(*first.depends_on, REQUEST))
            mission.nodes.insert(0, replace(made, depends_on=()))
        else:
            mission.nodes.append(made)
            mission.tail = made.node_id

    def _recipient(self, part: Part) -> SiteChannel | None:
        """Where the part's messages go: as its own clause says, or the one that its delivery answers."""
        return recipient(part.answers.get("deliver", part.clause), self._site)

    def _way(self, destination: Place, clause: Clause) -> None:
        """A leg to a place by a template that goes there."""
        if not self._ways:
            raise ContractInvalid(because("no_template_leads", place_id=destination.place_id), where="goal")
        part = Part(template=self._ways[0], clause=clause, parameter="destination", place=destination.place_id)
        self._take(self._compile(part, stays=False), leave=set(), there=False)
        self._at = destination

    # the end --------------------------------------------------------------------------------------------------------

    def _return(self) -> None:
        """One return at the end: by default, or because it was asked for."""
        plan = self._plan
        requested = plan.returning
        if requested is None and "return" not in plan.reading.defaults:
            return
        cited = clause_id(plan.number(requested)) if requested else f"{PROFILE}.return"
        home = self._place(str(self._arguments.get("home", ""))) or self._home
        last = self._mission.parts[-1]
        stage = removable(last.part.template, "return")
        if stage is not None:
            self._append(last, last.contract.node(stage), set())
            self._at = home
        elif home is not None and self._at != home:
            self._scoped = True
            self._way(home, requested or last.part.clause)
        self._mission.conditions.extend(self._home_now(last, home, cited))

    def _home_now(self, last: Compiled, home: Place | None, cited: str) -> Iterator[Condition]:
        """That the body stands at home now: as the template says it, else as any arrival is said."""
        leg = self._of_act(last, "return")
        if removable(last.part.template, "return") is not None and leg:
            yield from (replace(_renamed(one, last), clause=cited) for one in leg)
        elif home is not None:
            yield _stands_at(home, condition_id="goal.home", clause=cited)

    def _report(self) -> None:
        """Each part's spoken report, at the end, unless the goal declines it."""
        if "report" in self._plan.declined:
            return
        for compiled in list(self._mission.parts):
            stage = removable(compiled.part.template, "report")
            if stage is None:
                continue
            self._append(compiled, compiled.contract.node(stage), set())
            requested = compiled.part.answers.get("report")
            cited = clause_id(self._plan.number(requested)) if requested else f"{PROFILE}.report"
            self._mission.conditions.extend(
                replace(_renamed(one, compiled), clause=cited) for one in self._of_act(compiled, "report")
            )

    def _cover(self) -> None:
        """Conditions for clauses that none of the templates' own cites: an answered stage, a declined return."""
        mission = self._mission
        nodes = {node.node_id for node in mission.nodes}
        mission.conditions = [one for one in (_within(one, nodes) for one in mission.conditions) if one is not None]
        for compiled in mission.parts:
            for act, clause in compiled.part.answers.items():
                cited = clause_id(self._plan.number(clause))
                if all(one.clause != cited for one in mission.conditions):
                    mission.conditions.append(self._answered(compiled, act, cited))
        mission.conditions.extend(self._kept_out())
        declined = self._plan.declined.get("return")
        if declined is not None and self._at is not None:
            number = clause_id(self._plan.number(declined))
            mission.conditions.append(_stands_at(self._at, condition_id="goal.stayed", clause=number))

    def _kept_out(self) -> Iterator[Condition]:
        """That the body was nowhere that a clause forbids, over the whole mission."""
        for clause, name in self._plan.keep_out:
            about = clause.object
            if about is None:
                continue
            number = clause_id(self._plan.number(clause))
            yield Condition(
                condition_id=ConditionId(f"goal.stayed_out.{number}"),
                text=f"The body stayed out of {about.name or name} all the time",
                effect=Relational(
                    predicate="stayed_out",
                    relation="stayed_out",
                    subject="body",
                    object=name,
                    frame=self._site.frame,
                    map_version=self._site.map_version,
                    region_m=region_of(about, self._site),
                ),
                clause=number,
            )

    def _answered(self, compiled: Compiled, act: Act, cited: str) -> Condition:
        stage = (compiled.part.template.stages or {})[act]
        before = compiled.contract.node(stage).depends_on
        nodes = [compiled.named(name) for name in (*before[-1:], stage)]
        return Condition(
            condition_id=ConditionId(f"{compiled.scope}goal.{act}"),
            text=f"The stage {stage} was accepted after what it builds on",
            effect=Temporal(predicate="in_order", interval_s=1.0, bound=1.0, nodes=tuple(nodes)),
            clause=cited,
        )

    # conditions -----------------------------------------------------------------------------------------------------

    def _conditions(self, compiled: Compiled, skipped: set[NodeId], *, before: NodeId | None) -> Iterator[Condition]:
        """The part's own conditions, each under the clause that it is tested for; orders begin where the last ended."""
        acts = _acts(compiled.part.template)
        for condition in compiled.contract.completion_conditions:
            act = acts.get(condition.condition_id)
            if act in ("return", "report") and removable(compiled.part.template, act) is not None:
                continue
            requested = compiled.part.answers.get(act) if act else None
            cited = clause_id(self._plan.number(requested)) if requested else compiled.clause
            made = replace(_renamed(condition, compiled), clause=cited)
            channel = self._recipient(compiled.part)
            made = of_channel(made, channel) if channel is not None and channel.readable else made
            gone = {compiled.named(name) for name in skipped}
            made = replace(made, effect=_without(made.effect, gone))
            made = _instead(made, gone, self._brought(compiled.part.place), scope=compiled.scope)
            made = self._over_the_way(compiled, made)
            yield _after(made, before) if before is not None and before != REQUEST else made

    def _brought(self, place_id: PlaceId | None) -> NodeId | None:
        """The stage that has brought the body to this place before; None if none has."""
        target = next((one.approach_m for one in self._site.places if one.place_id == place_id), None)
        found = [node.node_id for node in self._mission.nodes if target in tasks.targets_of(node)]
        return found[-1] if found else None

    def _over_the_way(self, compiled: Compiled, condition: Condition) -> Condition:
        """A circuit that is not all of the mission is judged by what was accepted: the body may be elsewhere by now."""
        effect = condition.effect
        home = self._home
        if not (self._scoped and home and isinstance(effect, Metric) and effect.predicate == "circuit"):
            return condition
        stage = next(
            node.node_id
            for node in compiled.contract.nodes
            if any(one.effect.predicate == "circuit" for one in node.success_conditions)
        )
        return replace(condition, effect=_done_at(home, compiled.named(stage)), fact="event")

    def _looked(self, compiled: Compiled) -> Iterator[Condition]:
        """Pictures that are to be of a place were taken there."""
        clause = compiled.part.clause
        place = next((one for one in self._site.places if clause.object and one.place_id == clause.object.id), None)
        if clause.act not in LOOKING or place is None or compiled.part.place is not None:
            return
        for node in compiled.contract.nodes:
            if any(isinstance(one.effect, Visual) for one in node.success_conditions):
                yield Condition(
                    condition_id=ConditionId(f"{compiled.scope}goal.there"),
                    text=f"The pictures were taken at {place.name}",
                    effect=_done_at(place, compiled.named(node.node_id)),
                    clause=compiled.clause,
                )

    def _of_act(self, compiled: Compiled, act: Act) -> list[Condition]:
        acts = _acts(compiled.part.template)
        return [one for one in compiled.contract.completion_conditions if acts.get(one.condition_id) == act]

    # what a person chose ----------------------------------------------------------------------------------------------

    def _place(self, name: str) -> Place | None:
        return bind_place(name, site=self._site) if name else None

    def _check_arguments(self) -> None:
        """A field that says another place than the text is a contradiction, not a choice (D43)."""
        known = {parameter.name for part in self._plan.parts for parameter in part.template.parameters}
        for name in self._arguments:
            if name not in known:
                raise ContractInvalid(
                    because("parameter_not_taken", name=name[:40], names=tuple(sorted(known)) or "none"),
                    where=because("at_argument", argument=name[:40]),
                )
        for part in self._plan.parts:
            for name, value in part.arguments.items():
                if str(self._arguments.get(name, value)) not in (
                    str(value),
                    f"{value:g}" if isinstance(value, float) else value,
                ):
                    other = str(self._arguments[name])[:40]
                    raise ContractInvalid(
                        because("argument_contradicts", place=f"{value:g}", parameter=name, said=other),
                        where=because("at_argument", argument=name),
                    )
            given = self._arguments.get(part.parameter) if part.parameter else None
            if given is None or part.place is None:
                continue
            place = bind_place(str(given), site=self._site)
            if place.place_id != part.place:
                raise ContractInvalid(
                    because("argument_contradicts", place=part.place, parameter=part.parameter, said=place.place_id),
                    where=because("at_argument", argument=part.parameter),
                )

    def _constraints(self, contracts: Sequence[tasks.TaskContract]) -> tasks.Constraints:
        """What holds for every part holds for the whole; a part that does not move sets no speed."""
        moving = [one for one in contracts if any(_moves(node) for node in one.nodes)] or list(contracts)
        resources = dict.fromkeys(name for one in contracts for name in one.constraints.resources)
        keep_out = {PlaceId(name) for one in contracts for name in one.constraints.keep_out}
        keep_out |= {PlaceId(name) for _, name in self._plan.keep_out}
        return tasks.Constraints(
            speed_cap_mps=min(one.constraints.speed_cap_mps for one in moving),
            keep_out=tuple(sorted(keep_out)),
            resources=tuple(ResourceId(name) for name in resources),
            minimum_charge=max(one.constraints.minimum_charge for one in contracts),
        )


def _places(contract: tasks.TaskContract) -> tuple[str, ...]:
    """The names of the places that a contract is bound to."""
    bound = (value for value in contract.bindings.values() if isinstance(value, Mapping) and "place_id" in value)
    return tuple(str(value["name"]) for value in bound)


def _acts(template: tasks.TaskTemplate) -> dict[str, Act]:
    """The act that a template says a condition is tested for; the others are tested for what the template serves."""
    return {str(one["condition_id"]): one["clause"] for one in template.completion_conditions if "clause" in one}


def _budget(contracts: Sequence[tasks.TaskContract]) -> int:
    ceiling = max(MISSION_BUDGET, *(one.recovery_total for one in contracts))
    return min(ceiling, sum(one.recovery_total for one in contracts))


def _moves(node: tasks.Node) -> bool:
    return "mobile_base" in node.resources or "navigate" in node.capabilities


def _resolved(node: tasks.Node, contract: tasks.TaskContract, skipped: set[NodeId]) -> list[NodeId]:
    """What a stage depends on, with what stands behind a stage that is left out."""
    found: list[NodeId] = []
    for name in node.depends_on:
        found.extend(_resolved(contract.node(name), contract, skipped) if name in skipped else [name])
    return list(dict.fromkeys(found))


def _rescoped(value: Any, compiled: Compiled) -> Any:
    """Placeholders of committed facts under the stages' names in the whole mission."""
    if not isinstance(value, str) or "@{" not in value:
        return value
    return _SPOT.sub(lambda spot: f"@{{{compiled.named(spot.group(1))}", value)


def _renamed(condition: Condition, compiled: Compiled) -> Condition:
    name = f"{compiled.scope}{condition.condition_id}"
    if compiled.request and condition.condition_id.startswith(f"{compiled.request}."):
        name = condition.condition_id
    return replace(condition, condition_id=ConditionId(name), effect=_of_nodes(condition.effect, compiled))


def _declaring(policy: tasks.EvidencePolicy, compiled: Compiled) -> tasks.EvidencePolicy:
    if isinstance(policy.declared, UnsetType):
        return policy
    return replace(policy, declared=tuple(ConditionId(f"{compiled.scope}{name}") for name in policy.declared))


def _of_nodes(effect: AnyEffect, compiled: Compiled) -> AnyEffect:
    known = {node.node_id for node in compiled.contract.nodes}

    def named(name: str) -> str:
        return compiled.named(name) if name in known else name

    match effect:
        case Temporal():
            return replace(effect, nodes=tuple(NodeId(named(name)) for name in effect.nodes))
        case Relational():
            return replace(effect, subject=named(effect.subject), object=named(effect.object))
        case Symbolic():
            return replace(effect, arguments={name: named(value) for name, value in effect.arguments.items()})
        case _:
            return effect


def _without(effect: AnyEffect, gone: set[NodeId]) -> AnyEffect:
    """An order without the stages that are left out."""
    if not isinstance(effect, Temporal) or not effect.nodes:
        return effect
    return replace(effect, nodes=tuple(name for name in effect.nodes if name not in gone))


def _instead(condition: Condition, gone: set[NodeId], stage: NodeId | None, *, scope: str) -> Condition:
    """What a stage that is left out was to show, of the stage that has brought the body there before.

    The condition belongs to that stage's part, whose facts it reads.
    """
    effect = condition.effect
    if not isinstance(effect, Relational) or effect.subject not in gone or stage is None:
        return condition
    own, part = condition.condition_id.removeprefix(scope), stage.rpartition(".")[0]
    name = f"{part}.{own}.{scope.rstrip('.')}" if part else condition.condition_id
    return replace(condition, condition_id=ConditionId(name), effect=replace(effect, subject=stage))


def _within(condition: Condition, nodes: set[NodeId]) -> Condition | None:
    """The condition over the stages that there are; None for an order of fewer than two."""
    effect = condition.effect
    if not isinstance(effect, Temporal) or not effect.nodes:
        return condition
    left = tuple(name for name in effect.nodes if name in nodes)
    return replace(condition, effect=replace(effect, nodes=left)) if len(left) > 1 else None


def _after(condition: Condition, before: NodeId) -> Condition:
    """An order that begins with the last stage of the clause before."""
    effect = condition.effect
    if not isinstance(effect, Temporal) or len(effect.nodes) < 2 or before in effect.nodes:
        return condition
    first = effect.nodes[:1] if effect.nodes[0] == REQUEST else ()
    return replace(condition, effect=replace(effect, nodes=(*first, before, *effect.nodes[len(first) :])))


def _done_at(place: Place, stage: NodeId) -> Relational:
    return Relational(
        predicate="one_subject",
        relation="one_subject",
        subject=stage,
        object=place.place_id,
        frame=place.frame,
        map_version=place.map_version,
        region_m=ground_m(place),
    )


def _stands_at(place: Place, *, condition_id: str, clause: str) -> Condition:
    return Condition(
        condition_id=ConditionId(condition_id),
        text=f"The body stands within {TOLERANCE_M:.2f} m of {place.name} now",
        fact="state",
        effect=Metric(
            predicate="arrival",
            frame=place.frame,
            map_version=place.map_version,
            target_m=place.approach_m,
            tolerance_m=TOLERANCE_M,
        ),
        clause=clause,
    )
