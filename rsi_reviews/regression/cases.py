"""Defines regression cases and the cases that a suite expands to. Pure. A case's id is its digest."""

from collections.abc import Iterator
from typing import Annotated, Literal

import msgspec

from harness.contracts import values
from harness.contracts.ids import Digest
from harness.contracts.regularities import HiddenSite
from rsi_reviews.contracts import Family

MOST_SEEDS = 100_000


class Outside(values.Value, omit_defaults=True):
    """Something that happens to the mission from outside: from `at_s` after its begin, for `for_s` seconds.

    `lease`: somebody else holds the mobile base. `veto`: a safety layer vetoes motion.
    """

    kind: Literal["lease", "veto"]
    at_s: values.NonNegative
    for_s: values.Positive


class Situation(values.Value, omit_defaults=True):
    """Everything of a case but its seed. `site` is what recurs at the place; without it the site is the shipped one."""

    family: Family
    template: values.Name
    site: HiddenSite | None = None
    faults: tuple[values.Name, ...] = ()
    outside: tuple[Outside, ...] = ()


class Case(values.Value):
    """One mission of a suite: a situation under one seed. Both configurations run the same case (R157)."""

    situation: Situation
    seed: values.Count

    @property
    def case_id(self) -> Digest:
        return values.digest(self)


class CaseGroup(values.Value):
    """One situation under `seeds` seeds from `first_seed` on."""

    situation: Situation
    first_seed: values.Count
    seeds: Annotated[int, msgspec.Meta(ge=1, le=MOST_SEEDS)]


class Suite(values.Value):
    """A versioned set of cases. Its id is its digest; a newer version holds every case of the older one."""

    name: values.Name
    version: Annotated[int, msgspec.Meta(ge=1)]
    groups: Annotated[tuple[CaseGroup, ...], msgspec.Meta(min_length=1)]

    @property
    def suite_id(self) -> Digest:
        return values.digest(self)


def cases_of(suite: Suite) -> tuple[Case, ...]:
    """Every case once, in the order of its groups."""
    return tuple(dict.fromkeys(_all(suite)))


def _all(suite: Suite) -> Iterator[Case]:
    for group in suite.groups:
        for number in range(group.seeds):
            yield Case(situation=group.situation, seed=group.first_seed + number)


def seeds_digest(cases: tuple[Case, ...]) -> Digest:
    """The digest of an exact list of cases, in their order."""
    return values.digest([case.case_id for case in cases])


def spread(cases: tuple[Case, ...], most: int) -> tuple[Case, ...]:
    """At most this many cases, taken evenly over families and situations: a quick look, never an acceptance."""
    if most >= len(cases):
        return cases
    piles: dict[Situation, list[Case]] = {}
    for case in cases:
        piles.setdefault(case.situation, []).append(case)
    rounds = (pile[number] for number in range(len(cases)) for pile in piles.values() if number < len(pile))
    return tuple(case for case, _ in zip(rounds, range(most), strict=False))
