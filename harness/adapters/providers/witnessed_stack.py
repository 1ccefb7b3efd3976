"""A robot in shadow mode whose samples come by another path than what its stack declares. It only reads."""

from typing import Protocol

from harness.contracts import protocol
from harness.contracts.errors import ProviderFailed
from harness.contracts.ports import ObservedRobot
from harness.contracts.reasons import because


class SampleSource(Protocol):
    """What gives condition and samples of a robot."""

    def status(self) -> protocol.RobotStatus: ...

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations: ...


class WitnessedStack:
    """Implements `contracts.ports.ObservedRobot`: goals and identity from the robot, samples from its witness.

    A witness that names another robot is none of this one: ProviderFailed.
    """

    def __init__(self, stack: ObservedRobot, witness: SampleSource) -> None:
        self._stack, self._witness = stack, witness

    def status(self) -> protocol.RobotStatus:
        own, seen = self._stack.status(), self._witness.status()
        if seen.robot_id != own.robot_id:
            raise ProviderFailed(because("another_robot_answers", found=seen.robot_id[:80], expected=own.robot_id[:80]))
        return own

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        return self._witness.observations(after, limit)

    def stack_goals(self, after: int, limit: int = protocol.MOST_CHANGES) -> protocol.StackGoals:
        return self._stack.stack_goals(after, limit)
