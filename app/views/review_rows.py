"""Pure: the parts of a review page: what changes, what was declared, how the clauses answered, who said what."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, word
from harness.contracts.ids import Digest
from rsi_reviews.contracts import ClauseAnswer
from rsi_reviews.pointers import Pointer, Uptake
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
class HeldOutView:
    """All that comes back of the held-out suite: pass or fail, which look it was, and how many looks there were."""

    answer: str
    verdict: str
    look: int
    looks: int
    alpha: float
    cases: int


@dataclass(frozen=True)
class PinRow:
    """One version and the unfinished missions pinned to it."""

    configuration: str
    role: str
    state: str
    missions: tuple[str, ...]


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
    """The newest word of each worker."""
    return tuple({one.worker: one for one in pointer.uptakes}.values())


def said_at(review: Review, what: str) -> float:
    """When this was first said of a candidate, wall seconds; 0 if it never was."""
    return next((one.by.at_s for one in review.said if one.what == what), 0.0)


def line_kind(line: str) -> str:
    """Of a line of a raw difference: del, ins or same."""
    return "ins" if line.startswith("+") else "del" if line.startswith("-") else "same"


def numbers(answer: ClauseAnswer) -> tuple[tuple[str, float], ...]:
    """The numbers that a clause rests on, by name."""
    return tuple((_quantity(name), value) for name, value in answer.numbers.items())
