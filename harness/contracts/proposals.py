"""What roles propose (R50): data without authority. The harness checks each proposal and the gate decides."""

from typing import Literal

import msgspec

from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.ids import Digest, NodeId, ProviderId
from harness.contracts.models import ModelUse
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, Name, Share, Value

Filter = Literal["capability", "embodiment", "parameters", "preconditions", "freshness", "safety", "excluded", ""]


class ProviderCandidate(Value):
    """One provider considered. `refused_by` names the hard filter that refused it; `terms` are weighted score terms."""

    provider_id: ProviderId
    version: Name
    refused_by: Filter = ""
    reason: Explanation = ""
    score: float | None = None
    terms: dict[str, float] = msgspec.field(default_factory=dict)


class CandidateSet(Value):
    """All providers considered for a node, best first, and the chosen one (R66). `chosen` may be none."""

    node_id: NodeId
    k: Count
    candidates: tuple[ProviderCandidate, ...]
    chosen: ProviderId | None


class PlanProposal(Value):
    """C1's output: the next eligible node, and why. None when nothing is eligible. `use`: of the model behind it."""

    node_id: NodeId | None
    reason: Explanation
    use: ModelUse | msgspec.UnsetType = msgspec.UNSET


class SkillProposal(Value):
    """C2's output: the parameters of one invocation of the selected provider."""

    provider_id: ProviderId
    parameters: Parameters
    reason: Explanation


class Signature(Value):
    """What must not be repeated unless something changed (D25)."""

    action: RecoveryAction
    provider_id: ProviderId
    provider_version: str
    parameters: Digest
    failure: FailureClass


class RecoveryProposal(Value):
    """C4's output: one step of the ladder. `cost` is 1 for spending actions, else 0."""

    action: RecoveryAction
    failure: FailureClass
    provider_id: ProviderId | None
    cost: Count
    reason: Explanation
    refused: tuple[Explanation, ...] = ()


class ProviderHistory(Value):
    """Verified outcomes of one provider at the stage's place; `penalty` is the history input of its score, 0 to 1."""

    provider_id: ProviderId
    place: str
    judged: Count
    failed: Count
    penalty: Share


class RoutingExplanation(Value):
    """One decision: every candidate with its terms, what history held of those that passed, and why this one."""

    node_id: NodeId
    candidates: tuple[ProviderCandidate, ...]
    chosen: ProviderId | None
    history: tuple[ProviderHistory, ...]
    reason: Reason
