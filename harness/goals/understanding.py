"""Decides whether a goal is understood well enough to start, and as what (D41). Pure: writes nothing."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from harness.contracts.errors import ContractInvalid, GoalNotUnderstood, ReadingStale
from harness.contracts.ids import Digest, sha256
from harness.contracts.places import Site
from harness.contracts.readings import Clause, ClauseObject, PictureSubject, Reading, ReadingQuestion, TextSpan, Unread
from harness.contracts.reasons import because
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.spoken_goals import Transcription
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.goals.names import object_of_place, object_of_route
from harness.goals.reader import GRAMMAR, GoalReader, admitted, proposed_reading, site_version
from harness.goals.satisfiable import check_satisfiable
from harness.goals.tokens import folded
from harness.planning.binding import bind_place
from harness.planning.clauses import SUBJECT, SUBJECT_KIND, WAITING, GoalPlan, plan_reading, takes_subject
from harness.planning.compile import Argument, compile_contract
from harness.planning.composition import compile_plan
from harness.planning.recipients import by_default
from harness.planning.templates import LONGEST_GOAL, by_name, goal_of


@dataclass(frozen=True)
class GoalRequest:
    """What a person asked for: a template by name, a goal in words, or both; what they chose beside it.

    `confirm` is the digest of the reading that they confirmed. `heard`: what the text was written down from, where it
    was spoken.
    """

    template: str = ""
    text: str = ""
    arguments: Mapping[str, Argument] | None = None
    confirm: str = ""
    heard: Transcription | None = None


@dataclass(frozen=True)
class UnderstoodGoal:
    """What will run: the plan of a reading, or a template that takes no goal in words; `text` is the goal's source."""

    text: str
    plan: GoalPlan | None
    template: TaskTemplate | None
    confirmed: Digest | None = None


def understand(
    request: GoalRequest, *, templates: Sequence[TaskTemplate], site: Site, reader: GoalReader = GRAMMAR
) -> UnderstoodGoal:
    """What the request means under these templates and at this site. What two decodings of a recording do not agree
    on is asked, however well the text itself can be read (D48).

    Raises GoalNotUnderstood with the nearest reading, ReadingStale for another reading than the one confirmed,
    UnknownName for a template or place, ContractInvalid for a text that is empty, too long or no text.
    """
    try:
        found = _understood(request, templates=templates, site=site, reader=reader)
    except GoalNotUnderstood as error:
        question = replace(error.question, heard=request.heard)
        raise GoalNotUnderstood(error.what, question=question, where=error.where) from error
    if request.heard is None or request.heard.agreed or request.confirm:
        return found
    nearest = found.plan.reading if found.plan else None
    question = ReadingQuestion(text=found.text, nearest=nearest, unread=(), heard=request.heard)
    raise GoalNotUnderstood(because("goal_heard_in_two_ways"), question=question, where="goal")


def _understood(
    request: GoalRequest, *, templates: Sequence[TaskTemplate], site: Site, reader: GoalReader
) -> UnderstoodGoal:
    named = by_name(request.template, templates) if request.template else _by_phrase(request.text, templates)
    if named is not None and not request.template:
        return _by_name(named, request, templates, site)
    if named is not None and (not request.text or not named.serves):
        return _by_name(named, request, templates, site)
    text = goal_of(request.text).text
    preferred = _preferred(named, templates)
    first = GRAMMAR if reader.proposes else reader
    plan = plan_reading(admitted(first, text, site=site), templates=preferred, site=site)
    proposed = _proposed(reader, text, plan, request, templates=preferred, site=site)
    if proposed is not None:
        return proposed
    requested = named is not None and all(part.template.name != named.name for part in plan.parts)
    if named is not None and not plan.parts:
        plan = _instead(named, plan, request, templates, site)
    reading = plan.reading
    whole = bool(plan.parts) and not reading.unread and not requested
    if not plan.parts and not reading.unread:
        raise _nothing_to_do(text, plan)
    if request.confirm and (not plan.parts or request.confirm != reading.digest):
        raise ReadingStale(because("goal_read_otherwise", digest=request.confirm[:12]), where="confirm_reading")
    if not whole and not request.confirm:
        raise _not_understood(text, plan, named if requested else None)
    return UnderstoodGoal(text=text, plan=plan, template=None, confirmed=None if whole else reading.digest)


def _proposed(
    reader: GoalReader,
    text: str,
    plan: GoalPlan,
    request: GoalRequest,
    *,
    templates: Sequence[TaskTemplate],
    site: Site,
) -> UnderstoodGoal | None:
    """What a reader that only proposes makes of a text that the grammar left partly unread, once a person confirmed it.

    None where there is nothing to propose, or the person confirmed the grammar's reading. Raises GoalNotUnderstood
    with the proposal until it is confirmed: it never starts by itself (D41).
    """
    grammar_does = bool(plan.parts) and not plan.reading.unread
    if grammar_does or request.template or (plan.parts and request.confirm == plan.reading.digest):
        return None
    reading = proposed_reading(reader, text, site=site)
    proposal = plan_reading(reading, templates=templates, site=site) if reading is not None else None
    if proposal is None or not proposal.parts:
        return None
    if request.confirm == proposal.reading.digest:
        return UnderstoodGoal(text=text, plan=proposal, template=None, confirmed=proposal.reading.digest)
    if request.confirm:
        raise ReadingStale(because("goal_read_otherwise", digest=request.confirm[:12]), where="confirm_reading")
    raise _not_understood(text, proposal, None)


def compiled(
    found: UnderstoodGoal,
    *,
    templates: Sequence[TaskTemplate],
    site: Site,
    arguments: Mapping[str, Argument],
    rules: RulesVersion = CURRENT_RULES,
) -> TaskContract:
    """The contract of what was understood, under these rules. Raises as `compile_plan`, and Unsatisfiable."""
    if found.plan is not None:
        contract = compile_plan(
            found.plan,
            text=found.text,
            arguments=arguments,
            templates=templates,
            site=site,
            confirmed=found.confirmed,
            rules=rules,
        )
    elif found.template is not None:
        contract = compile_contract(
            goal=found.text, template=found.template, arguments=arguments, site=site, rules=rules
        )
        contract = by_default(contract, site)
    else:
        raise ContractInvalid(because("nothing_understood"), where="goal")
    check_satisfiable(contract, site=site)
    return contract


def read_again(
    contract: TaskContract, *, templates: Sequence[TaskTemplate], site: Site, rules: RulesVersion = CURRENT_RULES
) -> TaskContract | None:
    """The same reading compiled under other versions of its templates (D35); None for a contract without a reading."""
    reading = contract.reading
    if not isinstance(reading, Reading):
        return None
    plan = plan_reading(replace(reading, defaults=()), templates=templates, site=site)
    if plan.reading.digest != reading.digest:
        raise ReadingStale(because("goal_not_doable_as_read"), where="reading")
    confirmed = contract.confirmed if isinstance(contract.confirmed, str) else None
    found = UnderstoodGoal(text=contract.goal.text, plan=plan, template=None, confirmed=confirmed)
    return compiled(found, templates=templates, site=site, arguments=_chosen(contract, plan), rules=rules)


def _chosen(contract: TaskContract, plan: GoalPlan) -> dict[str, Argument]:
    """What a person had chosen beside the text, as the bindings of a goal of one part hold it."""
    names = {parameter.name for part in plan.parts for parameter in part.template.parameters}
    found = {name: value for name, value in contract.bindings.items() if name in names}
    return {name: value["place_id"] if isinstance(value, Mapping) else value for name, value in found.items()}


def _preferred(named: TaskTemplate | None, templates: Sequence[TaskTemplate]) -> list[TaskTemplate]:
    """The chosen template first: where two serve a clause, the person's choice does."""
    return [*([named] if named else []), *(one for one in templates if one is not named)]


def _by_phrase(text: str, templates: Sequence[TaskTemplate]) -> TaskTemplate | None:
    """The template that has the whole text among its phrases, word by word: "warehouse inspection" is its name too."""
    words = folded(text[:LONGEST_GOAL])
    return next((one for one in templates for phrase in one.phrases if folded(phrase) == words), None)


def _by_name(
    named: TaskTemplate, request: GoalRequest, templates: Sequence[TaskTemplate], site: Site
) -> UnderstoodGoal:
    """A template by its name alone means its own goal; one that serves no clause takes no other goal."""
    if not named.serves:
        if request.template and request.text not in ("", named.goal):
            raise ContractInvalid(because("template_without_words", title=named.title), where="goal")
        return UnderstoodGoal(text=request.text or named.goal, plan=None, template=named)
    text = request.text or _own_text(named, request.arguments or {})
    plan = plan_reading(_own_reading(named, request, text, site), templates=_preferred(named, templates), site=site)
    if request.confirm and request.confirm != plan.reading.digest:
        if request.template:
            raise ReadingStale(because("template_read_otherwise"), where="confirm_reading")
        raise ReadingStale(because("goal_read_otherwise", digest=request.confirm[:12]), where="confirm_reading")
    if plan.reading.unread:
        raise _not_understood(text, plan, None)
    return UnderstoodGoal(text=text, plan=plan, template=None)


def _own_text(named: TaskTemplate, arguments: Mapping[str, Argument]) -> str:
    """The template's goal where nothing else was chosen; else what was: the goal's own words would not be true then."""
    default = {parameter.name: parameter.default for parameter in named.parameters}
    other = {name: value for name, value in arguments.items() if value != default.get(name)}
    listing = ", ".join(f"{name}={value}" for name, value in sorted(other.items()))
    return f"{named.name} {listing}" if listing else named.goal


def _own_reading(named: TaskTemplate, request: GoalRequest, text: str, site: Site) -> Reading:
    """What a template declares that it does, with what the person chose."""
    serves = (named.serves or ())[0]
    default = {parameter.name: parameter.default for parameter in named.parameters}
    chosen = (
        (request.arguments or {}).get(serves.parameter, default.get(serves.parameter)) if serves.parameter else None
    )
    target = ClauseObject(kind=serves.object)
    if chosen is not None:
        target = object_of_place(bind_place(str(chosen), site=site))
    elif serves.object == "route":
        loops = [route for route in site.routes if route.start == route.end]
        target = object_of_route(loops[0]) if loops else target
    whole = TextSpan(start=0, end=len(text))
    seconds = (request.arguments or {}).get(WAITING, default.get(WAITING)) if serves.act == "wait" else None
    return Reading(
        text=sha256(text.encode()),
        site=site_version(site),
        reader="template",
        version=named.version,
        clauses=(
            Clause(
                act=serves.act,
                object=target,
                spans=(whole,),
                seconds=_whole_seconds(seconds),
                subject=_subject(named, {**default, **(request.arguments or {})}),
            ),
        ),
    )


def _subject(named: TaskTemplate, chosen: Mapping[str, Argument | None]) -> PictureSubject | UnsetType:
    """What the template's picture is to show."""
    kind, name = chosen.get(SUBJECT_KIND), chosen.get(SUBJECT)
    if not takes_subject(named) or kind not in ("text", "object") or not name:
        return UNSET
    return PictureSubject(kind="text" if kind == "text" else "object", name=str(name))


def _whole_seconds(value: Argument | None) -> int | UnsetType:
    """How long is to be waited, where that is stated as whole seconds; what is not whole asks."""
    try:
        number = float(value) if value is not None else math.nan
    except ValueError:
        return UNSET
    return int(number) if number >= 1.0 and number.is_integer() else UNSET


def _instead(
    named: TaskTemplate, plan: GoalPlan, request: GoalRequest, templates: Sequence[TaskTemplate], site: Site
) -> GoalPlan:
    """Nothing of the text can be done: the nearest reading is what the chosen template declares, all words unread."""
    declared = _own_reading(named, request, request.text, site)
    whole = TextSpan(start=0, end=len(request.text))
    unread = plan.reading.unread or (Unread(span=whole, why="unknown_words"),)
    clauses = tuple(replace(clause, spans=()) for clause in declared.clauses)
    reading = replace(declared, clauses=clauses, unread=unread, fillers=plan.reading.fillers)
    return plan_reading(reading, templates=_preferred(named, templates), site=site)


def _nothing_to_do(text: str, plan: GoalPlan) -> GoalNotUnderstood:
    """A goal that only says what not to do is refused: it would be met by standing still."""
    question = ReadingQuestion(text=text, nearest=None, unread=plan.reading.unread)
    return GoalNotUnderstood(because("goal_only_forbids"), question=question, where="goal")


def _not_understood(text: str, plan: GoalPlan, chosen: TaskTemplate | None) -> GoalNotUnderstood:
    reading = plan.reading
    question = ReadingQuestion(
        text=text,
        nearest=reading if plan.parts else None,
        unread=reading.unread,
        template=chosen.name if chosen else "",
    )
    what = because("goal_not_wholly_understood" if plan.parts else "goal_not_understood")
    return GoalNotUnderstood(what, question=question, where="goal")
