"""A robot's own topics as a second path for its evidence, read apart from the program that executes."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from msgspec.structs import replace

from harness.adapters.providers.topics.ros_messages import Role
from harness.adapters.providers.topics.samples import TopicSamples
from harness.contracts import protocol
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import Digest
from harness.contracts.observations import Battery, Odometry
from harness.contracts.ports import Provider, Robot
from harness.contracts.reasons import Reason, because

FIRST_S, LOOK_S = 5.0, 0.05
FRESH_S = 2.0
MOVING_MPS, MOVING_RADPS = 0.02, 0.05
NEEDED: tuple[Role, ...] = ("pose", "odometry")
"""Without these no arrival and no standstill is ever shown."""

Topics = dict[Role, str]
Receive = Callable[[Role, str, Any], None]
"""A message of a role: its ROS 2 type, and the message with its field names."""
LeaveOut = Callable[[Role, Reason], None]


class TopicLink(Protocol):
    """Reads the topics of a robot and never writes any. It comes back by itself; `connected` says whether it is
    there."""

    @property
    def connected(self) -> bool: ...

    def open(self, receive: Receive, leave_out: LeaveOut) -> None: ...

    def close(self) -> None: ...


class TopicWitness:
    """Implements `contracts.ports.Robot` without a provider: samples, sweeps and pictures of the topics.

    What topics do not say, its stops, its arming and its map, is the robot's own word (`robot`); that it is localised
    and stands, both must say. Raises ProviderUnreachable where no pose and no odometry come within FIRST_S.
    """

    def __init__(
        self,
        robot: Robot,
        link: TopicLink,
        samples: TopicSamples,
        *,
        address: str,
        local_s: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        self._robot, self._link, self._samples, self._address = robot, link, samples, address
        link.open(samples.take, samples.leave_out)
        until_s = local_s() + FIRST_S
        while self._missing() and local_s() < until_s:
            wait(LOOK_S)
        if missing := self._missing():
            reason = next((samples.left_out[role] for role in missing if role in samples.left_out), None)
            silent = because("evidence_topics_silent", roles=tuple(missing))
            raise ProviderUnreachable(reason or silent, where=address)

    def providers(self) -> Sequence[Provider]:
        return ()

    def status(self) -> protocol.RobotStatus:
        """Raises ProviderUnreachable while the topics cannot be read."""
        self._check()
        own, newest = self._robot.status(), self._samples.newest
        pose, odometry, battery = newest.get("pose"), newest.get("odometry"), newest.get("battery")
        age_s = self._samples.pose_age_s(own.at_s)
        moving = isinstance(odometry, Odometry) and (
            abs(odometry.v_mps) > MOVING_MPS or abs(odometry.w_radps) > MOVING_RADPS
        )
        return replace(
            own,
            posture="moving" if moving else own.posture,
            charge=battery.charge if isinstance(battery, Battery) else own.charge,
            localised=own.localised and pose is not None and age_s is not None and age_s <= FRESH_S,
            pose_age_s=age_s,
        )

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        """Raises ProviderUnreachable while the topics cannot be read."""
        self._check()
        return self._samples.after(after, limit)

    def blob(self, digest: Digest) -> bytes:
        return self._samples.blob(digest)

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return self._robot.starts()

    def close(self) -> None:
        self._link.close()

    def _missing(self) -> list[Role]:
        return [role for role in NEEDED if role not in self._samples.newest]

    def _check(self) -> None:
        if not self._link.connected:
            raise ProviderUnreachable(because("evidence_link_lost"), where=self._address)


@contextmanager
def witnessed(robot: Robot, link: TopicLink, samples: TopicSamples, *, address: str) -> Iterator[TopicWitness]:
    """The witness, until the block ends. Raises as it does."""
    try:
        yield TopicWitness(robot, link, samples, address=address)
    finally:
        link.close()
