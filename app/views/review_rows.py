"""Pure: the parts of a review page: what changes, what was declared, how the clauses answered, who said what."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.messages import N_, lazy_gettext, listed, word
from harness.contracts.ids import Digest
from rsi_reviews.contracts import ClauseAnswer
from rsi_reviews.difference import NAMES, Difference
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import Review

CLAUSE_NAMES = {
    "contracts_preserved": N_("Safety and evidence contracts are preserved"),
    "checks_not_worse": N_("No designated check is worse"),
    "metric_better": N_("The declared metric is better"),
    "release_authorised": N_("A release is authorised"),
}
MOST = "_share_at_most"
VERDICTS = {"pass": "satisfied", "fail": "violated", "inconclusive": "ambiguous", "error": "violated"}
PARTS = {"proposed": N_("proposed it"), "wrote_earlier": N_("wrote an earlier one"),
         "launched": N_("launched its evaluation"), "edited_suite": N_("edited its suite")}  # fmt: skip


@dataclass(frozen=True)
class ChangeRow:
    """One changed field, with unit and meaning."""

    path: str
    before: str
    after: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Component:
    """One of the four sections; without changes it says so."""

    name: str
    changes: tuple[ChangeRow, ...]


@dataclass(frozen=True)
class RawLine:
    """One line of the raw difference; `kind` is del, ins or same."""

    kind: str
    text: str


@dataclass(frozen=True)
class ClauseRow:
    """One clause of the acceptance predicate: its answer as a verdict, its sentence, its numbers."""

    name: str
    answer: str
    verdict: str
    sentence: str
    numbers: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Declared:
    """What the manifest fixed before anything ran, and when that was recorded."""

    reason: str
    intended: str
    metric: str
    direction: str
    smallest_effect: float
    digest: str
    recorded_s: float
    begun_s: float
    evaluated_s: float
    suite: str
    evaluator: str
    predicate: str
    cases: int


@dataclass(frozen=True)
class HeldOutView:
    """All that comes back of the held-out suite: pass or fail, which look it was, and how many looks there were."""

    answer: str
    verdict: str
    look: int
    looks: int
    alpha: float
    cases: int


@dataclass(frozen=True)
class MotiveRow:
    """One stored mission that led to the change. `known` is false where this data folder does not hold it."""

    mission_id: str
    known: bool
    positions: str


@dataclass(frozen=True)
class PinRow:
    """One version and the unfinished missions pinned to it."""

    configuration: str
    role: str
    state: str
    missions: tuple[str, ...]


@dataclass(frozen=True)
class UptakeRow:
    """Since when a worker works under which revision of the pointer."""

    worker: str
    revision: int
    at_s: float
    newest: bool


@dataclass(frozen=True)
class SaidRow:
    """One word of the review: who, what, when, why; `override` counted only by the single-operator policy."""

    who: str
    role: str
    what: str
    cycle: int
    reason: str
    at_s: float
    override: bool


@dataclass(frozen=True)
class HandRow:
    """Somebody who had a part in it, and so may not decide on it."""

    name: str
    part: str
    person: bool


def uptake_rows(pointer: Pointer) -> tuple[UptakeRow, ...]:
    """The newest word of each worker."""
    latest = {one.worker: one for one in pointer.uptakes}
    return tuple(
        UptakeRow(one.worker, one.revision, one.at_s, newest=one.revision == pointer.revision)
        for one in latest.values()
    )


def said_rows(review: Review) -> tuple[SaidRow, ...]:
    """Newest first."""
    return tuple(
        SaidRow(
            who=one.by.actor.name,
            role=one.by.actor.role,
            what=word(one.what),
            cycle=one.cycle,
            reason=one.by.reason,
            at_s=one.by.at_s,
            override=one.by.override,
        )
        for one in reversed(review.said)
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


def declared(review: Review) -> Declared | None:
    manifest, terms = review.manifest, review.terms
    if manifest is None:
        return None
    at = {one.what: one.by.at_s for one in reversed(review.said)}
    return Declared(
        reason=manifest.reason,
        intended=manifest.intended_effect,
        metric=word(manifest.metric),
        direction=manifest.direction,
        smallest_effect=manifest.smallest_effect,
        digest=review.manifest_digest,
        recorded_s=at.get("proposed", 0.0),
        begun_s=at.get("evaluation_begun", 0.0),
        evaluated_s=at.get("evaluated", 0.0),
        suite=terms.suite_version if terms else "",
        evaluator=terms.evaluator if terms else "",
        predicate=terms.predicate if terms else "",
        cases=terms.cases if terms else 0,
    )


def component_rows(difference: Difference) -> tuple[Component, ...]:
    return tuple(
        Component(
            name=title,
            changes=tuple(
                ChangeRow(one.path, one.before, one.after, one.unit, one.meaning)
                for one in difference.changes
                if one.section == section
            ),
        )
        for section, title in NAMES.items()
    )


def _kind(line: str) -> str:
    return "ins" if line.startswith("+") else "del" if line.startswith("-") else "same"


def clause_row(answer: ClauseAnswer) -> ClauseRow:
    return ClauseRow(
        name=CLAUSE_NAMES[answer.clause],
        answer=answer.answer,
        verdict=VERDICTS[answer.answer],
        sentence=answer.sentence,
        numbers=tuple((_quantity(name), value) for name, value in answer.numbers.items()),
    )


def _quantity(name: str) -> str:
    """A clause's number by its name: of which family, or the most that its share can be."""
    if name.endswith(MOST):
        return lazy_gettext("{quantity}, share at most", quantity=word(name.removesuffix(MOST)))
    return listed(map(word, name.split(".")))


def held_out_view(review: Review, pointer: Pointer, clauses: Sequence[ClauseAnswer]) -> HeldOutView | None:
    """From the clause's own numbers and the pointer's book of looks: the answer itself stays in the results."""
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


def motive_rows(review: Review, known: frozenset[str]) -> tuple[MotiveRow, ...]:
    return tuple(
        MotiveRow(one.mission_id, one.mission_id in known, ", ".join(f"e-{at}" for at in one.positions[:8]))
        for one in (review.manifest.motives if review.manifest else ())
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


def hand_rows(review: Review) -> tuple[HandRow, ...]:
    return tuple(HandRow(one.name, PARTS[one.part], one.person) for one in review.hands)


def raw_lines(difference: Difference) -> tuple[RawLine, ...]:
    return tuple(RawLine(_kind(line), line) for line in difference.raw.splitlines())
