"""Finds how each clause of a reading is done: by which templates, in which order, under which prohibitions. Pure.

What no template, stage or constraint can express moves to the unread part of the reading: it is not claimed (D41, D42).
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from msgspec import UNSET
from msgspec.structs import replace

from harness.contracts.ids import NodeId, PlaceId
from harness.contracts.places import MissionProfile, Place, Site
from harness.contracts.readings import (
    LONGEST_WAIT_S,
    Act,
    Clause,
    ClauseObject,
    Default,
    PictureSubject,
    Reading,
    Unread,
    UnreadWhy,
)
from harness.contracts.tasks import Serves, TaskTemplate
from harness.contracts.values import Point
from harness.planning.binding import place_of
from harness.verification.geometry import contains

MOST_PARTS = 6
"""How many passes of templates one mission may have: each has stages, and the mission's budget is for all of them."""
KEPT_OUT: tuple[Act, ...] = ("go", "inspect", "photograph", "describe")
"""Acts whose prohibition is kept by staying out of the place."""
LOOKING: tuple[Act, ...] = ("photograph", "describe")
WAITING = "seconds"
"""The parameter of a template that takes how long a clause wants to wait."""
SUBJECT_KIND, SUBJECT = "subject_kind", "subject"
"""The parameters of a template that take what a photograph is to show."""


@dataclass(frozen=True)
class Part:
    """One pass of a template for one clause. `arguments` are the clause's own, beside its place; `answers` are further
    acts and the clauses that its stages answer; `tells` are the parts whose outcome it reports, of which it says
    `outcomes`.
    """

    template: TaskTemplate
    clause: Clause
    parameter: str = ""
    place: PlaceId | None = None
    arguments: Mapping[str, float | str] = field(default_factory=dict)
    answers: Mapping[Act, Clause] = field(default_factory=dict)
    tells: tuple["Part", ...] = ()
    outcomes: tuple[str, ...] = ()


@dataclass(frozen=True)
class GoalPlan:
    """How a reading is done. `reading` holds the clauses that are done or kept; the rest of it is unread.

    `declined` are the defaults that the goal leaves out, `ends_at` where an explicit return leads.
    """

    reading: Reading
    parts: tuple[Part, ...]
    keep_out: tuple[tuple[Clause, str], ...]
    declined: Mapping[Default, Clause]
    returning: Clause | None

    def number(self, clause: Clause) -> int:
        """The clause's number in the reading, from 1; the same clause object is found, not an equal one."""
        return next(number for number, one in enumerate(self.reading.clauses, start=1) if one is clause)


def profile_of(site: Site) -> MissionProfile | None:
    """The site's mission profile; None for a site file without one."""
    return None if site.profile is UNSET else site.profile


def removable(template: TaskTemplate, act: Act) -> NodeId | None:
    """The stage of a default that the template can do without: what is left still has other stages of its own."""
    stage = (template.stages or {}).get(act)
    others = [
        node for node in template.nodes if node["node_id"] != stage and "take_request" not in node["capabilities"]
    ]
    return stage if stage and others else None


def plan_reading(reading: Reading, *, templates: Sequence[TaskTemplate], site: Site) -> GoalPlan:
    """The plan of a reading under these templates, tried in their order. Raises nothing."""
    return _Planning(reading, templates, site).plan()


class _Planning:
    def __init__(self, reading: Reading, templates: Sequence[TaskTemplate], site: Site) -> None:
        self._reading, self._templates, self._site = reading, templates, site
        self._profile = profile_of(site)
        self._parts: list[Part] = []
        self._kept: list[Clause] = []
        self._left: list[Unread] = []
        self._declined: dict[Default, Clause] = {}
        self._keep_out: list[tuple[Clause, str]] = []
        self._returning: Clause | None = None

    def plan(self) -> GoalPlan:
        clauses = self._reading.clauses
        for index, clause in enumerate(clauses):
            if not clause.negated:
                why = self._do(clause, last=not any(self._moves(one) for one in clauses[index + 1 :]))
                self._settle(clause, why)
        for clause in clauses:
            if clause.negated:
                self._settle(clause, self._forbid(clause))
        bound_clauses = tuple(clause for clause in clauses if any(clause is one for one in self._kept))
        defaults = tuple(self._defaults())
        found = replace(
            self._reading,
            clauses=bound_clauses,
            defaults=defaults,
            unread=_in_order([*self._reading.unread, *self._left]),
        )
        return GoalPlan(found, tuple(self._parts), tuple(self._keep_out), self._declined, self._returning)

    def _settle(self, clause: Clause, why: UnreadWhy | None) -> None:
        if why is None:
            self._kept.append(clause)
        else:
            self._left.extend(Unread(span=span, why=why) for span in clause.spans)

    def _moves(self, clause: Clause) -> bool:
        return not clause.negated and clause.act not in ("report", "deliver", "return")

    # what is to be done ---------------------------------------------------------------------------------------------

    def _do(self, clause: Clause, *, last: bool) -> UnreadWhy | None:
        """Add the parts of a clause; why not, if there are none."""
        if clause.act in ("report", "deliver") or (clause.act in LOOKING and self._same_subject(clause)):
            before = [*self._parts]
            if self._answered(clause):
                why = self._tell_beside(clause) if clause.act == "report" else None
                self._parts = self._parts if why is None else before
                return why
            if clause.act not in LOOKING:
                return self._tell(clause) if clause.act == "report" else "no_template"
        if clause.act == "return":
            return self._return(clause, last=last)
        if clause.count > 1 and clause.act in ("go", "explore", "wait"):
            return "count"
        if clause.act == "wait" and not (isinstance(clause.seconds, int) and clause.seconds <= LONGEST_WAIT_S):
            return "wait_too_long" if isinstance(clause.seconds, int) else "wait_unstated"
        if clause.act == "explore" and any(part.clause.act == "explore" for part in self._parts):
            return "count"
        made = list(self._parts_of(clause))
        if not made:
            return "no_object" if clause.act == "wait" and clause.object is None else "no_template"
        if len(self._parts) + len(made) * clause.count > MOST_PARTS:
            return "count"
        self._parts.extend(made * clause.count)
        return None

    def _return(self, clause: Clause, *, last: bool) -> UnreadWhy | None:
        """A return on the way is a way to that place; the last one is how the mission ends."""
        if clause.count > 1 or self._returning is not None:
            return "count"
        home = self._profile.home if self._profile else None
        target = PlaceId(clause.object.id) if clause.object else home
        if last and self._parts and target == home:
            self._returning = clause
            return None
        part = self._serving(clause, ClauseObject(kind="place", id=target or ""))
        if part is None or target is None:
            return "no_template"
        self._parts.append(part)
        return None

    def _tell(self, clause: Clause) -> UnreadWhy | None:
        """Add a part that speaks what the parts since the last report achieved; one without a sentence is not told.

        What is found there is no outcome of a way: it is asked. A return before it is a way then, not the end.
        """
        if clause.count > 1 or _of_findings(clause):
            return "count" if clause.count > 1 else "no_template"
        returning, ways = self._returning, self._parts
        if returning is not None:
            way = self._serving(returning, ClauseObject(kind="place", id=self._profile.home if self._profile else ""))
            if way is None:
                return "no_template"
            self._parts = [*ways, way]
        parts = self._unreported()
        why = self._speak(clause, parts) if parts else "no_template"
        if why is None:
            self._returning = None
        else:
            self._parts = ways
        return why

    def _tell_beside(self, clause: Clause) -> UnreadWhy | None:
        """A report that an earlier part has a stage for speaks of that part alone: the others are told beside it."""
        parts = () if _of_findings(clause) else self._unreported()
        return self._speak(clause, parts) if parts else None

    def _unreported(self) -> tuple[Part, ...]:
        """The parts since the last spoken report that have no report of their own."""
        reports = [number for number, one in enumerate(self._parts) if one.clause.act == "report"]
        since = self._parts[reports[-1] + 1 if reports else 0 :]
        return tuple(one for one in since if "report" not in (one.template.stages or {}))

    def _speak(self, clause: Clause, parts: tuple[Part, ...]) -> UnreadWhy | None:
        """Add the part that says what these achieved, if each of them has a sentence for it."""
        reporter = next((one for one in self._templates if any(_tells(serve) for serve in one.serves or ())), None)
        outcomes = tuple(_outcome(one.template, reporter) for one in parts) if reporter else ()
        if reporter is None or not all(outcomes):
            return "no_template"
        if len(self._parts) >= MOST_PARTS:
            return "count"
        self._parts.append(Part(template=reporter, clause=clause, tells=parts, outcomes=outcomes))
        return None

    def _answered(self, clause: Clause) -> bool:
        """Whether a stage of an earlier part answers this clause: its delivery, its report, its description."""
        for index in range(len(self._parts) - 1, -1, -1):
            part = self._parts[index]
            if clause.act in (part.template.stages or {}) and clause.act not in part.answers and clause.count == 1:
                self._parts[index] = dataclasses.replace(part, answers={**part.answers, clause.act: clause})
                return True
        return False

    def _same_subject(self, clause: Clause) -> bool:
        """Whether the part before looks at the same thing: one picture is then taken and described."""
        before = self._parts[-1] if self._parts else None
        return before is not None and before.clause.act in LOOKING and before.clause.object == clause.object

    def _parts_of(self, clause: Clause) -> Iterator[Part]:
        about = self._about(clause)
        part = self._serving(clause, about) if about else None
        if part is not None:
            yield part
        elif about is not None and about.kind == "place" and clause.act in LOOKING:
            way = self._serving(replace(clause, act="go", subject=UNSET), about)
            look = self._serving(clause, ClauseObject(kind="here"))
            if way and look:
                yield dataclasses.replace(way, clause=clause)
                yield look

    def _about(self, clause: Clause) -> ClauseObject | None:
        """What a template is bound to: for a passage, the place that it belongs to (D43)."""
        target = clause.object or ClauseObject(kind="site" if clause.act == "explore" else "here")
        if clause.act == "wait" and target.kind == "here":
            ends_at = self._ends_at()
            return ClauseObject(kind="place", id=ends_at) if ends_at else None
        if target.kind != "passage":
            return target
        passage = next((one for one in self._site.passages if one.passage_id == target.id), None)
        place = place_of(passage, site=self._site) if passage else None
        return ClauseObject(kind="place", id=place.place_id) if place else None

    def _ends_at(self) -> PlaceId | None:
        """Where the body is after the parts so far; None before the first, and after one that ends anywhere."""
        still = (*LOOKING, "report")
        moved = (part for part in reversed(self._parts) if part.place or part.clause.act not in still)
        before = next(moved, None)
        if before is None or before.clause.act == "explore":
            return None
        home = self._profile.home if self._profile else None
        return home if before.clause.act == "walk_route" else before.place

    def _serving(self, clause: Clause, about: ClauseObject) -> Part | None:
        for template in self._templates:
            for one in template.serves or ():
                if (one.act, one.object) != (clause.act, about.kind):
                    continue
                if about.kind == "route" and about.id != self._loop():
                    continue
                place = PlaceId(about.id) if one.parameter else None
                if takes_subject(template) != isinstance(clause.subject, PictureSubject):
                    continue
                own = dict(_own_arguments(clause))
                return Part(template=template, clause=clause, parameter=one.parameter, place=place, arguments=own)
        return None

    def _loop(self) -> str:
        """The route that a template's `circuit` is bound to: the first one from home to home."""
        home = self._profile.home if self._profile else None
        return next((one.name for one in self._site.routes if one.start == one.end and home in (None, one.end)), "")

    # what is forbidden ----------------------------------------------------------------------------------------------

    def _forbid(self, clause: Clause) -> UnreadWhy | None:
        match clause.act:
            case "return" | "report":
                return self._decline(clause, clause.act)
            case act if act in KEPT_OUT and clause.object is not None:
                return self._stay_out(clause, clause.object)
            case _:
                return "negation"

    def _decline(self, clause: Clause, default: Default) -> UnreadWhy | None:
        away = clause.object is not None and self._profile is not None and clause.object.id != self._profile.home
        if away or default in self._declined or (default == "return" and self._returning is not None):
            return "negation"
        if any(part.tells for part in self._parts) and default == "report":
            return "negation"
        fixed = [part for part in self._parts if default in (part.template.stages or {})]
        fixed = [part for part in fixed if removable(part.template, default) is None or default in part.answers]
        allowed = self._profile is not None and default in self._profile.removable
        if fixed or not allowed:
            return "negation"
        self._declined[default] = clause
        return None

    def _stay_out(self, clause: Clause, about: ClauseObject) -> UnreadWhy | None:
        region = region_of(about, self._site)
        if len(region) < 3 or any(contains(region, point) for point in self._targets()):
            return "negation"
        self._keep_out.append((clause, about.id))
        return None

    def _targets(self) -> list[Point]:
        """Where the parts go: a place that is asked for cannot be forbidden."""
        named = {part.place for part in self._parts}
        return [place.approach_m for place in self._site.places if place.place_id in named]

    def _defaults(self) -> Iterator[Default]:
        """What the mission profile adds to what was asked, in its order."""
        declared: tuple[Default, ...] = self._profile.defaults if self._profile else ("return", "report")
        for default in declared:
            parts = [part for part in self._parts if removable(part.template, default)]
            requested = any(default in part.answers for part in self._parts)
            ways = [part for part in self._parts if not part.tells]
            if default == "return" and ways:
                requested = self._returning is not None or ways[-1].clause.act in ("go", "return")
            if parts and not requested and default not in self._declined:
                yield default


def _of_findings(clause: Clause) -> bool:
    """Whether a report is to be of what was found, not of what was done."""
    return clause.object is not None and clause.object.kind == "finding"


def _tells(serves: Serves) -> bool:
    return (serves.act, serves.object) == ("report", "here")


def tells_only(template: TaskTemplate) -> bool:
    """Whether all that a template does is to report what others achieved: by itself it has nothing to say."""
    return bool(template.serves) and all(_tells(one) for one in template.serves or ())


def _outcome(template: TaskTemplate, reporter: TaskTemplate) -> str:
    """What is said of a template whose stages were all accepted: its own sentence, or the reporting one's for it."""
    if isinstance(template.outcome, str):
        return template.outcome
    return (reporter.outcomes or {}).get(template.name, "")


def takes_subject(template: TaskTemplate) -> bool:
    """Whether its picture is to show something: it has the parameter for that."""
    return any(one.name == SUBJECT for one in template.parameters)


def _own_arguments(clause: Clause) -> Iterator[tuple[str, float | str]]:
    """What a clause says beside its place, as its template's parameters."""
    if isinstance(clause.seconds, int):
        yield WAITING, float(clause.seconds)
    if isinstance(clause.subject, PictureSubject):
        yield SUBJECT_KIND, clause.subject.kind
        yield SUBJECT, clause.subject.name


def region_of(about: ClauseObject, site: Site) -> tuple[Point, ...]:
    """The floor of a place, passage or zone, metres in the site's frame; empty where none is surveyed."""
    match about.kind:
        case "place":
            return next((one.region_m for one in site.places if one.place_id == about.id), ())
        case "passage":
            return next((one.floor_m for one in site.passages if one.passage_id == about.id), ())
        case "region":
            return next((one.region_m for one in site.zones if one.name == about.id), ())
        case _:
            return ()


def home_of(site: Site) -> Place | None:
    """Where a return leads; None for a site without a mission profile."""
    profile = profile_of(site)
    return next((one for one in site.places if profile and one.place_id == profile.home), None)


def _in_order(unread: Sequence[Unread]) -> tuple[Unread, ...]:
    return tuple(sorted(set(unread), key=lambda one: (one.span.start, one.span.end, one.why)))
