"""Defines the interface of a candidate generator: from records and the current version to candidates, and nothing else
(R165).

A generator is given no evaluator, no suite, no seeds and no secret, so none of them can be read from it (R168).
"""

from typing import Annotated, Protocol

import msgspec

from harness.contracts.configuration import Configuration
from harness.contracts.ids import Digest
from harness.contracts.values import Value
from rsi_reviews.contracts import Candidate
from rsi_reviews.generate.trace import Trace


class GenerationBudget(Value):
    """How many candidates may be returned, and which configurations were proposed before and must not be repeated."""

    candidates: Annotated[int, msgspec.Meta(ge=1, le=100)] = 1
    seen: tuple[Digest, ...] = ()


class Generator(Protocol):
    """One way to make candidates. Every candidate goes through the same static check, suite and gate."""

    @property
    def name(self) -> str:
        """The author's name in each manifest."""

    def propose(self, trace: Trace, current: Configuration, budget: GenerationBudget) -> tuple[Candidate, ...]:
        """At most `budget.candidates`, best first; none where the records give no reason."""
