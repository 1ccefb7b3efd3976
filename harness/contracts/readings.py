"""What a goal text was understood as (D40): typed clauses, each with the part of the text that it accounts for."""

from typing import Annotated, Literal

import msgspec

from harness.contracts.ids import Digest
from harness.contracts.spoken_goals import Transcription
from harness.contracts.values import Count, Name, Value, digest

Act = Literal[
    "go", "return", "inspect", "photograph", "describe", "walk_route", "explore", "report", "deliver", "wait",
]  # fmt: skip
ObjectKind = Literal["place", "route", "passage", "region", "site", "here", "finding", "channel"]
Default = Literal["return", "report"]
"""What the mission profile adds unless the goal says otherwise (R195)."""
UnreadWhy = Literal[
    "unknown_words", "condition", "time", "alternative", "ambiguous", "quoted", "control_character",
    "count", "negation", "no_object", "no_template", "order", "statement", "wait_too_long", "wait_unstated",
]  # fmt: skip
PROFILE = "profile"
"""How a completion condition cites a default of the mission profile: `profile.return`; a clause is cited by number."""


LONGEST_WAIT_S = 300
"""What is longer is no wait of a mission: its robot and its evidence would be held all the while."""


class TextSpan(Value):
    """A part of the goal text: characters from `start` up to, not including, `end`."""

    start: Count
    end: Count


class ClauseObject(Value):
    """What a clause is about: a place, route, passage, zone or channel of the site by its id, or the site as a whole.

    `name` is what the site called it when the goal was read.
    """

    kind: ObjectKind
    id: str = ""
    name: str = ""


class PictureSubject(Value):
    """What a picture is to show: a sign with the text `name`, or an object of that class."""

    kind: Literal["text", "object"]
    name: Name


class Clause(Value):
    """One thing that is asked, or forbidden (`negated`). Clauses are listed in the order in which they are done.

    `seconds`: how long is to be waited. `subject`: what a photograph is to show.
    """

    act: Act
    object: ClauseObject | None = None
    negated: bool = False
    count: Annotated[int, msgspec.Meta(ge=1)] = 1
    seconds: Annotated[int, msgspec.Meta(ge=1)] | msgspec.UnsetType = msgspec.UNSET
    subject: PictureSubject | msgspec.UnsetType = msgspec.UNSET
    spans: tuple[TextSpan, ...] = ()


class Unread(Value):
    """A part of the text that no clause accounts for, and why it could not be read or cannot be done."""

    span: TextSpan
    why: UnreadWhy


class Reading(Value):
    """One way to understand a goal text at one site; what runs is this and nothing else.

    `text` is the digest of the text, `site` its name and map version. Every character of the text that is no space is
    in a clause, in `fillers` or in `unread`. `defaults` are what the mission profile adds.
    """

    text: Digest
    site: Name
    reader: Name
    version: Name
    clauses: tuple[Clause, ...]
    defaults: tuple[Default, ...] = ()
    fillers: tuple[TextSpan, ...] = ()
    unread: tuple[Unread, ...] = ()

    @property
    def digest(self) -> Digest:
        """What a person confirms: of the text, its clauses and defaults, and what was left unread."""
        return digest(self)


class ReadingQuestion(Value):
    """What a person is asked where a goal was not fully understood (D41).

    `nearest` is the closest reading that could be done; None where nothing of the text could. `template` names what the
    person chose beside the text, where the text asks for something else. `heard`: what the text was written down from.
    """

    text: str
    nearest: Reading | None
    unread: tuple[Unread, ...]
    template: str = ""
    heard: Transcription | None = None


def clause_id(number: int) -> str:
    """How conditions and nodes name the clause at this position, counted from 1."""
    return str(number)
