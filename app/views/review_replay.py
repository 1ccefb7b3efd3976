"""Shapes which stored decisions would have come out differently under a candidate. No robot is involved."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from app.views.candidates import title_of
from app.views.shell import Shell
from rsi_reviews.projections import Review


class Decided(Protocol):
    """One decision that would differ, as rsi_reviews.counterfactual derives it."""

    @property
    def position(self) -> int: ...

    @property
    def kind(self) -> str: ...

    @property
    def node_id(self) -> str: ...

    @property
    def before(self) -> str: ...

    @property
    def after(self) -> str: ...


Replayed = tuple[str, str, str, int, Sequence[Decided], int]
"""Mission, template, status, decisions derived, those that differ, and how many records could not be read."""


@dataclass(frozen=True)
class ReplayMission:
    """One mission with the decisions that would differ."""

    mission_id: str
    template: str
    status: str
    derived: int
    unreadable: int
    rows: tuple[Decided, ...]


@dataclass(frozen=True)
class ReplayPage:
    """`looked` of the `held` missions of this log were derived again, newest first; `decisions` in all."""

    shell: Shell
    candidate: str
    name: str
    looked: int
    held: int
    decisions: int
    differing: tuple[ReplayMission, ...]
    unreadable: int


def replay_page(shell: Shell, review: Review, found: Iterable[Replayed], *, held: int) -> ReplayPage:
    missions = [
        ReplayMission(
            mission_id=mission_id,
            template=template,
            status=status,
            derived=derived,
            unreadable=unreadable,
            rows=tuple(differences),
        )
        for mission_id, template, status, derived, differences, unreadable in found
    ]
    return ReplayPage(
        shell=shell,
        candidate=review.candidate,
        name=title_of(review),
        looked=len(missions),
        held=held,
        decisions=sum(one.derived for one in missions),
        differing=tuple(one for one in missions if one.rows),
        unreadable=sum(one.unreadable for one in missions),
    )
