"""Connects the conformance kit to a robot by its address: the providers it serves, in its own time."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass

from harness.adapters.clock import REAL_TIME, RobotClock
from harness.adapters.providers.http.clocks import clock_of
from harness.adapters.providers.http.robot import HttpProvider, HttpRobot
from harness.adapters.providers.vda5050.robot import VehicleRobot
from harness.conformance.subject import ProviderUnderTest, Stand
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.ports import Clock
from harness.contracts.reasons import because
from harness.provider_protocol.delegation import DelegatingProvider

VehicleConnection = Callable[[], AbstractContextManager[VehicleRobot]]
"""Connects a vehicle, until the block ends."""


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


class _Reconnected(DelegatingProvider):
    """The provider of a vehicle, through whichever connection is open: a restart of the supervisor opens another."""

    def __init__(self, connect: VehicleConnection, *, stack: ExitStack) -> None:
        self._connect, self._open = connect, stack.enter_context(ExitStack())
        self.robot = self._open.enter_context(connect())
        super().__init__(self.robot.providers()[0])

    def again(self) -> "_Reconnected":
        """End the connection as a process does that ends, and begin another one."""
        self._open.close()
        self.robot = self._open.enter_context(self._connect())
        self.inner = self.robot.providers()[0]
        return self


@contextmanager
def by_broker(connect: VehicleConnection, *, name: str) -> Iterator[AddressedStands]:
    """A VDA 5050 vehicle. Raises ProviderUnreachable if it does not answer."""
    with ExitStack() as stack:
        provider = _Reconnected(connect, stack=stack)
        clock = RobotClock(lambda: provider.robot.now_s(), REAL_TIME)

        def stand() -> ProviderUnderTest:
            return ProviderUnderTest(
                provider=provider,
                clock=clock,
                reattached=provider.again,
                blob=lambda digest: provider.robot.blob(digest),
                observations=lambda after, limit: provider.robot.observations(after, limit),
                starts=lambda: provider.robot.starts(),
            )

        yield AddressedStands(robot_id=RobotId(name), stands={provider.card.provider_id: stand}, cards=(provider.card,))


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
