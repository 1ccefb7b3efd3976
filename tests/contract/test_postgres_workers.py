"""Several workers on one PostgreSQL log: leases are transactions, and everybody sees one order of events."""

from collections.abc import Iterator
from contextlib import ExitStack, closing
from itertools import pairwise
from threading import Barrier, Thread

import pytest

from harness.adapters.clock import LockstepClock
from harness.adapters.stores.postgres import PostgresEventStore
from harness.bootstrap import DECIDERS
from harness.contracts.commands import AcquireLease, ReleaseLease
from harness.contracts.decider import Codec
from harness.contracts.decisions import Accepted
from harness.contracts.ids import InvocationId, MissionId, ResourceId, lease_stream
from harness.contracts.lease_events import LeaseAcquired, LeaseEvent
from harness.gate.commit import CommandEnvelope, Gate
from tools.postgres import PostgresServer

pytestmark = pytest.mark.xdist_group("postgres")

RESOURCES = (ResourceId("mobile_base"), ResourceId("arm"))
CODEC: Codec[LeaseEvent] = Codec(LeaseEvent)
WORKERS, ROUNDS = 4, 15


class Worker:
    """One supervisor's gate on a store of its own. Takes both resources or none, in its own order, and frees them."""

    def __init__(self, number: int, store: PostgresEventStore) -> None:
        self.store = store
        self.name = InvocationId(f"inv_{number}")
        self._order = RESOURCES if number % 2 else RESOURCES[::-1]
        clock = LockstepClock(lambda until: until, at_s=1000.0, wall=lambda: 2000.0)
        self.gate = Gate(store=store, clock=clock, deciders=DECIDERS)
        self.held = 0

    def work(self, together: Barrier) -> None:
        for _ in range(ROUNDS):
            together.wait()
            if isinstance(self._take(), Accepted):
                self.held += 1
                both = [self.gate.state(lease_stream(resource)).invocation_id for resource in RESOURCES]
                assert both == [self.name, self.name]
            together.wait()
            self._free()

    def _take(self) -> object:
        asked = []
        for resource in self._order:
            lease = self.gate.state(lease_stream(resource))
            command = AcquireLease(
                resource=resource,
                mission_id=MissionId("msn_1"),
                invocation_id=self.name,
                token=lease.token + 1,
                expires_s=2000.0,
            )
            asked.append(CommandEnvelope(lease_stream(resource), command, None))
        return self.gate.commit(asked)

    def _free(self) -> None:
        release = ReleaseLease(invocation_id=self.name, reason="at rest")
        self.gate.commit([CommandEnvelope(lease_stream(resource), release, None) for resource in RESOURCES])


@pytest.fixture
def workers(postgres: PostgresServer) -> Iterator[list[Worker]]:
    url = postgres.database()
    with ExitStack() as stack:
        stores = [stack.enter_context(closing(PostgresEventStore(url))) for _ in range(WORKERS)]
        yield [Worker(number, store) for number, store in enumerate(stores)]


@pytest.mark.ledger("R151", symbol="harness.adapters.stores.postgres:PostgresEventStore._begin")
@pytest.mark.ledger("R151", symbol="harness.adapters.stores.chain:link")
@pytest.mark.ledger("R151", symbol="harness.gate.leases:decide")
def test_of_several_workers_one_holds_all_it_asked_for_and_tokens_rise_in_one_order(workers: list[Worker]) -> None:
    together = Barrier(WORKERS, timeout=120)
    threads = [Thread(target=worker.work, args=(together,)) for worker in workers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(worker.held for worker in workers) == ROUNDS
    log = workers[0].store.read(limit=10_000)
    assert all(worker.store.verify().position == len(log) for worker in workers)
    taken = [(event, CODEC.decode(event)) for event in log if event.kind == "LeaseAcquired"]
    for resource in RESOURCES:
        acquired = [event for _, event in taken if isinstance(event, LeaseAcquired) and event.resource == resource]
        assert [event.token for event in acquired] == list(range(1, ROUNDS + 1))
    for (first, one), (second, other) in list(pairwise(taken))[::2]:
        assert second.position == first.position + 1
        assert isinstance(one, LeaseAcquired) and isinstance(other, LeaseAcquired)
        assert one.invocation_id == other.invocation_id and {one.resource, other.resource} == set(RESOURCES)
