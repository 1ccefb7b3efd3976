"""Tells a question that only waits for a yes, because a rule asks a person first, from one that follows a failure."""

from harness.contracts.configuration import FailureClass
from harness.contracts.reasons import Explanation, Reason, parts

FIRST: frozenset[str] = frozenset(
    {
        "configuration_in_canary",
        "each_motion_approved",
        "mission_is_manual",
        "risky_motion_approved",
        "stage_of_high_risk",
    }
)
"""The codes of the rules by which a person is asked before a start; see harness/recovery/approval.py."""


def is_routine(failure: FailureClass | str, reason: Explanation) -> bool:
    """Whether nothing has gone wrong: the start itself needs a person's approval."""
    return (
        failure == "precondition_unmet"
        and isinstance(reason, Reason)
        and any(one.code in FIRST for one in parts(reason))
    )
