"""Builder of a routing question: the inspection's way out, with one thing changed."""

from typing import Any

from msgspec.structs import replace

from harness.contracts.ids import NodeId
from harness.routing.requirements import ProviderRequirements
from tests.unit.planning.building import CONFIGURATION, NOW_S, SITE, contract, status


def need(**changes: Any) -> ProviderRequirements:
    node = contract().node(NodeId("go"))
    return replace(
        ProviderRequirements(
            node=node,
            capabilities=node.capabilities,
            parameters=node.parameters,
            embodiment="quadruped",
            k=3,
            at_s=NOW_S,
            map_version=SITE.map_version,
            configuration=CONFIGURATION.configuration_id,
            status=status(),
            minimum_charge=0.15,
        ),
        **changes,
    )
