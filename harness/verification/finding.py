"""The answer of a predicate: one of three verdicts, measured values with their bounds, and the evidence used."""

import msgspec

from harness.contracts.ids import Digest
from harness.contracts.reasons import Reason, plain, several
from harness.contracts.values import Value
from harness.contracts.verdicts import PRECEDENCE, PredicateVerdict

RECEIPTS = "receipts"
"""The name of the provider's own word among a finding's sources: alone it is independence level 0 (D17)."""

SUPERVISOR, FACTS = "supervisor", "accepted facts"
BOOKKEEPING = (SUPERVISOR, FACTS)
"""The harness's own records among a finding's sources: they show what was recorded, never what is so in the world."""

UNAVAILABLE = "unavailable"
"""The name of the verifier where none could answer: it was absent, crashed or late (R45)."""


class Undecidable(Exception):
    """The evidence cannot decide: the reason says what is missing or unreadable."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(plain(reason))
        self.reason = reason


class Finding(Value):
    """One predicate's answer. `age_s`: age of the newest sample it needs, at the instant the evidence speaks for.

    `evidence` lists the digests it rests on; where facts bind them, the order is the predicate's own.
    """

    verdict: PredicateVerdict
    reason: Reason
    measured: dict[str, float] = msgspec.field(default_factory=dict)
    bounds: dict[str, float] = msgspec.field(default_factory=dict)
    sources: tuple[str, ...] = ()
    evidence: tuple[Digest, ...] = ()
    age_s: float | None = None


def ambiguous(reason: Reason, **parts: float) -> Finding:
    """An ambiguous finding: the evidence cannot decide. Keeps what was measured."""
    return Finding(verdict="ambiguous", reason=reason, measured=parts)


def worst(parts: tuple[tuple[PredicateVerdict, Reason | None], ...]) -> tuple[PredicateVerdict, Reason | None]:
    """The strictest of several partial answers, and the reasons of all that are not satisfied; None if all are."""
    verdict = min((part[0] for part in parts), key=PRECEDENCE.index)
    return verdict, several([reason for part, reason in parts if part != "satisfied" and reason is not None])
