"""The envelope of a command names its robot: its events bear that robot's mission time."""

from msgspec.structs import replace

from harness.adapters.clock import LockstepClock
from harness.adapters.stores.memory import MemoryEventStore
from harness.bootstrap import DECIDERS
from harness.contracts.commands import AcquireLease, ReleaseLease
from harness.contracts.ids import InvocationId, MissionId, ResourceId, RobotId, lease_stream, mission_stream
from harness.gate.commit import CommandEnvelope, Gate
from tests.builders.gate import creation

ONE, TWO = RobotId("vbot-1"), RobotId("vbot-2")
BASE = lease_stream(ResourceId("vbot-2/mobile_base"))


def clock(at_s: float) -> LockstepClock:
    return LockstepClock(lambda until_s: until_s, at_s=at_s, wall=lambda: 2000.0)


def gate_of(store: MemoryEventStore) -> Gate:
    return Gate(store=store, clock=clock(10.0), clocks={ONE: clock(10.0), TWO: clock(70.0)}, deciders=DECIDERS)


def taking(robot_id: RobotId | None) -> CommandEnvelope:
    held = InvocationId("inv_1")
    resource = ResourceId("vbot-2/mobile_base")
    command = AcquireLease(
        resource=resource, mission_id=MissionId("msn_1"), invocation_id=held, token=1, expires_s=500.0
    )
    return CommandEnvelope(BASE, command, robot_id)


def test_a_lease_alone_bears_the_mission_time_of_the_robot_that_is_named() -> None:
    store = MemoryEventStore()
    gate = gate_of(store)
    gate.commit([taking(TWO)])
    gate.commit([CommandEnvelope(BASE, ReleaseLease(invocation_id=InvocationId("inv_1"), reason="done"), TWO)])
    assert [event.mission_s for event in store.load(BASE)] == [70.0, 70.0]


def test_what_is_about_no_robot_or_an_unconnected_one_bears_the_sites_own_time() -> None:
    for robot_id in (None, RobotId("vbot-9")):
        store = MemoryEventStore()
        gate_of(store).commit([taking(robot_id)])
        assert [event.mission_s for event in store.load(BASE)] == [10.0]


def test_the_first_robot_that_is_named_counts_for_the_whole_transaction() -> None:
    store, mission_id = MemoryEventStore(), MissionId("msn_1")
    create = replace(creation(mission_id), robot_id=TWO)
    gate_of(store).commit([CommandEnvelope(mission_stream(mission_id), create, TWO), taking(None)])
    assert {event.mission_s for event in store.read()} == {70.0}
