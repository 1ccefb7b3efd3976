"""Validates a recovery policy: every failure class has a ladder, and every ladder ends with a person. Pure."""

from typing import get_args

from harness.contracts.configuration import SPENDING, FailureClass, RecoveryPolicy
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because


def check_policy(policy: RecoveryPolicy) -> None:
    """Raise ContractInvalid for the first ladder that is missing or ends otherwise than in `human` (D24).

    After a switch only free steps may follow: the gate cannot see whether another provider could take over, so
    no spending step may follow that one.
    """
    for failure in get_args(FailureClass):
        ladder = policy.ladders.get(failure, ())
        where = f"recovery.ladders.{failure}"
        if not ladder or ladder[-1] != "human" or "human" in ladder[:-1]:
            raise ContractInvalid(because("ladder_without_human", failure=failure), where=where)
        after = ladder[ladder.index("switch_skill") + 1 :] if "switch_skill" in ladder else ()
        if any(action in SPENDING for action in after):
            raise ContractInvalid(because("ladder_spends_after_switch", failure=failure), where=where)
