"""Pure: everything routing was asked, as one record: the same question gives the same candidate set (R66, R146)."""

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import RoutingPreferences
from harness.contracts.proposals import CandidateSet
from harness.contracts.values import Value
from harness.routing.candidates import candidates
from harness.routing.need import Need


class RoutingQuestion(Value):
    """What a node needs, who might do it, and by which weights they are ranked."""

    need: Need
    cards: tuple[CapabilityCard, ...]
    preferences: RoutingPreferences

    def answer(self) -> CandidateSet:
        """All providers looked at, best first, and who is chosen."""
        return candidates(self.need, cards=self.cards, preferences=self.preferences)
