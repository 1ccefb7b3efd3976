"""Connects an arm to the robot: directly, or over a wire that delivers another mission's report once more."""

from collections.abc import Sequence
from typing import Any

from harness.contracts import protocol
from harness.contracts.ids import Digest, MissionId, RequestId
from harness.contracts.ports import Provider, Robot
from harness.provider_protocol.delegation import DelegatingProvider

AFTER_S, FOR_S = 1.0, 4.0
"""The late report takes the place of the real ones from this long after a mission's first navigation began."""


class MisdeliveringWire:
    """A robot whose reports pass over a wire that kept the last mission's final one and delivers it again, late."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._providers = tuple(LateProvider(one) if one.card.moves else one for one in robot.providers())

    @property
    def world(self) -> Any:
        """The world of a simulated robot, for the adjudicator's clerk."""
        return getattr(self._robot, "world")  # noqa: B009 - the port does not name it

    def providers(self) -> Sequence[Provider]:
        return self._providers

    def status(self) -> protocol.RobotStatus:
        return self._robot.status()

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        return self._robot.observations(after, limit)

    def blob(self, digest: Digest) -> bytes:
        return self._robot.blob(digest)

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return self._robot.starts()


class LateProvider(DelegatingProvider):
    """One provider over that wire. Only the first request of the second mission is affected."""

    def __init__(self, provider: Provider) -> None:
        super().__init__(provider)
        self._missions: list[MissionId] = []
        self._struck: RequestId | None = None
        self._began_s = 0.0
        self._late: protocol.InvocationReport | None = None

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        report = super().start(request)
        if request.identity.mission_id not in self._missions:
            self._missions.append(request.identity.mission_id)
            if len(self._missions) > 1 and self._late is not None:
                self._struck, self._began_s = request.identity.request_id, report.at_s
        return report

    def report(self, handle: str) -> protocol.InvocationReport:
        real = super().report(handle)
        if real.identity.request_id == self._struck and self._late is not None:
            due = AFTER_S <= real.at_s - self._began_s <= AFTER_S + FOR_S
            return self._late if due else real
        if real.status in protocol.TERMINAL:
            self._late = real
        return real
