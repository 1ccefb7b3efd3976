"""Records all inputs of one routing decision, so that the same record gives the same candidates (R66, R146). Pure."""

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import RoutingPreferences
from harness.contracts.proposals import CandidateSet
from harness.contracts.values import Value
from harness.routing.candidates import candidates
from harness.routing.requirements import ProviderRequirements


class RoutingQuestion(Value):
    """What a node needs, which providers are candidates, and the weights that rank them."""

    need: ProviderRequirements
    cards: tuple[CapabilityCard, ...]
    preferences: RoutingPreferences

    def answer(self) -> CandidateSet:
        """All providers considered, best first, and the chosen one."""
        return candidates(self.need, cards=self.cards, preferences=self.preferences)
