"""Defines the errors of the release service, as one branch of the harness's error tree.

HarnessError
└── CandidateInvalid     a candidate or manifest from outside cannot be read, or is no configuration

A candidate that can be read and may not be released is refused, which is a value (`decisions.Refused`).
"""

from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import Explanation


class CandidateInvalid(ContractInvalid):
    """A candidate or a manifest from outside cannot be read. `rule` is the slug of what it breaks."""

    code = "candidate_invalid"

    def __init__(self, what: Explanation, *, rule: str, where: Explanation = "", do: Explanation = "") -> None:
        super().__init__(what, where=where, do=do)
        self.rule = rule
