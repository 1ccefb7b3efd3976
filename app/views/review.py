"""Pure: everything a reviewer sees of one candidate, in the order in which it matters (gate 2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.messages import N_, lazy_gettext, word
from app.views.canary import CanaryPanel, canary_panel
from app.views.candidates import TONES, stale, title_of
from app.views.review_results import Measured
from app.views.review_rows import (
    ClauseRow,
    Component,
    Declared,
    HandRow,
    HeldOutView,
    MotiveRow,
    PinRow,
    RawLine,
    SaidRow,
    UptakeRow,
    clause_row,
    component_rows,
    declared,
    hand_rows,
    held_out_view,
    motive_rows,
    pin_rows,
    policy_sentence,
    raw_lines,
    said_rows,
    uptake_rows,
)
from app.views.review_words import Offer, offers
from app.views.shell import Shell
from harness.contracts.actors import Actor
from harness.contracts.ids import Digest
from harness.contracts.values import encode
from rsi_reviews.contracts import ClauseAnswer, Subject
from rsi_reviews.difference import Difference
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import ENDED, Review


@dataclass(frozen=True)
class Changed:
    """What is not as it was shown when somebody decided."""

    name: str
    was: str
    now: str


@dataclass(frozen=True)
class Left:
    """A form as it was left: what was typed, why it did not count, the subject that was seen."""

    reason: str = ""
    refused: str = ""
    subject: Subject | None = None


@dataclass(frozen=True)
class Seen:
    """What the console found around the review: differences, results, pointer, and what runs under what.

    `pins` are unfinished missions by version, `versions` their states, `known` the missions that this log holds.
    `loads` is empty when the rollback target was loaded just now, else why it was not.
    """

    difference: Difference
    measured: Measured | None
    clauses: Sequence[ClauseAnswer]
    pointer: Pointer
    pins: Mapping[Digest, Sequence[str]]
    versions: Mapping[Digest, str]
    known: frozenset[str]
    loads: str
    progress: str


@dataclass(frozen=True)
class ReviewPage:
    """One candidate under review. `key` is one-use; `cycle` and `subject` are what a decision must name."""

    shell: Shell
    candidate: str
    title: str
    status: str
    tone: str
    cycle: int
    subject: str
    subject_rows: tuple[tuple[str, str], ...]
    subject_body: str
    configuration: str
    baseline: str
    stale: str
    progress: str
    hands: tuple[HandRow, ...]
    declared: Declared | None
    components: tuple[Component, ...]
    raw: tuple[RawLine, ...]
    measured: Measured | None
    held_out: HeldOutView | None
    clauses: tuple[ClauseRow, ...]
    motives: tuple[MotiveRow, ...]
    pins: tuple[PinRow, ...]
    rollback: str
    proven_s: float
    loads: str
    effects: tuple[str, ...]
    uptakes: tuple[UptakeRow, ...]
    canary: CanaryPanel | None
    said: tuple[SaidRow, ...]
    approvals: tuple[str, ...]
    quorum: int
    policy: str
    offers: tuple[Offer, ...]
    robots: tuple[str, ...]
    key: str
    typed: str
    refused: str
    changes: tuple[Changed, ...]


def review_page(
    shell: Shell, review: Review, seen: Seen, actor: Actor, *, robots: Sequence[str], key: str, left: Left = Left()
) -> ReviewPage:
    """The page of one candidate for this visitor, at the shell's time."""
    pointer, manifest = seen.pointer, review.manifest
    old = stale(review, pointer)
    robot = robots[0] if robots else ""
    rollback = review.authorised.rollback if review.authorised else manifest.rollback if manifest else ""
    subject = review.subject
    return ReviewPage(
        shell=shell,
        candidate=review.candidate,
        title=title_of(review),
        status=review.status,
        tone=TONES.get(review.status, "plain"),
        cycle=review.cycle,
        subject=review.subject_digest,
        subject_rows=tuple((word(name), getattr(subject, name)) for name in subject.__struct_fields__)
        if subject
        else (),
        subject_body=encode(subject).decode() if subject else "",
        configuration=review.configuration,
        baseline=review.baseline,
        stale=_stale(review, pointer) if old else "",
        progress=seen.progress,
        hands=hand_rows(review),
        declared=declared(review),
        components=component_rows(seen.difference),
        raw=raw_lines(seen.difference),
        measured=seen.measured,
        held_out=held_out_view(review, seen.pointer, seen.clauses),
        clauses=tuple(clause_row(one) for one in seen.clauses),
        motives=motive_rows(review, seen.known),
        pins=pin_rows(review, seen.pointer, seen.pins, seen.versions),
        rollback=rollback,
        proven_s=review.authorised.proven_at_s if review.authorised else 0.0,
        loads=seen.loads,
        effects=_effects(review, seen, robot=str(review.robot_id or robot)),
        uptakes=uptake_rows(pointer),
        canary=canary_panel(review, pointer, actor) if review.released_by else None,
        said=said_rows(review),
        approvals=tuple(one.actor.name for one in review.approvals),
        quorum=pointer.policy.quorum,
        policy=policy_sentence(pointer),
        offers=offers(review, pointer, actor, now_s=shell.now_s, robot=robot),
        robots=tuple(robots),
        key=key,
        typed=left.reason,
        refused=left.refused,
        changes=_changed(left.subject, subject),
    )


def _stale(review: Review, pointer: Pointer) -> str:
    return lazy_gettext(
        "Its baseline {baseline} is no longer current: that is {current} since revision {revision}. Nobody can approve "
        "it; propose the change anew on what is current.",
        baseline=review.baseline[:12],
        current=pointer.configuration[:12],
        revision=pointer.revision,
    )


def _effects(review: Review, seen: Seen, *, robot: str) -> tuple[str, ...]:
    """What a release will change, said before it happens; nothing once it has."""
    if review.released_by is not None or review.status in ENDED:
        return ()
    manifest = review.manifest
    needed = manifest.canary.missions if manifest else 5
    running = sum(len(missions) for missions in seen.pins.values())
    return (
        lazy_gettext(
            "The pointer moves from revision {revision} to {following}.",
            revision=seen.pointer.revision,
            following=seen.pointer.revision + 1,
        ),
        lazy_gettext(
            "New missions of {robot} are pinned to {configuration}, one at a time, until {needed} of them exercised "
            "the change; every other robot stays on {current}.",
            robot=robot or N_("one robot"),
            configuration=review.configuration[:12],
            needed=needed,
            current=seen.pointer.configuration[:12],
        ),
        lazy_gettext(
            "Unfinished missions keep the version pinned now, through pause, handoff and replanning: {count} of them.",
            count=running,
        ),
        N_(
            "Every canary mission waits for a person's approval before motion, and is adjudicated by somebody "
            "who did not release it."
        ),
        N_(
            "A false completion, a duplicate start or a safety violation rolls back at once; the metric only by the "
            "sequential test that the manifest declares."
        ),
    )


def _changed(seen: Subject | None, now: Subject | None) -> tuple[Changed, ...]:
    if seen is None or now is None:
        return ()
    return tuple(
        Changed(word(name), getattr(seen, name), getattr(now, name))
        for name in now.__struct_fields__
        if getattr(seen, name) != getattr(now, name)
    )
