"""What context C3 shows the verifier: an execution, its evidence policy and a goal's stages.

Contexts write these values, the verifier reads them. The records that hold them are listed in
`harness/contexts/verifier.py`.
"""

from collections.abc import Mapping, Sequence

import msgspec
from msgspec import UNSET, UnsetType

from harness.contracts.capabilities import CapabilityCard, Risk
from harness.contracts.evidence import PacketIdentity
from harness.contracts.ids import ConditionId, Digest, NodeId, RequestId
from harness.contracts.observations import Trajectory
from harness.contracts.predicates import PinnedPredicate
from harness.contracts.protocol import InvocationStatus
from harness.contracts.reasons import Explanation
from harness.contracts.rules import FIRST_RULES, RulesVersion
from harness.contracts.tasks import EvidencePolicy
from harness.contracts.values import Count, Point, Value


class Execution(Value):
    """The supervisor's record of the execution to judge, without the provider's own report; mission seconds.

    `begun`: how many starts of the request the robot's own journal holds, where it was asked.
    """

    identity: PacketIdentity
    k_ctx: Count
    configuration: Digest
    dispatched_s: float
    terminal_s: float
    collected_s: float
    terminal: InvocationStatus
    verify_only: bool
    begun: Count | UnsetType = UNSET


class Origins(Value):
    """Where the evidence comes from: by process or address, never by what a provider says of itself (D17).

    `sources` names the origin of each source; one that is not named has an unknown origin. `provider`: the origins
    of the executing provider and of what it reads; empty if it is unknown, or if no execution is judged.
    """

    sources: dict[str, str] = msgspec.field(default_factory=dict)
    provider: tuple[str, ...] = ()


def origins_of(origins: Mapping[str, str], *, vouched: Sequence[str], card: CapabilityCard | None) -> Origins:
    """Where each source comes from, and who executes: the provider of `card`, with the origins of what it reads.

    `origins` names the process or address behind each source and provider. A source that the site vouches for is an
    origin of its own (D17).
    """
    sources = {**origins, **{source: f"vouched {source}" for source in vouched}}
    if card is None or card.provider_id not in origins:
        return Origins(sources=sources)
    used = (origins[card.provider_id], *(sources[one] for one in card.sources if one in sources))
    return Origins(sources=sources, provider=tuple(dict.fromkeys(used)))


class Executors(Value):
    """Whoever did the stages that a completion condition is about, together: the sources that they use themselves, and
    the origins of them and of what they read.
    """

    sources: tuple[str, ...]
    origins: tuple[str, ...]


class VerificationPolicy(Value):
    """Requirements on the evidence. `required` is the independence level of each condition (D17).

    `rules`: the version that the mission is pinned to (D57). `executors`, of a goal: by completion condition, where it
    is known who did its stages; what is measured for one that is missing here is apart from nobody. `predicates`: the
    installed ones that the mission is pinned to.
    """

    evidence: EvidencePolicy
    risk: Risk
    required: dict[ConditionId, int]
    rules: RulesVersion = FIRST_RULES
    origins: Origins = Origins()
    executors: dict[ConditionId, Executors] | UnsetType = UNSET
    predicates: dict[str, PinnedPredicate] | UnsetType = UNSET


class SafetyState(Value):
    """The contract's constraints, with the floor regions they name (metres, contract frame) and active vetoes."""

    speed_cap_mps: float
    keep_out_m: dict[str, tuple[Point, ...]]
    vetoes: dict[str, Explanation]


class CommittedNode(Value):
    """One ended stage: whose packet, which requests it and the packets it cites rest on, when it ran.

    `committed_k` is the state version at which it was accepted, or, if `declared`, recorded as declared.
    """

    node_id: NodeId
    identity: PacketIdentity
    requests: tuple[RequestId, ...]
    dispatched_s: float
    terminal_s: float
    committed_k: Count
    declared: bool = False


class RecentSamples(Value):
    """Samples of the last seconds before a context's instant, by stream; at most `window_s` of them."""

    window_s: float
    trajectory: Trajectory
