"""A connected robot with its providers, its clock and the roles that serve it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from harness.contracts import ports
from harness.contracts.capabilities import NOTHING_DECLARED, CapabilityCard, Vocabulary
from harness.contracts.errors import UnknownName
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.models import Models
from harness.contracts.reasons import because
from harness.exploration.targets import NEAREST_EDGE, Proposer
from harness.planning.planner import GRAPH_ORDER, Planner
from harness.projections.mission import Mission
from harness.verification.verdict import Verifier, verify


@dataclass(frozen=True)
class RobotConnection:
    """One robot and everything that can act for a mission on it.

    `prepare` tells a simulated world which mission begins; a real robot ignores it. `revive` tries to bring back a
    robot that does not answer, and says whether it did. `verifier` judges packets, `planner` proposes what comes next
    and `proposer` where to explore; none of them decides anything. `camera` is its live camera and `hand` its
    teleoperation interface, where the robot has such. `origins`: the process or address behind each provider and each
    source of samples. `sources` measure, without the providers, what a stage left; `pictures` decodes images. `models`
    may be asked about a failure. `in_process`: no call to the robot or to its clock waits for another process; one
    thread steps all such robots.
    """

    robot_id: RobotId
    robot: ports.Robot
    providers: Mapping[ProviderId, ports.Provider]
    clock: ports.Clock
    ids: ports.Ids
    spool: ports.Spool
    prepare: Callable[[Mission], None]
    revive: Callable[[], bool]
    pictures: ports.PictureReader
    embodiment: str = "quadruped"
    waits_for_people: bool = True
    verifier: Verifier = verify
    planner: Planner = GRAPH_ORDER
    proposer: Proposer = NEAREST_EDGE
    camera: ports.LiveCamera | None = None
    hand: ports.Teleoperable | None = None
    origins: Mapping[str, str] = field(default_factory=dict)
    sources: tuple[ports.IndependentSource, ...] = ()
    models: Models = field(default_factory=dict)
    in_process: bool = False
    vocabulary: Vocabulary = NOTHING_DECLARED

    def provider(self, provider_id: ProviderId) -> ports.Provider:
        """Raises UnknownName for a provider that is no longer there."""
        try:
            return self.providers[provider_id]
        except KeyError:
            raise UnknownName(
                because("unknown_provider", provider_id=provider_id, known=tuple(self.providers))
            ) from None

    @property
    def estimators(self) -> tuple[CapabilityCard, ...]:
        """Providers that only score candidate targets."""
        return tuple(card for card in self.cards if self.vocabulary.estimates(card))

    @property
    def cards(self) -> tuple[CapabilityCard, ...]:
        return tuple(provider.card for provider in self.providers.values())
