"""Connects the conformance kit to a robot at an HTTP address: the providers it serves, in its own time."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from harness.adapters.clock import LockstepClock, RobotClock
from harness.adapters.providers.http.robot import HttpProvider, HttpRobot
from harness.conformance.subject import ProviderUnderTest, Stand
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.ids import ProviderId
from harness.contracts.ports import Clock
from harness.contracts.reasons import because

REAL_TIME = 1.0


@contextmanager
def addressed(url: str, token: str) -> Iterator[tuple[dict[ProviderId, Stand], tuple[CapabilityCard, ...]]]:
    """A `Stand` per provider, and the cards, of the robot at `url`. Raises ProviderUnreachable if it does not answer.

    A robot whose `/clock` has speed 0 is run in lockstep; any other in its own time.
    """
    with ExitStack() as stack:
        robot = HttpRobot(url.rstrip("/"), token)
        stack.callback(robot.close)
        cards = tuple(provider.card for provider in robot.providers())
        if len({card.provider_id for card in cards}) != len(cards):
            raise ProviderFailed(because("providers_share_name"), where=f"{url}/providers")

        clock = _clock(robot)

        def fresh() -> HttpRobot:
            again = HttpRobot(url.rstrip("/"), token)
            stack.callback(again.close)
            return again

        yield {card.provider_id: _stand(robot, card, clock, fresh) for card in cards}, cards


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


def _clock(robot: HttpRobot) -> Clock:
    try:
        reading = robot.clock()
    except ProviderUnreachable:
        raise
    except (ProviderFailed, UnknownName):
        return RobotClock(lambda: robot.status().at_s, REAL_TIME)
    if reading.speed:
        return RobotClock(lambda: robot.clock().at_s, reading.speed)
    return LockstepClock(robot.advance, at_s=reading.at_s)
