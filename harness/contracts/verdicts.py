"""The verifier's verdicts on evidence (D4). A verdict changes nothing; the gate decides."""

from typing import Literal

import msgspec

from harness.contracts.ids import ConditionId, Digest, MissionId, PacketId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Value

PredicateVerdict = Literal["satisfied", "violated", "ambiguous"]
Verdict = Literal["satisfied", "violated", "ambiguous", "stale", "unsafe"]
PRECEDENCE: tuple[Verdict, ...] = ("unsafe", "stale", "violated", "ambiguous", "satisfied")


class ConditionResult(Value):
    """One condition's result: measured values with their bounds, the reason and its independence level (D17).

    `short`: it is satisfied but for its independence, which alone makes it ambiguous. `rests_on`: the conditions of
    the accepted facts that the answer is derived from. Both are unset where the rules do not ask for them.
    """

    condition_id: ConditionId
    text: str
    verdict: Verdict
    reason: Explanation
    measured: dict[str, float] = msgspec.field(default_factory=dict)
    bounds: dict[str, float] = msgspec.field(default_factory=dict)
    sources: tuple[str, ...] = ()
    independence: Count = 0
    required_independence: Count = 0
    age_s: float | None = None
    evidence: tuple[Digest, ...] = ()
    short: bool | msgspec.UnsetType = msgspec.UNSET
    rests_on: tuple[ConditionId, ...] | msgspec.UnsetType = msgspec.UNSET


class NodeVerdict(Value):
    """The verdict over every declared postcondition of one packet."""

    packet_id: PacketId
    verdict: Verdict
    results: tuple[ConditionResult, ...]
    reason: Explanation
    verifier: Name
    context: Digest
    at_s: float


class GoalVerdict(Value):
    """The verdict over the original completion conditions."""

    mission_id: MissionId
    verdict: Verdict
    results: tuple[ConditionResult, ...]
    reason: Explanation
    verifier: Name
    context: Digest
    at_s: float


def strictest(verdicts: tuple[Verdict, ...]) -> Verdict:
    """By precedence unsafe > stale > violated > ambiguous > satisfied; nothing tested is ambiguous."""
    return min(verdicts, key=PRECEDENCE.index) if verdicts else "ambiguous"
