"""Shapes the review page of one candidate: what changes, what was measured, and what this person may do about it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, word
from app.views.canary import CanaryPanel, canary_panel
from app.views.candidate_evaluation import EvaluationPanel
from app.views.candidates import stale
from app.views.history import ShownDifference
from app.views.review_actions import OfferedAction, offers
from app.views.review_results import MeasuredResults
from app.views.shell import Shell
from harness.contracts.actors import Actor
from harness.contracts.ids import Digest
from rsi_reviews.contracts import ClauseAnswer, Subject
from rsi_reviews.difference import CandidateDifference, FieldChange
from rsi_reviews.pointers import Pointer, Uptake
from rsi_reviews.projections import ENDED, Review

CLAUSE_NAMES = {
    "contracts_preserved": N_("Safety and evidence contracts are preserved"),
    "checks_not_worse": N_("No designated check is worse"),
    "metric_better": N_("The declared metric is better"),
    "release_authorised": N_("A release is authorised"),
}
LADDER, STEP = "recovery.ladders.", " > "
SHOWN_UNITS = ("s", "m", "m/s")
"""Units that are said with a value; a weight or a number of records says in its meaning what it is."""
MOST = "_share_at_most"
VERDICTS = {"pass": "satisfied", "fail": "violated", "inconclusive": "ambiguous", "error": "violated"}
PARTS = {"proposed": N_("proposed it"), "wrote_earlier": N_("wrote an earlier one"),
         "launched": N_("launched its evaluation"), "edited_suite": N_("edited its suite")}  # fmt: skip


@dataclass(frozen=True)
class HeldOutView:
    """What is shown of the held-out suite: pass or fail, the number of this look, and the number of all looks."""

    answer: str
    verdict: str
    look: int
    looks: int
    alpha: float
    cases: int


@dataclass(frozen=True)
class ChangeLine:
    """One changed field in words: what it says, and both values with their unit."""

    what: str
    before: str
    after: str


@dataclass(frozen=True)
class PinRow:
    """One version and the unfinished missions pinned to it."""

    configuration: str
    role: str
    state: str
    missions: tuple[str, ...]


@dataclass(frozen=True)
class SubmittedReviewForm:
    """A form as it was left: what was typed, why it was refused, and the subject that the person saw."""

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
    change: tuple[ChangeLine, ...]
    stale: str
    held_out: HeldOutView | None
    pins: tuple[PinRow, ...]
    rollback: str
    effects: tuple[str, ...]
    canary: CanaryPanel | None
    offers: tuple[OfferedAction, ...]
    evaluation: EvaluationPanel
    robots: tuple[str, ...]
    key: str
    invited: bool
    left: SubmittedReviewForm
    changes: tuple[ShownDifference, ...]


def review_page(
    shell: Shell,
    review: Review,
    seen: ReviewSources,
    actor: Actor,
    *,
    evaluation: EvaluationPanel,
    robots: Sequence[str],
    key: str,
    left: SubmittedReviewForm = SubmittedReviewForm(),
    invited: bool = False,
) -> ReviewPage:
    """The page of one candidate for this person, at the time of the shell. `invited`: they have no account yet."""
    pointer, manifest = seen.pointer, review.manifest
    robot = robots[0] if robots else ""
    return ReviewPage(
        shell=shell,
        review=review,
        seen=seen,
        change=tuple(change_line(one) for one in seen.difference.changes),
        stale=_stale(review, pointer) if stale(review, pointer) else "",
        held_out=held_out_view(review, pointer, seen.clauses),
        pins=pin_rows(review, pointer, seen.pins, seen.versions),
        rollback=review.authorised.rollback if review.authorised else manifest.rollback if manifest else "",
        effects=_effects(review, seen, robot=str(review.robot_id or robot)),
        canary=canary_panel(review, pointer, actor) if review.released_by else None,
        offers=offers(review, pointer, actor, now_s=shell.now_s, robot=robot, invited=invited),
        invited=invited,
        evaluation=evaluation,
        robots=tuple(robots),
        key=key,
        left=left,
        changes=_changed(left.subject, review.subject),
    )


def change_line(change: FieldChange) -> ChangeLine:
    """A ladder says which failure it answers; any other field what it means."""
    if change.path.startswith(LADDER):
        failure = word(change.path.removeprefix(LADDER))
        what = lazy_gettext("After {failure}, in this order", failure=failure)
        return ChangeLine(what=what, before=_steps(change.before), after=_steps(change.after))
    return ChangeLine(what=change.meaning, before=_value(change.before, change), after=_value(change.after, change))


def _steps(text: str) -> str:
    return listed(word(one) for one in text.split(STEP)) if text else N_("nothing")


def _value(text: str, change: FieldChange) -> str:
    if not text:
        return N_("nothing")
    return f"{text} {change.unit}" if change.unit in SHOWN_UNITS else text


def _stale(review: Review, pointer: Pointer) -> str:
    return lazy_gettext(
        "Its baseline {baseline} is no longer current: {current} is, since revision {revision}. It cannot be "
        "approved; propose the change again on the current version.",
        baseline=review.baseline[:12],
        current=pointer.configuration[:12],
        revision=pointer.revision,
    )


def _effects(review: Review, seen: ReviewSources, *, robot: str) -> tuple[str, ...]:
    """What a release will change; empty once it has happened."""
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


def _changed(seen: Subject | None, now: Subject | None) -> tuple[ShownDifference, ...]:
    if seen is None or now is None:
        return ()
    return tuple(
        ShownDifference(word(name), getattr(seen, name), getattr(now, name))
        for name in now.__struct_fields__
        if getattr(seen, name) != getattr(now, name)
    )


def policy_sentence(pointer: Pointer) -> str:
    """Who must agree before a release, in one sentence."""
    policy = pointer.policy
    if policy.kind == "single_operator":
        return lazy_gettext(
            "Single operator: an author may decide alone, {hours} h after the evaluation. Approvals needed: {quorum}.",
            hours=f"{policy.cooling_off_s / 3600.0:g}",
            quorum=policy.quorum,
        )
    return lazy_gettext(
        "Two people: a reviewer who is no author of it, then a releaser. Approvals needed: {quorum}.",
        quorum=policy.quorum,
    )


def _quantity(name: str) -> str:
    """A clause's number by its name: of which family, or the most that its share can be."""
    if name.endswith(MOST):
        return lazy_gettext("{quantity}, share at most", quantity=word(name.removesuffix(MOST)))
    return listed(map(word, name.split(".")))


def held_out_view(review: Review, pointer: Pointer, clauses: Sequence[ClauseAnswer]) -> HeldOutView | None:
    """Made from the clause's numbers and the pointer's record of looks; single answers are never shown."""
    taken = pointer.look_of(review.candidate)
    better = next((one for one in clauses if one.clause == "metric_better"), None)
    if taken is None or better is None:
        return None
    answer = "pass" if better.answer == "pass" else "fail"
    return HeldOutView(
        answer=answer,
        verdict=VERDICTS[answer],
        look=taken.look,
        looks=len(pointer.looks),
        alpha=taken.alpha,
        cases=int(better.numbers.get("held_out_cases", 0)),
    )


def pin_rows(
    review: Review, pointer: Pointer, pins: Mapping[Digest, Sequence[str]], versions: Mapping[Digest, str]
) -> tuple[PinRow, ...]:
    roles: dict[Digest, str] = {
        pointer.configuration: "current",
        review.baseline: N_("its baseline"),
        review.configuration: N_("this candidate"),
    }
    names = dict.fromkeys((*roles, *pins))
    return tuple(
        PinRow(name, roles.get(name, ""), versions.get(name, "inactive"), tuple(pins.get(name, ())))
        for name in names
        if name
    )


def newest_uptakes(pointer: Pointer) -> tuple[Uptake, ...]:
    """The newest uptake of each worker."""
    return tuple({one.worker: one for one in pointer.uptakes}.values())


def entry_at_s(review: Review, what: str) -> float:
    """When this was first said of a candidate, in wall seconds; 0 if never."""
    return next((one.by.at_s for one in review.said if one.what == what), 0.0)


def line_kind(line: str) -> str:
    """The kind of a line of a raw difference: del, ins or same."""
    return "ins" if line.startswith("+") else "del" if line.startswith("-") else "same"


def numbers(answer: ClauseAnswer) -> tuple[tuple[str, float], ...]:
    """The numbers that a clause rests on, by name."""
    return tuple((_quantity(name), value) for name, value in answer.numbers.items())
