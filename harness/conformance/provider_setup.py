"""Sets up the installed providers for the kit: simulated robot, local providers, recording navigator; virtual time."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path
from typing import Any

from harness import bootstrap
from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SystemIds
from harness.adapters.providers.recording.reader import Recording
from harness.adapters.providers.recording.robot import CARD as RECORDING_NAVIGATOR
from harness.adapters.providers.recording.robot import RecordedRobot
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.conformance.subject import ProviderUnderTest, Stand
from harness.contracts.actors import Actor
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, ProviderFailed
from harness.contracts.ids import MissionId, ProviderId, RobotId
from harness.contracts.observations import Camera
from harness.contracts.ports import Provider
from harness.contracts.protocol import StackGoals
from harness.contracts.reasons import because, plain
from harness.contracts.simulation import InProcessRobot, Simulator
from harness.provider_protocol.operations import openapi, provider_operations, stack_operations
from harness.recordings import open_checked, write_recording
from harness.runtime import Start
from harness.settings import HarnessSettings

EPOCH_S = 1_790_000_000.0
_IDS = SystemIds()
KIT = Actor(name="conformance kit", role="harness")


def installed_cards(folder: Path, simulator: Simulator) -> tuple[CapabilityCard, ...]:
    """Cards of every installed provider. `folder` is scratch space."""
    robot = _plain(simulator)
    local = _local(folder, _parts(), bootstrap.camera_of(robot.robot))
    return (*_cards(robot), *(provider.card for provider in local), RECORDING_NAVIGATOR)


def fresh_name() -> MissionId:
    """A name for one check: robots remember request ids, so none may come twice."""
    return _IDS.mission()


def protocol(simulator: Simulator) -> dict[str, Any]:
    """The OpenAPI document of what every robot behind HTTP serves."""
    operations = (*provider_operations(_plain(simulator).robot), *stack_operations(_no_stack))
    return openapi(operations, "RegenHarness providers")


def _no_stack(after: int, limit: int) -> StackGoals:
    """The simulated robots have no stack of their own that decides."""
    raise ProviderFailed(because("stack_not_served"))


def _plain(simulator: Simulator) -> InProcessRobot:
    return simulator.robot("vbot-1", seed=0, fidelity="kinematic")


def _cards(robot: InProcessRobot) -> tuple[CapabilityCard, ...]:
    return tuple(provider.card for provider in robot.robot.providers())


@contextmanager
def installed(
    folder: Path, settings: HarnessSettings, simulator: Simulator, *, recording: Path | None = None
) -> Iterator[dict[ProviderId, Stand]]:
    """A `Stand` for every installed provider, by name. `folder` is scratch space for journals.

    `recording` is what the recording navigator replays; None: a circuit walked in the simulated site, recorded first.
    """
    numbers = count(1)
    with ExitStack() as stack:
        robot = _plain(simulator)
        camera = bootstrap.camera_of(robot.robot)
        stands = {card.provider_id: _on_robot(settings, simulator, card.provider_id) for card in _cards(robot)}
        for provider in _local(folder / "cards", _parts(), camera):
            stands[provider.card.provider_id] = _beside(folder, numbers, provider.card.provider_id, camera)
        stands[RECORDING_NAVIGATOR.provider_id] = _Replays(stack, folder, settings, simulator, recording)
        yield stands


def _on_robot(settings: HarnessSettings, simulator: Simulator, provider_id: ProviderId) -> Stand:
    def stand() -> ProviderUnderTest:
        made = simulator.robot(settings.robot_id, seed=settings.seed, fidelity=settings.fidelity)
        robot = made.robot

        def attached() -> Provider:
            return next(one for one in robot.providers() if one.card.provider_id == provider_id)

        return ProviderUnderTest(
            provider=attached(),
            clock=LockstepClock(made.advance_to, at_s=made.at_s),
            reattached=attached,
            blob=robot.blob,
            observations=robot.observations,
            starts=robot.starts,
        )

    return stand


def _beside(folder: Path, numbers: Iterator[int], provider_id: ProviderId, camera: Camera) -> Stand:
    def stand() -> ProviderUnderTest:
        parts, own = _parts(), folder / f"{provider_id}-{next(numbers)}"

        def again() -> Provider:
            return next(one for one in _local(own, parts, camera) if one.card.provider_id == provider_id)

        return ProviderUnderTest(
            provider=again(), clock=parts.clock, reattached=again, blob=parts.blobs.get, keep=parts.blobs.put
        )

    return stand


def _local(folder: Path, parts: bootstrap.Parts, camera: Camera) -> Sequence[Provider]:
    return bootstrap.local_services(parts, camera=camera, folder=folder).providers


def _parts() -> bootstrap.Parts:
    return bootstrap.Parts(
        store=MemoryEventStore(),
        blobs=MemoryBlobStore(),
        spool=MemorySpool(),
        ids=_IDS,
        clock=LockstepClock(lambda until_s: until_s, at_s=EPOCH_S),
        signals=bootstrap.NullSignals(),
    )


class _Replays:
    """A `Stand` over one recording, which is opened, or made, at the first row."""

    def __init__(
        self, stack: ExitStack, folder: Path, settings: HarnessSettings, simulator: Simulator, path: Path | None
    ) -> None:
        self._stack, self._folder, self._settings, self._path = stack, folder, settings, path
        self._simulator = simulator
        self._recording: Recording | None = None

    def __call__(self) -> ProviderUnderTest:
        robot = self._robot(0.0)
        return ProviderUnderTest(
            provider=robot.providers()[0],
            clock=robot,
            reattached=lambda: self._robot(robot.now().mission_s).providers()[0],
            blob=robot.blob,
            observations=robot.observations,
            starts=robot.starts,
        )

    def _robot(self, at_s: float) -> RecordedRobot:
        if self._recording is None:
            path = self._path or _walked(self._folder / "circuit.mcap", self._settings, self._simulator)
            self._recording = self._stack.enter_context(open_checked(path))
        robot = RecordedRobot(self._recording)
        self._stack.callback(robot.close)
        robot.advance_to(at_s)
        return robot


def _walked(path: Path, settings: HarnessSettings, simulator: Simulator) -> Path:
    """Record a circuit in the simulated site."""
    with bootstrap.simulated(settings, simulator=simulator, seed=settings.seed) as harness:
        started = harness.runtime.start(Start(actor=KIT, robot_id=RobotId(settings.robot_id), template="circuit"))
        if isinstance(started, Refused):
            raise ContractInvalid(plain(started.reason))
        mission = harness.supervisor.run(harness.runtime.missions()[0].mission_id)
        write_recording(harness.runtime, mission.mission_id, path)
    return path
