"""Runs one caller of the hammer campaign as its own process: it sends requests to the gate until it is killed."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from experiments.campaigns.chance import one_of
from experiments.campaigns.hammer_asks import (
    SHARED_MISSIONS,
    SHARED_RESOURCES,
    CallerJournal,
    HammerRequest,
    Kind,
    own_resource,
    question_id,
    read_journal,
    requests_of,
    shared_mission,
    shared_resource,
)
from experiments.campaigns.races import NOW_S
from harness.adapters.clock import LockstepClock
from harness.adapters.failpoints import parse, with_failpoint
from harness.adapters.ids import SystemIds
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.installation_key import InstallationKey
from harness.adapters.stores.memory import MemorySpool
from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.adapters.stores.snapshots import StoredSnapshots
from harness.adapters.stores.sql import SqlEventStore
from harness.bootstrap import NullSignals, Parts, runtime_on
from harness.contracts.actors import Actor
from harness.contracts.commands import CreateMission
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId, RobotId, handoff_stream
from harness.contracts.ports import MemoryIndex
from harness.contracts.values import Value
from harness.projections.handoffs import Handoff
from harness.runtime import Runtime, Start

ROBOT = RobotId("vbot-1")
ASKING = Actor(name="ada", role="operator")
KEY = InstallationKey(secret=bytes(32))
"""The same for all callers, which share their snapshots."""
ENOUGH = "enough"
OFTEN = 16
"""Events after which a stream's state is stored: this campaign's streams are short."""
FOLLOWING = 25
"""After this many answers a caller brings the memory index, which all share, up to the log."""
TURNS: tuple[Kind, ...] = ("mission", "veto", "veto", "question", "answer", "answer", "lease", "lease")


class CallerIdentity(Value):
    """Identity of a caller: its number, the shared folder, the campaign's seed, and its fail-point, if it has one."""

    data: str
    number: int
    seed: int
    failpoint: str = ""

    @property
    def journal(self) -> Path:
        return Path(self.data) / f"caller-{self.number}.jsonl"


@contextmanager
def opened(data: Path, *, failpoint: str = "", keeping: bool = True, afresh: bool = False) -> Iterator[Runtime]:
    """A runtime of its own on the shared log, with the shared snapshots and memory index.

    Without `keeping` it only reads snapshots; `afresh` it uses neither snapshots nor the index.
    """
    folder = prepare(data)
    with ExitStack() as stack:
        log = stack.enter_context(closing(SqlEventStore(folder.log_url, busy_s=60.0)))
        index: MemoryIndex = VolatileMemoryIndex()
        if not afresh:
            opened_index = SqlMemoryIndex(f"sqlite:///{folder.root / 'memory.db'}", busy_s=60.0)
            index = stack.enter_context(closing(opened_index))
        parts = Parts(
            store=with_failpoint(log, parse(failpoint) if failpoint else None),
            blobs=FileBlobStore(folder.blobs),
            spool=MemorySpool(),
            ids=SystemIds(),
            clock=LockstepClock(lambda until_s: until_s, at_s=NOW_S, wall=lambda: NOW_S),
            signals=NullSignals(),
            index=index,
            snapshots=None
            if afresh
            else stack.enter_context(closing(StoredSnapshots(log, KEY, keeping=keeping, every=OFTEN))),
        )
        yield runtime_on(parts)


def creation(runtime: Runtime) -> CreateMission:
    """A new mission without an id yet; all of them have the same contract."""
    configuration = runtime.current_configuration(ROBOT)
    contract = runtime.draft(Start(actor=ASKING, robot_id=ROBOT, template="circuit"))
    return CreateMission(
        mission_id=MissionId(""),
        robot_id=ROBOT,
        goal=contract.goal.text,
        template="circuit",
        requested_by=ASKING,
        configuration=runtime.current_configuration_id(ROBOT),
        contract=contract,
        policy=configuration.recovery,
    )


def call(calling: CallerIdentity) -> None:
    """Continue where the journal ends, until the campaign says that it is enough."""
    data = Path(calling.data)
    before = read_journal(calling.journal)
    with opened(data, failpoint=calling.failpoint) as runtime, CallerJournal(calling.journal) as journal:
        caller = _Caller(calling, runtime, journal)
        if before.open is not None:
            caller.ask(before.open)
        number = len(before.asks)
        while not (data / ENOUGH).exists():
            caller.ask(caller.next(number))
            number += 1
            if number % FOLLOWING == 0:
                runtime.memory.catch_up()


class _Caller:
    """Draws each request by the seed and the present state, and writes down the result."""

    def __init__(self, calling: CallerIdentity, runtime: Runtime, journal: CallerJournal) -> None:
        self._calling, self._runtime, self._journal = calling, runtime, journal
        self._creating = creation(runtime)
        self._question = max(
            (ask.slot for ask in read_journal(calling.journal).asks if ask.kind == "question"), default=0
        )

    def ask(self, ask: HammerRequest) -> None:
        """Send the request to the gate and write the answer down."""
        self._journal.asks(ask)
        decision = self._runtime.commit(requests_of(ask, number=self._calling.number, creating=self._creating))
        self._journal.hears(ask.key, "done" if isinstance(decision, Accepted) else "refused")

    def next(self, handoff: int) -> HammerRequest:
        """Request number `asked`."""
        number, seed = self._calling.number, self._calling.seed
        key = f"c{number}-{handoff:06d}"
        kind = one_of(seed, TURNS, number, handoff, "turn")
        match kind:
            case "veto":
                slot = one_of(seed, range(SHARED_MISSIONS), number, handoff)
                vetoes = self._runtime.mission(shared_mission(slot)).vetoes
                return HammerRequest(key=key, kind=kind, slot=slot, back=f"caller-{number}" in vetoes)
            case "question":
                self._walk()
                return HammerRequest(key=key, kind=kind, slot=self._question)
            case "answer":
                return self._answer(key)
            case "lease":
                slot = one_of(seed, range(SHARED_RESOURCES), number, handoff)
                lease = self._runtime.lease(shared_resource(slot))
                back = lease.status == "held" and lease.invocation_id.startswith(f"c{number}-")
                return HammerRequest(
                    key=key, kind=kind, slot=slot, back=back, holder=lease.invocation_id, token=lease.token + 1
                )
            case _:
                return HammerRequest(key=key, kind="mission")

    def _answer(self, key: str) -> HammerRequest:
        """An answer takes the caller's own resource; if the caller still holds it, that lease is released first."""
        lease = self._runtime.lease(own_resource(self._calling.number))
        if lease.status == "held":
            return HammerRequest(key=key, kind="rest", back=True, holder=lease.invocation_id)
        self._walk()
        if self._open_handoff.opened is None:
            return HammerRequest(key=key, kind="question", slot=self._question)
        return HammerRequest(key=key, kind="answer", slot=self._question, token=lease.token + 1)

    def _walk(self) -> None:
        """Go on to the first question without an answer."""
        while self._open_handoff.status == "approved":
            self._question += 1

    @property
    def _open_handoff(self) -> Handoff:
        handoff: Handoff = self._runtime.fold(handoff_stream(question_id(self._question)))
        return handoff
