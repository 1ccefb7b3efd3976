"""Pure: everything a reviewer sees of one candidate, in the order in which it matters (gate 2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, word
from app.views.canary import CanaryPanel, canary_panel
from app.views.candidates import stale
from app.views.review_actions import OfferedAction, offers
from app.views.review_results import MeasuredResults
from app.views.review_rows import HeldOutView, PinRow, held_out_view, pin_rows
from app.views.shell import Shell
from harness.contracts.actors import Actor
from harness.contracts.ids import Digest
from rsi_reviews.contracts import ClauseAnswer, Subject
from rsi_reviews.difference import CandidateDifference
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import ENDED, Review


@dataclass(frozen=True)
class Changed:
    """What is not as it was shown when somebody decided."""

    name: str
    was: str
    now: str


@dataclass(frozen=True)
class SubmittedReviewForm:
    """A form as it was left: what was typed, why it did not count, the subject that was seen."""

    reason: str = ""
    refused: str = ""
    subject: Subject | None = None


@dataclass(frozen=True)
class ReviewSources:
    """What the console found around the review: differences, results, pointer, and what runs under what.

    `pins` are unfinished missions by version, `versions` their states, `known` the missions that this log holds.
    `loads` is empty when the rollback target was loaded just now, else why it was not.
    """

    difference: CandidateDifference
    measured: MeasuredResults | None
    clauses: Sequence[ClauseAnswer]
    pointer: Pointer
    pins: Mapping[Digest, Sequence[str]]
    versions: Mapping[Digest, str]
    known: frozenset[str]
    loads: str
    progress: str


@dataclass(frozen=True)
class ReviewPage:
    """One candidate under review. `key` is one-use; `rollback` is where a release of it would go back to."""

    shell: Shell
    review: Review
    seen: ReviewSources
    stale: str
    held_out: HeldOutView | None
    pins: tuple[PinRow, ...]
    rollback: str
    effects: tuple[str, ...]
    canary: CanaryPanel | None
    offers: tuple[OfferedAction, ...]
    robots: tuple[str, ...]
    key: str
    left: SubmittedReviewForm
    changes: tuple[Changed, ...]


def review_page(
    shell: Shell,
    review: Review,
    seen: ReviewSources,
    actor: Actor,
    *,
    robots: Sequence[str],
    key: str,
    left: SubmittedReviewForm = SubmittedReviewForm(),
) -> ReviewPage:
    """The page of one candidate for this visitor, at the shell's time."""
    pointer, manifest = seen.pointer, review.manifest
    robot = robots[0] if robots else ""
    return ReviewPage(
        shell=shell,
        review=review,
        seen=seen,
        stale=_stale(review, pointer) if stale(review, pointer) else "",
        held_out=held_out_view(review, pointer, seen.clauses),
        pins=pin_rows(review, pointer, seen.pins, seen.versions),
        rollback=review.authorised.rollback if review.authorised else manifest.rollback if manifest else "",
        effects=_effects(review, seen, robot=str(review.robot_id or robot)),
        canary=canary_panel(review, pointer, actor) if review.released_by else None,
        offers=offers(review, pointer, actor, now_s=shell.now_s, robot=robot),
        robots=tuple(robots),
        key=key,
        left=left,
        changes=_changed(left.subject, review.subject),
    )


def _stale(review: Review, pointer: Pointer) -> str:
    return lazy_gettext(
        "Its baseline {baseline} is no longer current: {current} is, since revision {revision}. It cannot be "
        "approved; propose the change again on the current version.",
        baseline=review.baseline[:12],
        current=pointer.configuration[:12],
        revision=pointer.revision,
    )


def _effects(review: Review, seen: ReviewSources, *, robot: str) -> tuple[str, ...]:
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
