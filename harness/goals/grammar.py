"""Parses a goal text into clauses with the parts of the text they account for. Deterministic, pure; guesses nothing.

A sentence is cut at its connectors; each part is a verb with its object, or names another object for the verb before.
Whatever no rule takes stays unread, with the reason.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from types import MappingProxyType

from msgspec import UNSET, UnsetType

from harness.contracts.readings import Act, Clause, ClauseObject, PictureSubject, TextSpan, Unread, UnreadWhy
from harness.goals.lexicon import ARRIVING, FINDING, HOMECOMING, LIMITING, LOOKING_AROUND, STATING, TELLING_SIGHT
from harness.goals.tokens import QUOTES, TextToken
from harness.goals.words import Item, Meaning, Phrases

CONNECTORS = frozenset({"and", "then", "but", "first", "last", "before", "after", "before_post", "or", "sep"})
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
GOING = "去"
VERBS = frozenset({"verb", "asks", "passes", "done", "tail", "attached", "avoid"})
SWALLOWED: dict[str, UnreadWhy] = {"condition": "condition", "time": "time", "or": "alternative"}
MOST_TIMES = 99
DIRECTLY, FOR = frozenset({"verb", "name", "here", "pronoun"}), "for"
"""What a time may follow: "wait at most two minutes" is no wait of two minutes."""
LOOKING: tuple[Act, ...] = ("photograph", "describe")
FINITE = frozenset({"swing"})
"""Verbs that end like a participle and are none."""
MIND = frozenset({"would you mind", "do you mind", "how about"})
"""What asks for something by a participle: "would you mind checking the storage area"."""
SINGLE = ("a", "for a")
"""What counts a time once: "a minute"."""
ENDED = ("done", "finished")
AND_THEN = frozenset({"and then", "and next", "and afterwards", "followed by"})
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


def items(
    found: Sequence[TextToken], phrases: Phrases, subjects: Mapping[int, PictureSubject] = MappingProxyType({})
) -> list[Item]:
    """The text as phrases with meanings, the longest first; quotations and what is no word are marked unread."""
    made: list[Item] = []
    index = 0
    while index < len(found):
        token = found[index]
        if token.kind == "quote":
            index = _quotation(found, index, phrases, made)
            continue
        if token.kind == "subject":
            subject = Meaning("subject", subject=subjects[token.start])
            made.append(Item(subject, token.start, token.end, token.written))
            index += 1
            continue
        phrase = phrases.at(found, index) if token.kind == "word" else None
        length, word = phrase if phrase else (1, _unknown(token))
        last = found[index + length - 1]
        written = " ".join(one.text for one in found[index : index + length])
        made.append(Item(word, token.start, last.end, written))
        index += length
    return _numbered(made)


def parse(found: Sequence[Item]) -> Parse:
    """All sentences of the text, one after the other."""
    state = Parse()
    for sentence in _sentences(found):
        _sentence(sentence, state)
    return state


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


def _unknown(token: TextToken) -> Meaning:
    match token.kind:
        case "separator":
            return Meaning("sep" if token.text == "," else "stop")
        case "control":
            return Meaning("control")
        case _ if token.text.isdecimal() and len(token.text) < 4:
            return Meaning("number", number=int(token.text))
        case _:
            return Meaning("unknown")


def _quotation(found: Sequence[TextToken], index: int, phrases: Phrases, made: list[Item]) -> int:
    """A quoted name is that name; anything else that is quoted is somebody's words and not a request."""
    closing = QUOTES.get(found[index].text, found[index].text)
    end = next((at for at in range(index + 1, len(found)) if found[at].text in (closing, '"')), len(found) - 1)
    inner = found[index + 1 : end]
    phrase = phrases.at(inner, 0) if inner else None
    if phrase and phrase[0] == len(inner) and phrase[1].kind == "name":
        made.append(Item(phrase[1], found[index].start, found[end].end, "name"))
    else:
        made.append(Item(Meaning("quoted"), found[index].start, found[end].end, "quoted"))
    return end + 1


def _numbered(made: Sequence[Item]) -> list[Item]:
    """Numbers with their unit become counts, laps or times: "3 times", "two laps of", "ten minutes"."""
    joined: list[Item] = []
    for item in made:
        before = joined[-1] if joined else None
        if item.kind in ("times", "laps") and before is not None and before.kind == "number":
            kind = "count" if item.kind == "times" else "laps"
            joined[-1] = Item(Meaning(kind, number=before.word.number), before.start, item.end, kind)
        elif item.kind == "duration":
            single = before is not None and before.text in SINGLE
            if before is not None and (single or before.kind == "number"):
                seconds = item.word.number * (1 if single else before.word.number)
                joined[-1] = Item(Meaning("lasting", number=seconds), before.start, item.end, "lasting")
            else:
                joined.append(Item(Meaning("time"), item.start, item.end, item.text))
        elif item.kind == "time" and before is not None and before.kind == "number":
            joined[-1] = Item(item.word, before.start, item.end, "time")
        else:
            joined.append(item)
    return joined


def _sentences(found: Sequence[Item]) -> list[list[Item]]:
    sentences: list[list[Item]] = [[]]
    for item in found:
        sentences[-1].append(item)
        if item.kind == "stop":
            sentences.append([])
    return [sentence for sentence in sentences if sentence]


def _sentence(sentence: Sequence[Item], state: Parse) -> None:
    """Cut at the connectors and parse part by part; then put the clauses into the order that the words say."""
    links: list[Item] = []
    part: list[Item] = []
    began = len(state.clauses)
    ordering = _Ordering(state, began)
    result = _orders(_led_on(_swallowed(sentence, state)))
    for index, item in enumerate(result):
        following = result[index + 1].kind if index + 1 < len(result) else "stop"
        if item.kind == "and" and part and (_joins_nothing(part) or ordering.names_only(part)):
            state.fillers.append(_span(item))
        elif item.kind == "first" and part and following in ("sep", "stop", "then", "and"):
            links.append(item)
        elif item.kind in CONNECTORS:
            if part:
                ordering.part(links, part)
                links, part = [], []
            links.append(item)
        else:
            part.append(item)
    ordering.part(links, part)
    ordering.close(() if part else links)


def _orders(found: Sequence[Item]) -> list[Item]:
    """ "检查了储物区" says that it was done: 了 is left unread, but under a "do not", and before what comes after it.

    "When you are done walking the circuit" is after the circuit; with nothing behind, it is after what stands before.
    """
    made: list[Item] = []
    for index, item in enumerate(found):
        if item.kind == "perfective":
            begin = max((at for at in range(index) if found[at].kind in CONNECTORS), default=-1) + 1
            end = next((at for at in range(index, len(found)) if found[at].kind in CONNECTORS), len(found))
            kinds = {one.kind for one in found[begin:end]}
            follows = found[end].kind if end < len(found) - 1 else "stop"
            if not kinds & VERBS or "neg" in kinds or follows in ("then", "before_post"):
                item = Item(Meaning("filler"), item.start, item.end, item.text)
        elif item.kind == "then" and item.text.endswith(ENDED) and index + 1 < len(found) and _doing(found[index + 1]):
            item = Item(Meaning("after"), item.start, item.end, item.text)
        made.append(item)
    return made


def _led_on(found: Sequence[Item]) -> list[Item]:
    """ "再去储物区": where no other verb follows, the connector's own 去 is the verb of its part, its last word too."""
    made: list[Item] = []
    for index, item in enumerate(found):
        follows = list(takewhile(lambda one: one.kind not in CONNECTORS, found[index + 1 :]))
        kinds = {one.kind for one in follows}
        led = not follows or ("name" in kinds and not kinds & VERBS)
        if item.kind in ("then", "first") and item.text.endswith(GOING) and led:
            if not made or made[-1].kind != "neg":
                made.append(Item(item.word, item.start, item.end - 1, item.text[:-1]))
            made.append(Item(Meaning("verb", act="go"), _begin_of(made, item), item.end, GOING))
        else:
            made.append(item)
    return made


def _begin_of(made: Sequence[Item], item: Item) -> int:
    """Where the verb in a connector begins: behind the connector, or with it where a "do not" swallowed that."""
    return item.start if made and made[-1].kind == "neg" else item.end - 1


def _joins_nothing(part: Sequence[Item]) -> bool:
    """Whether an "and" stands before any verb or name of its part: "please and ..." """
    return bool(part) and all(item.kind in ("filler", "lead") for item in part)


def _swallowed(sentence: Sequence[Item], state: Parse) -> list[Item]:
    """Without conditions and alternatives, up to the next comma or "then": what depends on them is not done."""
    result: list[Item] = []
    why: UnreadWhy | None = None
    for item in sentence:
        if item.kind in SWALLOWED:
            why = SWALLOWED[item.kind]
            state.unread.append(Unread(span=_span(item), why=why))
            if why == "time":
                why = None
        elif why is not None and item.kind not in ("sep", "then", "stop", "but"):
            state.unread.append(Unread(span=_span(item), why=why))
        else:
            why = None
            result.append(item)
    return result


class _Ordering:
    """Parses the parts of one sentence and places each part's clauses among the earlier ones."""

    def __init__(self, state: Parse, began: int) -> None:
        self._state, self._began = state, began
        self._held: int | None = None
        """Where what comes next belongs: before the clauses of a leading "before ..."."""
        self._parts = 0
        self._first: TextSpan | None = None
        self._relations = 0
        """How often the sentence says what comes before what: twice may contradict itself."""

    def part(self, links: Sequence[Item], part: Sequence[Item]) -> None:
        """One part with the connectors before it."""
        kinds = [link.kind for link in links]
        relating = [link for link in links if link.kind in ("before", "after", "before_post")]
        self._relations += len(relating)
        self._first = self._first or (_span(relating[0]) if relating else None)
        self._state.fillers.extend(_span(link) for link in links)
        if not part:
            self._complain(links)
            return
        draft = parse_part(part, self._state, links=kinds)
        if not draft:
            self._complain(links)
            return
        self._place(draft, kinds, links)
        self._parts += 1

    def close(self, links: Sequence[Item]) -> None:
        """The sentence is over: an order that nothing else was said about is no order."""
        if self._parts == 1 and self._relations and self._first is not None:
            self._state.unread.append(Unread(span=self._first, why="order"))
        self._complain(links)
        self._state.unread.extend(Unread(span=_span(link), why="order") for link in links if _goes_on(link))

    def names_only(self, part: Sequence[Item]) -> bool:
        """Whether a part names things whose verb is still to come: "给基站和储物区各拍一张照片"."""
        has_clause = len(self._state.clauses) > self._began
        kinds = {item.kind for item in part}
        return not has_clause and "name" in kinds and kinds <= {"name", "preposition", "filler"}

    def _place(self, drafts: list[ClauseDraft], kinds: Sequence[str], links: Sequence[Item]) -> None:
        clauses, began = self._state.clauses, self._began
        if self._unclear(drafts, kinds):
            self._unordered(links)
        if "before" in kinds and self._parts == 0:
            self._held = len(clauses)
            clauses.extend(drafts)
        elif "before_post" in kinds:
            clauses[began:began] = drafts
        elif self._held is not None and not {"and"} >= set(kinds):
            clauses[self._held : self._held] = drafts
            self._held = None
        elif "after" in kinds and self._parts > 0:
            clauses[max(began, len(clauses) - 1) : max(began, len(clauses) - 1)] = drafts
        elif "first" in kinds and self._parts > 0:
            clauses[began:began] = drafts
        else:
            clauses.extend(drafts)

    def _unclear(self, drafts: Sequence[ClauseDraft], kinds: Sequence[str]) -> bool:
        """Whether the words leave open what comes first, or how far a "do not" reaches."""
        earlier = self._state.clauses[self._began :]
        if ("before" in kinds and len(drafts) > 1) or self._relations > 1:
            return True
        if "after" in kinds and self._parts > 0 and (len(drafts) > 1 or len(earlier) > 1):
            return True
        reaches = set(kinds) <= {"and"} and not drafts[0].negated
        return bool(earlier) and earlier[-1].negated and reaches

    def _unordered(self, links: Sequence[Item]) -> None:
        """The connectors do not say which of two readings is meant."""
        self._state.unread.extend(Unread(span=_span(link), why="ambiguous") for link in links)

    def _complain(self, links: Sequence[Item]) -> None:
        """An order or an alternative that nothing follows was said about something that was not read."""
        ordering = [link for link in links if link.kind in ("before", "after", "before_post")]
        self._state.unread.extend(Unread(span=_span(link), why="order") for link in ordering)


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
                self._glue.append(_span(item))
            case "filler" if item.word.number == LIMITING and self._forbids is not None:
                self._leave(item, "negation")
            case "filler" | "stop" | "sep" | "and" | "then" | "first" | "both":
                self._state.fillers.append(_span(item))
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
            spans=(*self._glue, _span(item)),
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
            draft = _grown(draft, _span(self._negation))
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
        if not _doing(item) or self._negation is not None or self._links:
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
            self._glue.append(_span(item))
        else:
            self._leave(item, "no_object")

    def _name(self, item: Item) -> None:
        if item.kind == "pronoun" and self._made and self._made[-1].act == "deliver" and not self._made[-1].negated:
            self._made[-1] = _grown(self._made[-1], *self._glue, _span(item))
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
            self._made[-1] = replace(_grown(draft, *self._glue, _span(item)), object=target)
            self._glue = []
        elif draft.object is not None and _same_subject(draft.object, target):
            first, second = (target, draft.object) if target.kind == "passage" else (draft.object, target)
            beside = draft.beside if second == first else second
            self._made[-1] = replace(_grown(draft, *self._glue, _span(item)), object=first, beside=beside)
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
            self._made.append(ClauseDraft(act="go", spans=(*self._glue, _span(item)), negated=True))
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
        self._made[-1] = replace(_grown(draft, _span(item)), count=number, counted=True)
        self._count = None

    def _last_for(self, item: Item) -> None:
        """ "wait for five minutes": a time counts where it follows the verb or the place at once, or after "for"."""
        draft, before = self._made[-1] if self._made else None, self._last
        follows = before is not None and (before.kind in DIRECTLY or before.text == FOR)
        waits = draft is not None and draft.act == "wait" and isinstance(draft.seconds, UnsetType)
        if draft is None or not (follows and waits and item.word.number):
            self._leave(item, "time")
            return
        self._made[-1] = replace(_grown(draft, *self._glue, _span(item)), seconds=item.word.number)
        self._glue = []

    def _show(self, item: Item) -> None:
        """ "photograph the sign that says B-12": what the picture is to show, one thing for one picture."""
        draft = self._made[-1] if self._made else None
        if draft is None or draft.act != "photograph" or draft.negated or not isinstance(draft.subject, UnsetType):
            self._leave(item)
            return
        self._made[-1] = replace(_grown(draft, *self._glue, _span(item)), subject=item.word.subject or UNSET)
        self._glue = []

    def _tail(self, item: Item) -> None:
        draft = self._made[-1] if self._made else None
        if item.kind == "tail" and draft is not None and draft.act == "inspect" and draft.object is not None:
            self._made[-1] = replace(_grown(draft, _span(item)), asking=False, act=item.word.act or draft.act)
        elif item.kind == "tail" and item.word.number == STATING and draft is None:
            self._leave(item, "statement")
        elif item.kind == "tail" and draft is None and self._named:
            self._verb(Item(Meaning("verb", act="inspect"), item.start, item.end, item.text))
        elif item.kind == "attached" and draft is not None and draft.act == item.word.act:
            self._made[-1] = replace(_grown(draft, _span(item)), finding=draft.finding or item.word.number == FINDING)
        elif item.kind == "attached" and draft is None and self._before(item.word.act):
            grown = _grown(self._state.clauses[-1], _span(item))
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
        self._state.unread.append(Unread(span=_span(item), why=why or reasons.get(item.kind, "unknown_words")))


def _folds(before: ClauseDraft, draft: ClauseDraft, *, together: bool) -> bool:
    """Whether a clause without an object adds nothing to the one before; `together`: both stand in one part."""
    if draft.object is not None or draft.negated or before.negated:
        return False
    tells = draft.act == "report" and (draft.finding or before.act == "describe")
    observation = before.act in SHOWN and (tells or (draft.act == "inspect" and not together))
    return observation or (together and before.act == draft.act)


def _repeats(before: ClauseDraft, draft: ClauseDraft) -> bool:
    """Whether a verb without an object stands before the same verb with one: "去看，看看储物区"."""
    alike = (before.act, before.negated) == (draft.act, draft.negated)
    return alike and before.object is None and not before.counted and draft.object is not None


def _doing(item: Item) -> bool:
    """Whether a verb is a participle: "checking"."""
    first = item.text.split(" ")[0]
    return item.kind in ("verb", "asks", "passes") and first.endswith("ing") and first not in FINITE


def _goes_on(link: Item) -> bool:
    """Whether a connector at the end of a sentence leaves open what was to follow: "check the storage area, and"."""
    after_all = link.kind == "then" and link.text.isascii() and link.text not in AND_THEN
    return link.kind in ("and", "but", "then") and not after_all


def _same_subject(one: ClauseObject, other: ClauseObject) -> bool:
    """Whether a second name may only tell more about the first: the passage *in the storage area*. The site decides."""
    return one == other or {one.kind, other.kind} == {"place", "passage"}


def _grown(draft: ClauseDraft, *spans: TextSpan) -> ClauseDraft:
    return replace(draft, spans=(*draft.spans, *spans))


def _span(item: Item) -> TextSpan:
    return TextSpan(start=item.start, end=item.end)
