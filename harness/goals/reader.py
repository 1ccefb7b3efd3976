"""Reads a goal text into a reading (D40), and checks any reader's answer before it may be used. Pure.

A reader, a model included, proposes; what it proposes has authority only if its spans lie in the text, its objects
exist at the site, and every character is accounted for.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

from msgspec.structs import replace

from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import sha256
from harness.contracts.models import ModelUse
from harness.contracts.places import Site
from harness.contracts.readings import Clause, ClauseObject, Reading, TextSpan, Unread
from harness.contracts.reasons import because
from harness.goals.clause_drafts import LOOKING, ClauseDraft, clause_of, described, misplaced
from harness.goals.grammar import items, parse
from harness.goals.lexicon import meanings
from harness.goals.names import known_object, object_of_route, site_names
from harness.goals.subjects import with_subjects
from harness.goals.tokens import tokens
from harness.goals.words import Phrases, phrases
from harness.planning.binding import place_of

MOST_CLAUSES = 12


@dataclass(frozen=True)
class GoalReader:
    """Reads a goal, under a name and version that are stored with the reading. `read` may answer anything or raise.

    One that `proposes`, such as a model, is asked only about a text that the grammar leaves partly unread, and a person
    confirms what it read. `use`: the exchange with a model behind the reading of a text with this digest.
    """

    name: str
    version: str
    read: Callable[[str, Site], Reading]
    proposes: bool = False
    use: Callable[[str], ModelUse | None] = lambda text: None


def read_goal(text: str, *, site: Site) -> Reading:
    """The grammar's reading of a text with this site's names.

    Raises ContractInvalid for a site whose names are ambiguous.
    """
    parted, subjects = with_subjects(text, tokens(text))
    found = parse(items(parted, _phrases(site), subjects))
    drafts = described(found.clauses)
    wrong = misplaced(drafts)
    drafts = [draft for draft in drafts if all(draft is not one for one in wrong)]
    tied = [draft for draft in drafts if _tied(draft, site)]
    torn = [span for draft in drafts if draft not in tied for span in draft.spans]
    read = [_bound(clause_of(draft), site) for draft in tied]
    several = _of_several(read)
    clauses = [one for one in read if all(one is not other for other in several)]
    torn += [span for clause in several for span in clause.spans]
    unread = [*found.unread, *_unbound(clauses), *(Unread(span=span, why="ambiguous") for span in torn)]
    unread += [Unread(span=span, why="condition") for draft in wrong for span in draft.spans]
    result = [_tidy(clause, text) for clause in _joined(_looking([one for one in clauses if _is_bound(one)]))]
    reading = Reading(
        text=sha256(text.encode()),
        site=site_version(site),
        reader=GRAMMAR_NAME,
        version=GRAMMAR_VERSION,
        clauses=tuple(result[:MOST_CLAUSES]),
        fillers=_merged(found.fillers, text),
        unread=tuple(unread),
    )
    rest = [span for clause in result[MOST_CLAUSES:] for span in clause.spans]
    missed = [Unread(span=span, why="unknown_words") for span in (*rest, *uncovered(reading, text))]
    return replace(reading, unread=_merged_unread([*unread, *missed], text))


GRAMMAR_NAME, GRAMMAR_VERSION = "grammar", "6"
GRAMMAR = GoalReader(name=GRAMMAR_NAME, version=GRAMMAR_VERSION, read=lambda text, site: read_goal(text, site=site))
"""The deterministic reader: no model."""


def proposed_reading(reader: GoalReader, text: str, *, site: Site) -> Reading | None:
    """What a reader that proposes makes of the text, where it holds; None for any other reader."""
    found = admitted(reader, text, site=site) if reader.proposes else None
    return found if found is not None and found.reader == reader.name else None


def admitted(reader: GoalReader, text: str, *, site: Site) -> Reading:
    """The reader's answer if it holds, else the grammar's: a reader that breaks or invents has read nothing."""
    if reader is GRAMMAR:
        return read_goal(text, site=site)
    try:
        reading = replace(reader.read(text, site), reader=reader.name, version=reader.version)
        check_reading(reading, text=text, site=site)
    except Exception:  # noqa: BLE001 - whatever broke a reader, the grammar still reads the goal
        return read_goal(text, site=site)
    return reading


def check_reading(reading: Reading, *, text: str, site: Site) -> None:
    """Raise ContractInvalid for a reading of another text or site, with spans beside it, unknown objects or gaps."""
    if (reading.text, reading.site) != (sha256(text.encode()), site_version(site)):
        raise ContractInvalid(because("reading_of_other_text"), where="reading")
    outside = [span for span in _spans(reading) if not 0 <= span.start < span.end <= len(text)]
    if outside:
        raise ContractInvalid(because("span_outside_text", start=outside[0].start, end=outside[0].end), where="reading")
    strange = [one.object.id for one in reading.clauses if one.object and not known_object(one.object, site)]
    if strange:
        raise ContractInvalid(because("object_not_of_site", name=strange[0][:80]), where="reading")
    if any(not clause.spans for clause in reading.clauses):
        raise ContractInvalid(because("clause_without_words"), where="reading")
    if gaps := uncovered(reading, text):
        raise ContractInvalid(because("text_in_no_clause", count=len(gaps)), where="reading")


def uncovered(reading: Reading, text: str) -> tuple[TextSpan, ...]:
    """The parts of the text, spaces and joining hyphens aside, that the reading does not account for."""
    covered = set[int]()
    for span in _spans(reading):
        covered.update(range(span.start, span.end))
    missed = [token for token in tokens(text) if not covered.issuperset(range(token.start, token.end))]
    return tuple(TextSpan(start=token.start, end=token.end) for token in missed)


def site_version(site: Site) -> str:
    """What a reading says it was read against: a change of the map makes it stale."""
    return f"{site.name}@{site.map_version}"


@lru_cache(maxsize=8)
def _by_names(names: tuple[tuple[str, object], ...]) -> Phrases:
    return phrases(names, meanings())  # type: ignore[arg-type]


def _phrases(site: Site) -> Phrases:
    return _by_names(tuple(site_names(site)))


def _bound(clause: Clause, site: Site) -> Clause:
    """Laps without a route mean the only route of the site that ends where it begins."""
    if clause.object is None or clause.object != ClauseObject(kind="route"):
        return clause
    loops = [route for route in site.routes if route.start == route.end]
    return replace(clause, object=object_of_route(loops[0])) if len(loops) == 1 else clause


def _tied(draft: ClauseDraft, site: Site) -> bool:
    """Whether a second name of a clause is where the first one is, by the site's own geometry (D43)."""
    if draft.beside is None or draft.object is None:
        return True
    passage = next((one for one in site.passages if one.passage_id == draft.object.id), None)
    place = place_of(passage, site=site) if passage else None
    return place is not None and place.place_id == draft.beside.id


def _looking(clauses: Sequence[Clause]) -> list[Clause]:
    """A picture or description without a place is of the place that the clause before it is about, else from here."""
    made: list[Clause] = []
    for clause in clauses:
        if _placeless(clause):
            before = made[-1] if made else None
            there = before is not None and not before.negated and before.object is not None
            same = there and before is not None and before.act in ("go", "inspect", "photograph", "describe", "wait")
            clause = replace(clause, object=before.object if before and same else ClauseObject(kind="here"))
        made.append(clause)
    return made


def _placeless(clause: Clause) -> bool:
    return clause.act in LOOKING and clause.object is None and not clause.negated


def _of_several(clauses: Sequence[Clause]) -> list[Clause]:
    """Pictures and descriptions without a place that follow those of two places: of which, nobody said."""
    found = []
    for index, clause in enumerate(clauses):
        one, two = clauses[index - 2 : index] if index > 1 else (None, None)
        listed = one is not None and two is not None and one.act == two.act and one.act in LOOKING
        apart = listed and one is not None and two is not None and None not in (one.object, two.object)
        if _placeless(clause) and apart and one is not None and two is not None and one.object != two.object:
            found.append(clause)
    return found


def _is_bound(clause: Clause) -> bool:
    return clause.object != ClauseObject(kind="route")


def _unbound(clauses: Sequence[Clause]) -> list[Unread]:
    return [Unread(span=span, why="no_object") for one in clauses if not _is_bound(one) for span in one.spans]


def _joined(clauses: Sequence[Clause]) -> list[Clause]:
    """ "Go to the storage area and check it" is one thing: the way there is part of the next clause."""
    joined: list[Clause] = []
    for clause in clauses:
        before = joined[-1] if joined else None
        if before is not None and _leads_to(before, clause):
            joined[-1] = replace(clause, spans=(*before.spans, *clause.spans))
        elif before is not None and _says_again(before, clause):
            about = before.object or clause.object
            joined[-1] = replace(before, object=about, spans=(*before.spans, *clause.spans))
        else:
            joined.append(clause)
    return joined


def _leads_to(before: Clause, clause: Clause) -> bool:
    there = before.act == "go" and not before.negated and before.count == 1 and not clause.negated
    return there and clause.act in ("inspect", "photograph", "describe", "wait") and clause.object == before.object


def _says_again(before: Clause, clause: Clause) -> bool:
    """ "Inspect the storage area, see whether it is blocked": the same act on the same object, asked in two ways."""
    same = (before.act, before.negated, before.count) == (clause.act, clause.negated, clause.count)
    alike = before.object == clause.object or before.act == "report"
    return same and before.act in ("inspect", "report", "deliver", "return") and alike


def _tidy(clause: Clause, text: str) -> Clause:
    return replace(clause, spans=_merged(clause.spans, text))


def _merged(spans: Sequence[TextSpan], text: str) -> tuple[TextSpan, ...]:
    """Spans in the order of the text; neighbours with only spaces or hyphens between them are one."""
    merged: list[TextSpan] = []
    for span in sorted(spans, key=lambda one: (one.start, one.end)):
        before = merged[-1] if merged else None
        if before is not None and not text[before.end : span.start].strip(" \t\r-_\u3000\u00a0"):
            merged[-1] = TextSpan(start=before.start, end=max(before.end, span.end))
        else:
            merged.append(span)
    return tuple(merged)


def _merged_unread(found: Sequence[Unread], text: str) -> tuple[Unread, ...]:
    """Unread parts in the order of the text; neighbours with the same reason are one."""
    merged: list[Unread] = []
    for one in sorted(set(found), key=lambda unread: (unread.span.start, unread.span.end, unread.why)):
        before = merged[-1] if merged else None
        if before is not None and before.why == one.why and len(_merged((before.span, one.span), text)) == 1:
            merged[-1] = replace(before, span=_merged((before.span, one.span), text)[0])
        elif before is None or one.span.end > before.span.end:
            merged.append(one)
    return tuple(merged)


def _spans(reading: Reading) -> list[TextSpan]:
    of_clauses = [span for clause in reading.clauses for span in clause.spans]
    return [*of_clauses, *reading.fillers, *(one.span for one in reading.unread)]
