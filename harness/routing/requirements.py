"""States what a node requires of a provider, and the state that routing may use. Pure."""

import msgspec

from harness.contracts.capabilities import Capability
from harness.contracts.ids import Digest, NodeId, ProviderId
from harness.contracts.protocol import Parameters, RobotStatus
from harness.contracts.reasons import Explanation
from harness.contracts.tasks import Node
from harness.contracts.values import Count, Name, Positive, Value
from harness.routing.history import RoutingHistory


class ProviderRequirements(Value):
    """What a node requires of a provider, at one state version.

    `parameters` as stated by the node: a text `@{node.argument}` (under `images_from` for `images`) is bound later.
    `place` is where the work is done, for history. `vetoes` maps each layer that restricts to its reason. `status`
    must be no older than `status_age_s` at `at_s` (mission time).
    """

    node: Node
    capabilities: tuple[Capability, ...]
    parameters: Parameters
    embodiment: Name
    k: Count
    at_s: float
    map_version: str
    configuration: Digest
    place: str = ""
    status: RobotStatus | None = None
    status_age_s: Positive = 2.0
    minimum_charge: float = 0.0
    excluded: tuple[ProviderId, ...] = ()
    vetoes: dict[str, Explanation] = msgspec.field(default_factory=dict)
    history: RoutingHistory = RoutingHistory()

    @property
    def node_id(self) -> NodeId:
        return self.node.node_id
