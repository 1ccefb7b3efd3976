"""Builds the clauses of one part of a sentence: a verb with its object, or another object of the verb before. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from msgspec import UNSET, UnsetType

from harness.contracts.readings import Act, Clause, ClauseObject, PictureSubject, TextSpan, Unread, UnreadWhy
from harness.goals.lexicon import ARRIVING, FINDING, HOMECOMING, LIMITING, LOOKING_AROUND, STATING, TELLING_SIGHT
from harness.goals.words import Item, Meaning

DIRECTLY, FOR = frozenset({"verb", "name", "here", "pronoun"}), "for"
"""What a time may follow: "wait at most two minutes" is no wait of two minutes."""
ACCEPTED: dict[Act, tuple[str, ...]] = {
    "go": ("place", "region", "passage"),
    "return": ("place",),
    "inspect": ("place", "passage"),
    "photograph": ("place", "passage", "here"),
    "describe": ("place", "passage", "here"),
    "walk_route": ("route",),
    "explore": ("site", "place", "region"),
    "report": ("finding",),
    "deliver": ("finding", "channel"),
    "wait": ("place", "region", "here"),
}
"""What kinds of object a verb takes. A prohibition may also name a zone."""
NEEDS_OBJECT = frozenset({"go", "inspect", "walk_route"})
MOST_TIMES = 99
LOOKING: tuple[Act, ...] = ("photograph", "describe")
FINITE = frozenset({"swing"})
"""Verbs that end like a participle and are none."""
MIND = frozenset({"would you mind", "do you mind", "how about"})
"""What asks for something by a participle: "would you mind checking the storage area"."""
LED = frozenset({"verb", "asks", "name", "and", "filler", "lead", "site", "around", "neg", "then"})
"""What may follow a "go" that adds nothing."""
SHOWN: tuple[Act, ...] = ("explore", "describe")
"""Acts whose outcome is told by the mission's own report: what they show."""


@dataclass(frozen=True)
class ClauseDraft:
    """A clause as it grows. `asking`: a tail still has to name the state that is asked for."""

    act: Act
    spans: tuple[TextSpan, ...]
    object: ClauseObject | None = None
    negated: bool = False
    count: int = 1
    counted: bool = False
    asking: bool = False
    passing: bool = False
    around: bool = False
    telling: bool = False
    """A report of what is seen: of a picture, or on the way to a place, a description."""
    finding: bool = False
    """A report of what was found or seen, not only of what was done."""
    arriving: int = 0
    """A report of having come somewhere (ARRIVING) or back (HOMECOMING)."""
    seconds: int | UnsetType = UNSET
    """How long is to be waited."""
    subject: PictureSubject | UnsetType = UNSET
    """What a photograph is to show."""
    meant: ClauseObject | None = None
    """The place named last before this verb: what it is about if it names none itself."""
    beside: ClauseObject | None = None
    """A second name that says where the first one is: "the passage *in the storage area*"."""


@dataclass
class Parse:
    """What has been parsed so far: clauses in order, and what became of the rest of the text."""

    clauses: list[ClauseDraft] = field(default_factory=list)
    fillers: list[TextSpan] = field(default_factory=list)
    unread: list[Unread] = field(default_factory=list)
    place: ClauseObject | None = None
    """The place or passage named last: what "it" and "there" stand for."""
    route: ClauseObject | None = None
    """The route named last: what "it" stands for where something is walked."""


def described(drafts: Sequence[ClauseDraft]) -> list[ClauseDraft]:
    """The drafts, with reports of what is seen as descriptions where they tell of a picture or of where the way led.

    "Take a picture and tell me what is there"; by itself "tell me what you see" is of here. What was inspected,
    explored or described is told by its own report.
    """
    made: list[ClauseDraft] = []
    for draft in drafts:
        before = made[-1] if made else None
        seen = before is None or (before.act in ("photograph", "go") and not before.negated)
        if draft.telling and seen and not draft.negated and draft.count == 1:
            draft = replace(draft, act="describe")
        made.append(draft)
    return made


def misplaced(drafts: Sequence[ClauseDraft]) -> list[ClauseDraft]:
    """Reports of having come somewhere that do not follow a way there: "photograph it and tell me when you arrive"."""
    found = []
    for index, draft in enumerate(drafts):
        before = drafts[index - 1] if index else None
        acts = ("go", "return") if draft.arriving == ARRIVING else ("return", "walk_route")
        there = before is not None and before.act in acts and not before.negated and before.count == 1
        if draft.arriving and not draft.negated and not there:
            found.append(draft)
    return found


def clause_of(draft: ClauseDraft) -> Clause:
    """The clause that a draft has become. A report of what was found is about the finding."""
    finding = ClauseObject(kind="finding") if draft.finding and draft.act == "report" and not draft.negated else None
    return Clause(
        act=draft.act,
        object=draft.object or finding,
        negated=draft.negated,
        count=draft.count,
        spans=draft.spans,
        seconds=draft.seconds,
        subject=draft.subject,
    )


def parse_part(part: Sequence[Item], state: Parse, *, links: Sequence[str]) -> list[ClauseDraft]:
    """The clauses of one part. A part without a verb names another object for the verb before it."""
    builder = _Builder(state, links)
    for index, item in enumerate(part):
        builder.take(item, after=part[index + 1] if index + 1 < len(part) else None)
    return builder.done()


class _Builder:
    """Takes the items of one part in turn; what no rule takes is unread."""

    def __init__(self, state: Parse, links: Sequence[str]) -> None:
        self._state, self._links = state, links
        self._made: list[ClauseDraft] = []
        self._named: list[Item] = []
        self._glue: list[TextSpan] = []
        self._negation: Item | None = None
        self._count: Item | None = None
        self._last: Item | None = None
        """The item before this one."""
        self._forbids: Item | None = None
        """The first "do not" of this part."""

    def take(self, item: Item, *, after: Item | None) -> None:
        """One item; `after` is the next one of the part."""
        self._taken(item, after=after)
        self._last = item

    def _taken(self, item: Item, *, after: Item | None) -> None:
        match item.kind:
            case "lasting":
                self._last_for(item)
            case "subject":
                self._show(item)
            case "verb" | "asks" | "passes" if self._unasked(item):
                self._leave(item, "statement")
            case "verb" | "asks" | "passes":
                self._verb(item)
            case "done" if "after" in self._links:
                self._verb(item)
            case "lead":
                self._lead(item, after)
            case "name" | "site" | "around" | "here" | "pronoun":
                self._name(item)
            case "neg" | "avoid":
                self._negate(item)
            case "count" | "laps":
                self._counted(item)
            case "tail" | "attached":
                self._tail(item)
            case "both" if after is None or after.kind not in ("name", "preposition", "filler"):
                self._leave(item, "ambiguous")
            case "preposition":
                self._glue.append(span_of(item))
            case "filler" if item.word.number == LIMITING and self._forbids is not None:
                self._leave(item, "negation")
            case "filler" | "stop" | "sep" | "and" | "then" | "first" | "both":
                self._state.fillers.append(span_of(item))
            case _:
                self._leave(item)

    def done(self) -> list[ClauseDraft]:
        """The finished clauses; complains about what never found its place."""
        if self._named and not self._made:
            self._coordinate()
        if self._count and self._made:
            self._repeat(self._count)
        elif self._count:
            self._leave(self._count, "count")
        for item in self._named:
            self._leave(item, "ambiguous")
        if self._negation is not None:
            self._leave(self._negation, "negation")
        if self._made and self._glue:
            self._made[-1] = _grown(self._made[-1], *self._glue)
        elif self._glue:
            self._state.unread.extend(Unread(span=span, why="unknown_words") for span in self._glue)
        return [whole for draft in self._folded() if (whole := self._whole(draft)) is not None]

    def _folded(self) -> list[ClauseDraft]:
        """The clauses, with what says the same again folded in: "沿环线走一遍", "explore the site and tell me"."""
        folded: list[ClauseDraft] = []
        for draft in self._made:
            before = folded[-1] if folded else self._state.clauses[-1] if self._state.clauses else None
            if folded and before is not None and _repeats(before, draft):
                folded[-1] = replace(draft, spans=(*before.spans, *draft.spans))
                continue
            if before is None or not _folds(before, draft, together=bool(folded)):
                folded.append(draft)
                continue
            grown = _grown(before, *draft.spans)
            if draft.counted and not before.counted:
                grown = replace(grown, count=draft.count, counted=True)
            if folded:
                folded[-1] = grown
            else:
                self._state.clauses[-1] = grown
        return folded

    def _verb(self, item: Item) -> None:
        draft = ClauseDraft(
            act=item.word.act or "inspect",
            spans=(*self._glue, span_of(item)),
            negated=self._negation is not None,
            asking=item.kind == "asks",
            passing=item.kind == "passes",
            around=item.word.number == LOOKING_AROUND,
            telling=item.word.number == TELLING_SIGHT,
            finding=item.word.act == "report" and item.word.number in (TELLING_SIGHT, FINDING),
            arriving=item.word.number if item.word.number in (ARRIVING, HOMECOMING) else 0,
            meant=self._state.place,
        )
        self._glue = []
        if self._negation is not None:
            draft = _grown(draft, span_of(self._negation))
            self._negation = None
        if draft.passing and not draft.negated:
            self._leave(item)
            return
        self._made.append(self._led(draft))
        if draft.act == "return":
            return
        waiting, self._named = self._named, []
        for number, one in enumerate(waiting):
            if number and one.kind == "name":
                self._made.append(replace(draft, spans=()))
            self._name(one)

    def _unasked(self, item: Item) -> bool:
        """Whether a participle stands alone: "checking the storage area" says what is done, and asks for nothing."""
        if not is_participle(item) or self._negation is not None or self._links:
            return False
        wish = self._last is not None and self._last.text in MIND
        return not wish and all(draft.asking for draft in self._made)

    def _led(self, draft: ClauseDraft) -> ClauseDraft:
        """ "go" without a place before another verb is only the way there: what forbids it forbids what follows."""
        before = self._made[-1] if self._made else None
        if before is None or before.object is not None or before.act != "go" or before.counted:
            return draft
        self._made.pop()
        return replace(draft, spans=(*before.spans, *draft.spans), negated=draft.negated or before.negated)

    def _lead(self, item: Item, after: Item | None) -> None:
        """ "go and" before another verb adds nothing; "go" that nothing follows asks for no place."""
        if after is not None and after.kind in LED:
            self._glue.append(span_of(item))
        else:
            self._leave(item, "no_object")

    def _name(self, item: Item) -> None:
        if item.kind == "pronoun" and self._made and self._made[-1].act == "deliver" and not self._made[-1].negated:
            self._made[-1] = _grown(self._made[-1], *self._glue, span_of(item))
            self._glue = []
            return
        target = self._target_of(item)
        if target is None:
            self._leave(item, "no_object")
            return
        if not self._made:
            self._named.append(item)
            return
        draft = self._made[-1]
        if draft.act == "inspect" and target.kind == "route" and draft.object is None:
            draft = replace(draft, act="walk_route")
        if draft.around and target.kind in ("place", "passage"):
            draft = replace(draft, act="inspect")
        accepted = (*ACCEPTED[draft.act], *(("region",) if draft.negated else ()))
        open_route = draft.object == ClauseObject(kind="route") and target.kind == "route"
        if (draft.object is None or open_route) and target.kind in accepted:
            self._made[-1] = replace(_grown(draft, *self._glue, span_of(item)), object=target)
            self._glue = []
        elif draft.object is not None and _same_subject(draft.object, target):
            first, second = (target, draft.object) if target.kind == "passage" else (draft.object, target)
            beside = draft.beside if second == first else second
            self._made[-1] = replace(_grown(draft, *self._glue, span_of(item)), object=first, beside=beside)
            self._glue = []
        else:
            self._leave(item, "ambiguous")
        if target.kind in ("place", "passage"):
            self._state.place = target
        if target.kind == "route":
            self._state.route = target

    def _target_of(self, item: Item) -> ClauseObject | None:
        match item.kind:
            case "around" if self._made and self._made[-1].act in LOOKING:
                return ClauseObject(kind="here")
            case "site" | "around":
                return ClauseObject(kind="site")
            case "here":
                return ClauseObject(kind="here")
            case "pronoun":
                if self._made and self._made[-1].act == "walk_route":
                    return self._state.route
                return self._state.place or (ClauseObject(kind="here") if self._pictured() else None)
            case _:
                return item.word.object

    def _pictured(self) -> bool:
        """Whether "it" may be what was photographed or described before, where no place was named."""
        earlier = [*self._state.clauses, *self._made[:-1]]
        looking = bool(self._made) and self._made[-1].act in LOOKING
        return looking and bool(earlier) and earlier[-1].act in LOOKING

    def _negate(self, item: Item) -> None:
        self._forbids = self._forbids or item
        if item.kind == "avoid":
            self._made.append(ClauseDraft(act="go", spans=(*self._glue, span_of(item)), negated=True))
            self._glue = []
        elif self._negation is not None:
            self._leave(item, "negation")
        else:
            self._negation = item

    def _counted(self, item: Item) -> None:
        if self._made:
            self._repeat(item)
        elif self._count is None:
            self._count = item
        else:
            self._leave(item, "count")

    def _repeat(self, item: Item) -> None:
        draft = self._made[-1]
        number = item.word.number
        if draft.counted or draft.negated or not 1 <= number <= MOST_TIMES:
            self._leave(item, "count")
            return
        if item.kind == "laps" and draft.act in ("walk_route", "inspect") and draft.object is None:
            draft = replace(draft, act="walk_route", object=ClauseObject(kind="route"))
        elif item.kind == "laps" and draft.act != "walk_route":
            self._leave(item, "count")
            return
        self._made[-1] = replace(_grown(draft, span_of(item)), count=number, counted=True)
        self._count = None

    def _last_for(self, item: Item) -> None:
        """ "wait for five minutes": a time counts where it follows the verb or the place at once, or after "for"."""
        draft, before = self._made[-1] if self._made else None, self._last
        follows = before is not None and (before.kind in DIRECTLY or before.text == FOR)
        waits = draft is not None and draft.act == "wait" and isinstance(draft.seconds, UnsetType)
        if draft is None or not (follows and waits and item.word.number):
            self._leave(item, "time")
            return
        self._made[-1] = replace(_grown(draft, *self._glue, span_of(item)), seconds=item.word.number)
        self._glue = []

    def _show(self, item: Item) -> None:
        """ "photograph the sign that says B-12": what the picture is to show, one thing for one picture."""
        draft = self._made[-1] if self._made else None
        if draft is None or draft.act != "photograph" or draft.negated or not isinstance(draft.subject, UnsetType):
            self._leave(item)
            return
        self._made[-1] = replace(_grown(draft, *self._glue, span_of(item)), subject=item.word.subject or UNSET)
        self._glue = []

    def _tail(self, item: Item) -> None:
        draft = self._made[-1] if self._made else None
        if item.kind == "tail" and draft is not None and draft.act == "inspect" and draft.object is not None:
            self._made[-1] = replace(_grown(draft, span_of(item)), asking=False, act=item.word.act or draft.act)
        elif item.kind == "tail" and item.word.number == STATING and draft is None:
            self._leave(item, "statement")
        elif item.kind == "tail" and draft is None and self._named:
            self._verb(Item(Meaning("verb", act="inspect"), item.start, item.end, item.text))
        elif item.kind == "attached" and draft is not None and draft.act == item.word.act:
            self._made[-1] = replace(_grown(draft, span_of(item)), finding=draft.finding or item.word.number == FINDING)
        elif item.kind == "attached" and draft is None and self._before(item.word.act):
            grown = _grown(self._state.clauses[-1], span_of(item))
            self._state.clauses[-1] = replace(grown, finding=grown.finding or item.word.number == FINDING)
        else:
            self._leave(item)

    def _before(self, act: Act | None) -> bool:
        return bool(self._state.clauses) and self._state.clauses[-1].act == act

    def _coordinate(self) -> None:
        """ "check the dock and the storage area": the second name takes the verb of the first."""
        before = self._state.clauses[-1] if self._state.clauses else None
        linked = {"and", "sep", "then"} >= set(self._links)
        if before is None or before.object is None or before.negated or before.act == "return" or not linked:
            return
        waiting, self._named = self._named, []
        self._made.append(ClauseDraft(act=before.act, spans=tuple(self._glue)))
        self._glue = []
        for one in waiting:
            self._name(one)

    def _whole(self, draft: ClauseDraft) -> ClauseDraft | None:
        """The clause with all that it must name; None where that is missing, and its words are then unread."""
        lacking = draft.object is None and draft.act in NEEDS_OBJECT
        if lacking and draft.act == "inspect" and not draft.asking and draft.meant is not None:
            return replace(draft, object=draft.meant)
        if lacking or draft.asking:
            self._state.unread.extend(Unread(span=span, why="no_object") for span in draft.spans)
            return None
        return draft

    def _leave(self, item: Item, why: UnreadWhy | None = None) -> None:
        reasons: dict[str, UnreadWhy] = {
            "quoted": "quoted",
            "control": "control_character",
            "neg": "negation",
            "perfective": "statement",
            "unclear": "ambiguous",
        }
        self._state.unread.append(Unread(span=span_of(item), why=why or reasons.get(item.kind, "unknown_words")))


def _folds(before: ClauseDraft, draft: ClauseDraft, *, together: bool) -> bool:
    """Whether a clause without an object adds nothing to the one before; `together`: both stand in one part."""
    if draft.object is not None or draft.negated or before.negated:
        return False
    shown = draft.act == "report" and (draft.finding or before.act == "describe")
    observation = before.act in SHOWN and (shown or (draft.act == "inspect" and not together))
    return observation or (together and before.act == draft.act)


def _repeats(before: ClauseDraft, draft: ClauseDraft) -> bool:
    """Whether a verb without an object stands before the same verb with one: "去看，看看储物区"."""
    alike = (before.act, before.negated) == (draft.act, draft.negated)
    return alike and before.object is None and not before.counted and draft.object is not None


def is_participle(item: Item) -> bool:
    """Whether a verb is a participle: "checking"."""
    first = item.text.split(" ")[0]
    return item.kind in ("verb", "asks", "passes") and first.endswith("ing") and first not in FINITE


def _same_subject(one: ClauseObject, other: ClauseObject) -> bool:
    """Whether a second name may only tell more about the first: the passage *in the storage area*. The site decides."""
    return one == other or {one.kind, other.kind} == {"place", "passage"}


def _grown(draft: ClauseDraft, *spans: TextSpan) -> ClauseDraft:
    return replace(draft, spans=(*draft.spans, *spans))


def span_of(item: Item) -> TextSpan:
    return TextSpan(start=item.start, end=item.end)
