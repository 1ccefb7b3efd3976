"""Runs the no-op mission: seven stages whose provider does nothing, on the real gate, store, contexts and verification.

What remains when nothing has to be done is the harness itself: C1, routing, C2, intent with its lease, C3 over the
receipt's bytes, verdict and commit, with validation and hashing on, on SQLite with every commit synced.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SystemIds
from harness.adapters.pictures import PICTURES
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.installation_key import InstallationKey
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.snapshots import StoredSnapshots
from harness.adapters.stores.spool import FileSpool
from harness.adapters.stores.sql import SqlEventStore
from harness.bootstrap import Harness, NullSignals, Parts, assemble
from harness.contracts.actors import Actor
from harness.contracts.capabilities import CancelBehaviour, CapabilityCard, Estimates, Latency
from harness.contracts.decisions import Refused
from harness.contracts.effects import Symbolic
from harness.contracts.errors import ProviderFailed
from harness.contracts.events import MissionCreated
from harness.contracts.ids import Digest, MissionId, ProviderId, RequestId, ResourceId, RobotId
from harness.contracts.observations import Odometry
from harness.contracts.ports import Clock, Provider
from harness.contracts.protocol import (
    PROTOCOL,
    InvocationReport,
    Observations,
    PhysicalStart,
    Progress,
    Receipt,
    RobotStatus,
    StartRequest,
)
from harness.contracts.tasks import TaskTemplate
from harness.projections.mission import Mission
from harness.provider_protocol.proposals import claims
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.supervisor import Supervisor

KEY = InstallationKey(secret=bytes(32))
"""Seals the snapshots of a benchmark's folder, which lasts as long as the benchmark."""
STAGES = 7
GOAL = "Do nothing, seven times, and prove it"
OPERATOR = Actor(name="bench", role="operator")
MAP_VERSION = "site-1"
SAMPLES_PER_S = 10
LOOK_S = 0.01
KEPT_SAMPLES = 30
LIMITS = {"re_perceive": 2, "adjust_view": 2, "retry": 1, "local_replan": 2, "switch_skill": 1, "total": 4}


def template(robot_id: RobotId, *, stages: int = STAGES) -> TaskTemplate:
    """`stages` no-op nodes in a row, each with one condition and a lease, and one condition over all of them."""
    names = [f"n{number}" for number in range(stages)]
    return TaskTemplate(
        name="no-op",
        version="1",
        title="Nothing",
        goal=GOAL,
        phrases=(),
        parameters=(),
        nodes=tuple(
            _node(name, after=names[number - 1 : number], resource=resource_of(robot_id))
            for number, name in enumerate(names)
        ),
        completion_conditions=(
            {
                "condition_id": "goal.in_order",
                "text": "All stages were accepted in their order",
                "effect": {
                    "type": "temporal",
                    "predicate": "in_order",
                    "interval_s": 1.0,
                    "bound": 1.0,
                    "nodes": names,
                },
            },
        ),
        constraints={"speed_cap_mps": 0.5, "resources": [resource_of(robot_id)]},
        recovery_total=8,
    )


def resource_of(robot_id: RobotId) -> ResourceId:
    """The resource that a no-op on this robot leases."""
    return ResourceId(f"nothing-{robot_id}")


def _node(name: str, *, after: Sequence[str], resource: ResourceId) -> dict[str, Any]:
    return {
        "node_id": name,
        "subgoal": "Do nothing",
        "capabilities": ["take_request"],
        "depends_on": list(after),
        "parameters": {},
        "resources": [resource],
        "evidence": {"mandatory": ["receipts"]},
        "timeout_s": 30.0,
        "recovery": LIMITS,
        "success_conditions": [
            {
                "condition_id": f"{name}.said",
                "text": "The bytes on record are the goal",
                "effect": {
                    "type": "symbolic",
                    "predicate": "recorded_request",
                    "arguments": {"digest": "${goal.digest}"},
                },
            }
        ],
    }


class NoopProvider:
    """A provider that does nothing: `start` ends at once with a receipt over the goal's bytes.

    `began` is called first at each start. While `failing`, it ends failed.
    """

    def __init__(self, *, clock: Clock, transcript: Digest, resource: ResourceId, began: Callable[[], None]) -> None:
        self._clock, self._transcript, self._began = clock, transcript, began
        self._reports: dict[RequestId, InvocationReport] = {}
        self.failing = False
        self.card = CapabilityCard(
            provider_id=ProviderId("no-op"),
            version="1",
            embodiments=("any",),
            parameters=(),
            preconditions=(),
            side_effects=(),
            latency=Latency(base_s=0.1),
            resources=(resource,),
            cancel=CancelBehaviour(acknowledged=True, within_s=1.0),
            risk="low",
            failure_words=("refused",),
            evidence=("receipt:transcript",),
            capability="take_request",
            estimates=Estimates(success=1.0, risk=0.0, uncertainty=0.0, cost=0.0),
            moves=False,
            sources=("keyboard",),
            software="no-op",
            protocol=PROTOCOL,
        )

    def start(self, request: StartRequest) -> InvocationReport:
        """Idempotent by request id."""
        self._began()
        known = self._reports.get(request.identity.request_id)
        if known is not None:
            return known
        now_s = self._clock.now().mission_s
        receipt = Receipt(
            receipt_id=f"transcript-{request.identity.request_id[:16]}",
            kind="transcript",
            at_s=now_s,
            source=self.card.provider_id,
            request_id=request.identity.request_id,
            text="nothing",
            blob=self._transcript,
        )
        report = InvocationReport(
            handle=request.identity.request_id,
            identity=request.identity,
            status="failed" if self.failing else "succeeded",
            at_s=now_s,
            progress=Progress(share=1.0),
            failure="refused" if self.failing else "",
            receipts=() if self.failing else (receipt,),
            proposed_facts=() if self.failing else claims(request, Symbolic, {"digest": self._transcript}),
        )
        self._reports[request.identity.request_id] = report
        return report

    def report(self, handle: str) -> InvocationReport:
        try:
            return self._reports[RequestId(handle)]
        except KeyError:
            raise ProviderFailed(f"No invocation {handle}", where="no-op", do="start it") from None

    def find(self, request: RequestId) -> InvocationReport | None:
        return self._reports.get(request)

    def keepalive(self, handle: str) -> None:
        self.report(handle)

    def resume(self, handle: str) -> InvocationReport:
        return self.report(handle)

    def stop(self, handle: str) -> InvocationReport:
        return self.report(handle)


class NoopRobot:
    """A robot that stands still and can do nothing, with odometry that reports this ten times a second.

    `looked` is called at the end of each observation.
    """

    def __init__(self, robot_id: RobotId, *, clock: Clock, looked: Callable[[], None]) -> None:
        self._robot_id, self._clock, self._looked = robot_id, clock, looked

    def providers(self) -> Sequence[Provider]:
        return ()

    def status(self) -> RobotStatus:
        return RobotStatus(
            robot_id=self._robot_id,
            at_s=self._clock.now().mission_s,
            posture="standing",
            armed=False,
            hardware_stop=False,
            charge=0.9,
            localised=True,
            map_version=MAP_VERSION,
        )

    def observations(self, after: int, limit: int = 5000) -> Observations:
        now_s = self._clock.now().mission_s
        newest = min(int(now_s * SAMPLES_PER_S), after + limit)
        samples = tuple(
            Odometry(
                seq=seq,
                at_s=seq / SAMPLES_PER_S,
                source="odometry",
                frame="odom",
                x_m=0.0,
                y_m=0.0,
                yaw_rad=0.0,
                v_mps=0.0,
                w_radps=0.0,
            )
            for seq in range(max(after, newest - KEPT_SAMPLES) + 1, newest + 1)
        )
        self._looked()
        return Observations(samples=samples, next_seq=newest, at_s=now_s)

    def blob(self, digest: Digest) -> bytes:
        raise ProviderFailed(f"No blob {digest}", where="no-op robot", do="ask nothing of it")

    def starts(self) -> Sequence[PhysicalStart]:
        return ()


class NoopHarness:
    """No-op robots under one supervisor, on the real parts, stored below one folder."""

    def __init__(
        self,
        harness: Harness,
        providers: Mapping[RobotId, NoopProvider],
        connections: Mapping[RobotId, RobotConnection],
    ) -> None:
        self.runtime, self.supervisor, self.clock = harness.runtime, harness.supervisor, harness.clock
        self.providers = providers
        self._connections = connections
        self._templates = {robot_id: template(robot_id) for robot_id in providers}

    def begin(self, robot_id: RobotId, *, shape: TaskTemplate | None = None) -> MissionId:
        """Create a mission that nothing has stepped yet."""
        start = Start(actor=OPERATOR, robot_id=robot_id, template="no-op")
        decision = self.runtime.start(start, template=shape or self._templates[robot_id])
        if isinstance(decision, Refused):
            raise RuntimeError(f"the no-op mission was refused: {decision.rule}")
        return next(event.mission_id for event in decision.events if isinstance(event, MissionCreated))

    def run(self, robot_id: RobotId) -> Mission:
        """Run a mission to its end. Raises RuntimeError if it ends otherwise than succeeded."""
        mission = self.supervisor.run(self.begin(robot_id))
        if mission.status != "succeeded":
            raise RuntimeError(f"the no-op mission ended {mission.status}: {mission.reason}")
        return mission

    def run_together(self, count: int) -> None:
        """Run so many missions, an equal share on every robot, as the service runs them.

        Raises RuntimeError if one ends otherwise than succeeded.
        """
        supervisor, robots = Supervisor(runtime=self.runtime, connections=self._connections), list(self.providers)
        with closing(supervisor):
            missions = [self.begin(robots[number % len(robots)]) for number in range(count)]
            supervisor.serve()
            for mission_id in missions:
                while not self.runtime.mission(mission_id).ended:
                    time.sleep(LOOK_S)
        statuses = {self.runtime.mission(mission_id).status for mission_id in missions}
        if statuses != {"succeeded"}:
            raise RuntimeError(f"the no-op missions ended {statuses}")


def log_url(folder: Path) -> str:
    """Where the log of a no-op harness lies."""
    return f"sqlite:///{folder / 'log.db'}"


@contextmanager
def noop_harness(
    folder: Path,
    *,
    robots: int = 1,
    looked: Callable[[], None] = lambda: None,
    began: Callable[[], None] = lambda: None,
    waits_for_people: bool = False,
    url: str = "",
    worker: str = "noop",
) -> Iterator[NoopHarness]:
    """The log in SQLite (WAL, synchronous=FULL) or at `url`, all other parts on disk below `folder`; virtual mission
    time. `worker` begins the names of its robots, of which no other worker on the same log has one."""
    names = [RobotId(f"{worker}-{number}") for number in range(robots)]
    with ExitStack() as stack:
        clock = LockstepClock(lambda until_s: until_s, at_s=0.0)
        blobs = FileBlobStore(folder / "blobs")
        store = stack.enter_context(closing(PostgresEventStore(url) if url else SqlEventStore(log_url(folder))))
        parts = Parts(
            store=store,
            snapshots=stack.enter_context(closing(StoredSnapshots(store, KEY))),
            blobs=blobs,
            spool=FileSpool(folder / "spool"),
            ids=SystemIds(),
            clock=clock,
            signals=NullSignals(),
            index=stack.enter_context(closing(SqlMemoryIndex(f"sqlite:///{folder / 'memory.db'}"))),
        )
        transcript = blobs.put(GOAL.encode())
        providers = {
            name: NoopProvider(clock=clock, transcript=transcript, resource=resource_of(name), began=began)
            for name in names
        }
        harness = assemble(
            stack,
            HarnessSettings(speed=1.0 if waits_for_people else 0.0, robot_id=names[0]),
            parts,
            robot=NoopRobot(names[0], clock=clock, looked=looked),
            local=(providers[names[0]],),
            configure=lambda mission: None,
        )
        connections = {name: _connection(name, parts, providers[name], looked=looked) for name in names}
        if robots > 1:
            harness = replace(harness, supervisor=Supervisor(runtime=harness.runtime, connections=connections))
            stack.callback(harness.supervisor.close)
        yield NoopHarness(harness, providers, connections)


def _connection(name: RobotId, parts: Parts, provider: NoopProvider, *, looked: Callable[[], None]) -> RobotConnection:
    return RobotConnection(
        robot_id=name,
        robot=NoopRobot(name, clock=parts.clock, looked=looked),
        providers={provider.card.provider_id: provider},
        clock=parts.clock,
        ids=parts.ids,
        spool=parts.spool,
        prepare=lambda mission: None,
        revive=lambda: False,
        pictures=PICTURES,
        waits_for_people=False,
        in_process=True,
    )
