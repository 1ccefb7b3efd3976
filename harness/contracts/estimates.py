"""What a world model estimates of candidate targets: recorded, used for the order of planning, never evidence (R42)."""

import msgspec

from harness.contracts.ids import NodeId, ProviderId, RequestId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Name, Share, Value

ESTIMATE = "estimate"
"""The kind of its record in C1, with origin `provider`: C3 admits no such record (R65)."""


class TargetEstimates(Value):
    """One answer of an estimating provider: a score for each candidate stage, 1 for the best; or why there is none."""

    provider_id: ProviderId
    provider_version: Name
    request_id: RequestId
    scores: dict[NodeId, Share] = msgspec.field(default_factory=dict)
    missing: Explanation = ""
