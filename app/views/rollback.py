"""Shapes the confirmation of a rollback: what goes back to what, what is paused, and why."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.views.candidates import title_of
from app.views.shell import Shell
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import Review

REASONS = (
    N_("unexpected handoffs"),
    N_("a completion was wrong"),
    N_("slower than before"),
    N_("behaves otherwise than reviewed"),
)


@dataclass(frozen=True)
class RollbackPage:
    """The form. `pinned` missions are paused for a person's decision; `possible` is false once it is over."""

    shell: Shell
    candidate: str
    name: str
    status: str
    possible: bool
    configuration: str
    target: str
    revision: int
    pinned: tuple[str, ...]
    reasons: tuple[str, ...]
    key: str
    typed: str
    refused: str


def rollback_page(
    shell: Shell, review: Review, pointer: Pointer, pinned: Sequence[str], *, key: str, refused: str, typed: str
) -> RollbackPage:
    return RollbackPage(
        shell=shell,
        candidate=review.candidate,
        name=title_of(review),
        status=review.status,
        possible=review.status in ("canary", "current"),
        configuration=review.configuration,
        target=review.authorised.rollback if review.authorised else review.baseline,
        revision=pointer.revision + 1,
        pinned=tuple(pinned),
        reasons=REASONS,
        key=key,
        typed=typed,
        refused=refused,
    )
