"""Connects the conformance kit to a robot at an HTTP address: the providers it serves, in its own time."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from harness.adapters.providers.http.clocks import clock_of
from harness.adapters.providers.http.robot import HttpProvider, HttpRobot
from harness.conformance.subject import ProviderUnderTest, Stand
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.ports import Clock
from harness.contracts.reasons import because


@dataclass(frozen=True)
class AddressedStands:
    """What answers at an address: the name that it gives itself, a `Stand` for each provider, and the cards."""

    robot_id: RobotId
    stands: dict[ProviderId, Stand]
    cards: tuple[CapabilityCard, ...]


@contextmanager
def addressed(url: str, token: str) -> Iterator["AddressedStands"]:
    """The robot at `url`. Raises ProviderUnreachable if it does not answer.

    A robot whose `/clock` has speed 0 is run in lockstep; any other in its own time.
    """
    with ExitStack() as stack:
        robot = HttpRobot(url.rstrip("/"), token)
        stack.callback(robot.close)
        cards = tuple(provider.card for provider in robot.providers())
        if len({card.provider_id for card in cards}) != len(cards):
            raise ProviderFailed(because("providers_share_name"), where=f"{url}/providers")

        clock = clock_of(robot)

        def fresh() -> HttpRobot:
            again = HttpRobot(url.rstrip("/"), token)
            stack.callback(again.close)
            return again

        yield AddressedStands(
            robot_id=RobotId(robot.status().robot_id),
            stands={card.provider_id: _stand(robot, card, clock, fresh) for card in cards},
            cards=cards,
        )


def _stand(robot: HttpRobot, card: CapabilityCard, clock: Clock, fresh: Callable[[], HttpRobot]) -> Stand:
    def stand() -> ProviderUnderTest:
        return ProviderUnderTest(
            provider=HttpProvider(robot, card),
            clock=clock,
            reattached=lambda: HttpProvider(fresh(), card),
            blob=robot.blob,
            observations=robot.observations,
            starts=robot.starts,
        )

    return stand
