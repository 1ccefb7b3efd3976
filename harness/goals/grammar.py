"""Parses a goal text into clauses with the parts of the text they account for. Deterministic, pure; guesses nothing.

A sentence is cut at its connectors; each part is a verb with its object, or names another object for the verb before.
Whatever no rule takes stays unread, with the reason.
"""

from collections.abc import Mapping, Sequence
from itertools import takewhile
from types import MappingProxyType

from harness.contracts.readings import PictureSubject, TextSpan, Unread, UnreadWhy
from harness.goals.clause_drafts import ClauseDraft, Parse, is_participle, parse_part, span_of
from harness.goals.tokens import QUOTES, TextToken
from harness.goals.words import Item, Meaning, Phrases

CONNECTORS = frozenset({"and", "then", "but", "first", "last", "before", "after", "before_post", "or", "sep"})
GOING = "去"
VERBS = frozenset({"verb", "asks", "passes", "done", "tail", "attached", "avoid"})
SWALLOWED: dict[str, UnreadWhy] = {"condition": "condition", "time": "time", "or": "alternative"}
SINGLE = ("a", "for a")
"""What counts a time once: "a minute"."""
ENDED = ("done", "finished")
AND_THEN = frozenset({"and then", "and next", "and afterwards", "followed by"})


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
            state.fillers.append(span_of(item))
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
        elif (
            item.kind == "then"
            and item.text.endswith(ENDED)
            and index + 1 < len(found)
            and is_participle(found[index + 1])
        ):
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
            state.unread.append(Unread(span=span_of(item), why=why))
            if why == "time":
                why = None
        elif why is not None and item.kind not in ("sep", "then", "stop", "but"):
            state.unread.append(Unread(span=span_of(item), why=why))
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
        self._first = self._first or (span_of(relating[0]) if relating else None)
        self._state.fillers.extend(span_of(link) for link in links)
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
        self._state.unread.extend(Unread(span=span_of(link), why="order") for link in links if _goes_on(link))

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
        self._state.unread.extend(Unread(span=span_of(link), why="ambiguous") for link in links)

    def _complain(self, links: Sequence[Item]) -> None:
        """An order or an alternative that nothing follows was said about something that was not read."""
        ordering = [link for link in links if link.kind in ("before", "after", "before_post")]
        self._state.unread.extend(Unread(span=span_of(link), why="order") for link in ordering)


def _goes_on(link: Item) -> bool:
    """Whether a connector at the end of a sentence leaves open what was to follow: "check the storage area, and"."""
    after_all = link.kind == "then" and link.text.isascii() and link.text not in AND_THEN
    return link.kind in ("and", "but", "then") and not after_all
