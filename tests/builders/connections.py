"""Builds whole missions in virtual time with one part exchanged: a provider, the verifier or the planner."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import MappingProxyType

from msgspec.structs import replace

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.baseline.load import baseline
from harness.baseline.load import site as shipped_site
from harness.bootstrap import Deciders, Harness, NullSignals, Parts, Select, assemble, local_services, nothing_selected
from harness.contracts.decisions import Accepted
from harness.contracts.ids import Digest, MissionId
from harness.contracts.models import Models
from harness.contracts.places import Site
from harness.contracts.ports import BlobStore, PictureObserver, Provider
from harness.contracts.protocol import InvocationReport, Observations, PhysicalStart, RobotStatus
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.tasks import TaskTemplate
from harness.exploration.targets import NEAREST_EDGE, Proposer
from harness.planning.planner import GRAPH_ORDER, Planner
from harness.planning.templates import by_name
from harness.projections.mission import Mission
from harness.provider_protocol.delegation import DelegatingProvider
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.verification.verdict import Verifier, verify
from simulator.camera import CAMERA
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings
from tests.builders.missions_run import OPERATOR, ROBOT, Ran

Wrap = Callable[[Provider], Provider]


class Failing(DelegatingProvider):
    """A provider that reports the first `times` executions that end as failed, with a failure word."""

    def __init__(self, inner: Provider, *, word: str, times: int = 1_000) -> None:
        super().__init__(inner)
        self.word, self.left = word, times
        self.failed: set[str] = set()

    def report(self, handle: str) -> InvocationReport:
        said = self.inner.report(handle)
        if said.status != "succeeded" or (handle not in self.failed and self.left == 0):
            return said
        if handle not in self.failed:
            self.failed.add(handle)
            self.left -= 1
        return replace(said, status="failed", failure=self.word, receipts=(), declared={})


class CrewRobot:
    """The simulated robot with its providers wrapped. `retouch` is applied to its sensor data before anybody
    reads it.
    """

    def __init__(self, inner: SimulatedRobot, wrap: Wrap) -> None:
        self.inner = inner
        self.retouch: Callable[[Observations], Observations] = lambda seen: seen
        self._providers = [wrap(provider) for provider in inner.providers()]

    def providers(self) -> Sequence[Provider]:
        return self._providers

    def status(self) -> RobotStatus:
        return self.inner.status()

    def observations(self, after: int, limit: int = 5000) -> Observations:
        return self.retouch(self.inner.observations(after, limit))

    def blob(self, digest: Digest) -> bytes:
        return self.inner.blob(digest)

    def starts(self) -> Sequence[PhysicalStart]:
        return self.inner.starts()


class Stage:
    """A harness whose missions the test steps. `robot` is the simulated one, ground truth included."""

    def __init__(self, harness: Harness, robot: SimulatedRobot, parts: Parts) -> None:
        self.harness, self.robot, self.parts = harness, robot, parts
        self.runtime, self.supervisor = harness.runtime, harness.supervisor

    def begin(self, template: str | TaskTemplate, *faults: str, seed: int = 3) -> MissionId:
        """Create a mission without running it."""
        labels = {"faults": ",".join(faults)} if faults else {}
        name = template if isinstance(template, str) else template.name
        start = Start(actor=OPERATOR, robot_id=ROBOT, template=name, seed=seed, labels=labels)
        given = None if isinstance(template, str) else template
        decision = self.runtime.start(start, template=given)
        assert isinstance(decision, Accepted), decision
        return self.runtime.missions()[0].mission_id

    def begin_at(self, template: str, *, seed: int = 3, **arguments: str) -> MissionId:
        """Create a mission with arguments of its template, without running it."""
        start = Start(actor=OPERATOR, robot_id=ROBOT, template=template, seed=seed, arguments={**arguments})
        assert isinstance(self.runtime.start(start), Accepted)
        return self.runtime.missions()[0].mission_id

    def until(self, mission_id: MissionId, true: Callable[[Mission], bool], *, steps: int = 20_000) -> Mission:
        """Step until the condition holds for the mission; fails if the mission ends or waits before."""
        for _ in range(steps):
            mission = self.runtime.mission(mission_id)
            if true(mission):
                return mission
            wake_s = self.supervisor.step(mission_id)
            assert wake_s is not None, f"{mission.status}: {mission.reason}"
            if true(self.runtime.mission(mission_id)):
                return self.runtime.mission(mission_id)
            self.harness.clock.wait_until(wake_s)
        raise AssertionError(f"not reached in {steps} steps")

    def run(self, mission_id: MissionId) -> Ran:
        """Run the mission to its end, or until it waits for a person."""
        mission = self.supervisor.run(mission_id)
        return Ran(harness=self.harness, mission=mission, truth=tuple(self.robot.world.truth.records))


@contextmanager
def staged(
    *,
    seed: int = 3,
    wrap: Wrap = lambda provider: provider,
    verifier: Verifier = verify,
    planner: Planner = GRAPH_ORDER,
    proposer: Proposer = NEAREST_EDGE,
    deciders: Deciders = MappingProxyType({}),
    select: Select = nothing_selected,
    rules: RulesVersion = CURRENT_RULES,
    site: Site | None = None,
    models: Callable[[BlobStore], Models] = lambda blobs: {},
    observer: PictureObserver | None = None,
) -> Iterator[Stage]:
    """The kinematic robot at speed 0, everything in this process; `select` pins new missions by a release service's
    `deciders`, `rules` are the ones that they are judged by. `models` are made on its blobs; `observer` looks at
    pictures.
    """
    with ExitStack() as stack:
        robot = SimulatedRobot(WorldSettings(fidelity="kinematic", seed=seed), robot_id=ROBOT)
        blobs = MemoryBlobStore()
        parts = Parts(
            store=MemoryEventStore(),
            blobs=blobs,
            spool=MemorySpool(),
            ids=SeededIds(seed),
            clock=LockstepClock(robot.advance_to, at_s=robot.at_s),
            signals=NullSignals(),
            verifier=verifier,
            planner=planner,
            proposer=proposer,
            deciders=deciders,
            select=select,
            site=site or shipped_site(),
            rules=rules,
            models=models(blobs),
            observer=observer,
        )

        def configure(mission: Mission) -> None:
            names = [name for name in mission.labels.get("faults", "").split(",") if name]
            robot.configure(mission.mission_id, mission.seed, parse_faults(names))

        beside = local_services(parts, camera=CAMERA, folder=None, room=robot.room)
        harness = assemble(
            stack,
            HarnessSettings(speed=0, fidelity="kinematic"),
            parts,
            robot=CrewRobot(robot, wrap),
            local=[wrap(provider) for provider in beside.providers],
            sources=beside.sources,
            configure=configure,
        )
        yield Stage(harness, robot, parts)


def template(name: str, **changes: object) -> TaskTemplate:
    """A shipped template with fields changed."""
    return replace(by_name(name, baseline().templates), **changes)


def with_node(base: TaskTemplate, node_id: str, **changes: object) -> TaskTemplate:
    """A template whose node has other fields."""
    nodes = tuple(node | changes if node["node_id"] == node_id else node for node in base.nodes)
    return replace(base, nodes=nodes)


def only(capability: str, wrap: Wrap) -> Wrap:
    """Wraps only the providers of one capability."""
    return lambda provider: wrap(provider) if provider.card.capability == capability else provider
