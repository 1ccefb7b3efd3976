"""The versions of the rules that a mission is judged by, and the predicates that new missions may no longer name."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated

import msgspec

from harness.contracts.capabilities import Risk

RulesVersion = Annotated[int, msgspec.Meta(ge=1, le=7)]
"""A mission is pinned to one when it is compiled, and replay judges with that one (D57).

1: a condition of low risk may rest on its provider's word alone; a condition derived from facts counts them as sources.
2: no effect is committed on its provider's word, and what is derived is no better than what it rests on (D17).
3: receipts count only for their own request and time, and sources that contradict each other leave it undecided.
4: an image counts only for the capture that its bytes were first recorded for, and copies of earlier captures do not;
a report must be heard to name each part that nothing verified, and a long interval is looked at as densely as a short
one.
5: a circuit that was begun again counts from where it was begun, where that shows more than all executions together.
6: odometry has to show as much of a circuit as the poses do, not only its last metres and its end.
7: a picture has to fit the lidar sweep of its own heading, and inertia that was felt before may not fall silent.
"""
FIRST_RULES: RulesVersion = 1
"""Of missions whose log names none."""
CURRENT_RULES: RulesVersion = 7
"""What new missions are compiled under."""
LINEAGE: RulesVersion = 2
"""The first version that records where each level comes from, and knows effects that are only declared."""
WITNESSES: RulesVersion = 3
"""The first version in which every source of an execution speaks, whichever of them a condition is tested on."""
CAPTURES: RulesVersion = 4
"""The first version in which images are compared with those of earlier captures."""
BEGUN_AGAIN: RulesVersion = 5
"""The first version in which a circuit may be shown by its last executions alone."""
WALKED_BY_ODOMETRY: RulesVersion = 6
"""The first version in which odometry speaks on the whole way of a circuit."""
SWEPT: RulesVersion = 7
"""The first version in which pictures are laid over lidar sweeps."""
INERTIA: RulesVersion = 7
"""The first version in which inertia that fell silent leaves motion undecided."""

REQUIRED: Mapping[RulesVersion, Mapping[Risk, int]] = MappingProxyType(
    {
        1: {"low": 0, "medium": 1, "high": 2},
        2: {"low": 1, "medium": 1, "high": 2},
        3: {"low": 1, "medium": 1, "high": 2},
        4: {"low": 1, "medium": 1, "high": 2},
        5: {"low": 1, "medium": 1, "high": 2},
        6: {"low": 1, "medium": 1, "high": 2},
        7: {"low": 1, "medium": 1, "high": 2},
    }
)
"""The independence level that the evidence of each risk class needs at least."""


def required_independence(rules: RulesVersion, *, risk: Risk, required: int | None) -> int:
    """The level that a condition needs: that of its risk, and what its contract asks beyond it."""
    return max(REQUIRED[rules][risk], required or 0)


Retired = Mapping[tuple[str, str], RulesVersion]
RETIRED: Retired = MappingProxyType(
    {
        ("relational", "analysis_of"): 2,
        ("relational", "linked"): 2,
        ("symbolic", "delivered"): 2,
        ("symbolic", "explored"): 2,
        ("symbolic", "played"): 2,
        ("symbolic", "reported"): 2,
        ("symbolic", "transcript"): 2,
    }
)
"""Predicates by effect type and name, and the first rules under which a new contract may name them only for a declared
effect: they ask nobody but the provider, or were replaced. Old contracts are judged by them for ever."""
