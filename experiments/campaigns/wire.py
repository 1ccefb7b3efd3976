"""Simulates the link between harness and robot: decorators of the ports that lose, delay, repeat and swap messages.

Nothing here is part of the harness. Which disturbance strikes, and which call, is drawn from the mission's seed.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from msgspec.structs import replace

from experiments.campaigns.chance import uniform
from experiments.campaigns.plan import Disturbance, DisturbanceName, MissionPlan
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import Digest, MissionId, RequestId
from harness.contracts.ports import Clock, Provider, Robot
from harness.contracts.protocol import InvocationReport, Observations, PhysicalStart, RobotStatus, StartRequest
from harness.contracts.values import Moment

Answer = TypeVar("Answer")


class SteppedClock:
    """A clock of the harness that steps against the robot's while a `clock-step` lasts."""

    def __init__(self, clock: Clock, plan: MissionPlan, struck: Counter[str]) -> None:
        self._clock, self._struck = clock, struck
        self._steps = [one for one in plan.disturbances if one.name == "clock-step"]
        self._begun_s = clock.now().mission_s
        self._told: set[int] = set()

    @property
    def true_s(self) -> float:
        """Mission time without the steps."""
        return self._clock.now().mission_s

    def now(self) -> Moment:
        """Both clocks now; mission time includes the present steps."""
        moment = self._clock.now()
        offset_s = self._offset_s(moment.mission_s) if self._steps else 0.0
        return replace(moment, mission_s=moment.mission_s + offset_s) if offset_s else moment

    def wait_until(self, mission_s: float) -> None:
        """Until this clock shows `mission_s`; at least a moment passes where a step lies in between."""
        true_s = self.true_s
        self._clock.wait_until(max(mission_s - (self._offset_s(true_s) if self._steps else 0.0), true_s))

    def _offset_s(self, true_s: float) -> float:
        offset_s = 0.0
        for number, step in enumerate(self._steps):
            if step.at_s <= true_s - self._begun_s < step.at_s + step.for_s:
                offset_s += step.size_s
                if number not in self._told:
                    self._told.add(number)
                    self._struck["clock-step"] += 1
        return offset_s


class Wire(Protocol):
    """What carries the calls between harness and robot."""

    def carry(self, call: Callable[[], Answer], *, older: Answer | None = None, acts: bool = False) -> Answer: ...

    def strikes(self, name: DisturbanceName) -> Disturbance | None: ...


class FaultyWire:
    """Carries calls. One counter of calls per mission keys every draw, so that a seed replays exactly."""

    def __init__(self, plan: MissionPlan, clock: SteppedClock, struck: Counter[str]) -> None:
        self._plan, self._clock, self._struck = plan, clock, struck
        self._begun_s = clock.true_s
        self._calls = 0
        self._noisy = bool(plan.disturbances)

    def carry(self, call: Callable[[], Answer], *, older: Answer | None = None, acts: bool = False) -> Answer:
        """The answer of a call. `older` is an earlier answer that may come instead; `acts`: it may arrive twice."""
        if not self._noisy:
            return call()
        self._calls += 1
        if self.strikes("request-lost"):
            raise ProviderUnreachable("The request was lost on the way")
        answer = call()
        if acts and self.strikes("duplicated"):
            answer = call()
        late = self.strikes("late-reply")
        if late is not None:
            self._clock.wait_until(self._clock.now().mission_s + late.size_s)
        if self.strikes("reply-lost"):
            raise ProviderUnreachable("The reply was lost on the way")
        if older is not None and self.strikes("reordered"):
            return older
        return answer

    def strikes(self, name: DisturbanceName) -> Disturbance | None:
        """The disturbance of that name that strikes this call, if one does; it is counted."""
        for index, one in enumerate(self._plan.disturbances):
            if one.name != name or not one.at_s <= self._clock.true_s - self._begun_s < one.at_s + one.for_s:
                continue
            if one.share >= 1.0 or uniform(self._plan.seed, name, index, self._calls) < one.share:
                self._struck[name] += 1
                return one
        return None


class WiredProvider:
    """A provider at the other end of the wire. `local` providers may stop answering by themselves."""

    def __init__(self, provider: Callable[[], Provider], wire: Wire, *, card: CapabilityCard, local: bool) -> None:
        self._provider, self._wire, self._card, self._local = provider, wire, card, local
        self._before: dict[str, InvocationReport] = {}

    @property
    def card(self) -> CapabilityCard:
        return self._card

    def start(self, request: StartRequest) -> InvocationReport:
        return self._report(lambda: self._provider().start(request), acts=True)

    def report(self, handle: str) -> InvocationReport:
        return self._report(lambda: self._provider().report(handle), handle=handle)

    def find(self, request: RequestId) -> InvocationReport | None:
        self._hear()
        return self._wire.carry(lambda: self._provider().find(request))

    def keepalive(self, handle: str) -> None:
        self._hear()
        self._wire.carry(lambda: self._provider().keepalive(handle), acts=True)

    def resume(self, handle: str) -> InvocationReport:
        return self._report(lambda: self._provider().resume(handle), handle=handle, acts=True)

    def stop(self, handle: str) -> InvocationReport:
        return self._report(lambda: self._provider().stop(handle), handle=handle, acts=True)

    def _hear(self) -> None:
        if self._local and self._wire.strikes("provider-silent"):
            raise ProviderUnreachable("The provider does not answer", where=self._card.provider_id)

    def _report(
        self, call: Callable[[], InvocationReport], *, handle: str = "", acts: bool = False
    ) -> InvocationReport:
        self._hear()
        report = self._wire.carry(call, older=self._before.get(handle), acts=acts)
        self._before[report.handle] = report
        if self._wire.strikes("foreign-identity"):
            foreign = replace(report.identity, mission_id=MissionId("mis_of_somebody_else"))
            return replace(report, identity=foreign)
        return report


class WiredRobot:
    """A robot at the other end of the wire. Its start journal is read beside the wire, for counting."""

    def __init__(self, robot: Callable[[], Robot], wire: Wire) -> None:
        self._robot, self._wire = robot, wire
        self._batch: Observations | None = None
        self._providers = [
            WiredProvider(self._named(index), wire, card=provider.card, local=False)
            for index, provider in enumerate(robot().providers())
        ]

    def providers(self) -> Sequence[Provider]:
        return self._providers

    def status(self) -> RobotStatus:
        return self._wire.carry(lambda: self._robot().status())

    def observations(self, after: int, limit: int = 5000) -> Observations:
        batch = self._wire.carry(lambda: self._robot().observations(after, limit), older=self._batch)
        self._batch = batch
        return batch

    def blob(self, digest: Digest) -> bytes:
        return self._wire.carry(lambda: self._robot().blob(digest))

    def starts(self) -> Sequence[PhysicalStart]:
        return self._robot().starts()

    def _named(self, index: int) -> Callable[[], Provider]:
        return lambda: self._robot().providers()[index]
