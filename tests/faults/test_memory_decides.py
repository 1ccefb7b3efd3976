"""What earlier missions left in memory changes decisions of later ones, and nothing that was not accepted does."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from harness.adapters.stores.memory import MemoryEventStore
from harness.bootstrap import simulated
from harness.contracts.capabilities import CapabilityCard, Latency
from harness.contracts.contexts import Context
from harness.contracts.events import DispatchIntended, FailureClassified
from harness.contracts.ids import MissionId, NodeId
from harness.contracts.observations import Scan
from harness.contracts.ports import Provider, Robot
from harness.contracts.protocol import Observations
from harness.contracts.reasons import Reason
from harness.contracts.revision_commands import DisputeCompletion
from harness.contracts.revision_events import GraphRevised
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.provider_protocol.delegation import DelegatingProvider
from harness.routing.question import RoutingQuestion
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.connections import CrewRobot, Stage, staged
from tests.builders.missions_run import OPERATOR, begin

GO, CIRCUIT = NodeId("go"), NodeId("circuit")
SEED = 4


def blind(seen: Observations) -> Observations:
    """The lidar's sweeps are lost on the way to the harness; the robot itself still sees."""
    return replace(seen, samples=tuple(one for one in seen.samples if not isinstance(one, Scan)))


def explored_then_blocked(stage: Stage, *, disputed: bool) -> tuple[MissionId, MissionId]:
    """An exploration that ends among the shelves; then an inspection whose way to its route is closed."""
    earlier = stage.run(stage.begin("exploration", seed=SEED)).mission
    assert earlier.status == "succeeded"
    for fact in earlier.facts if disputed else ():
        said = DisputeCompletion(condition_id=fact.condition_id, actor=OPERATOR, reason="it was not there")
        stage.runtime.submit(earlier.mission_id, said)
    (robot,) = stage.harness.robots.values()
    assert isinstance(robot, CrewRobot)
    robot.retouch = blind
    later = stage.begin("warehouse-inspection", "hidden-passage:persistent", seed=SEED)
    stage.until(later, lambda mission: mission.of(GO).spent("local_replan") > 0)
    return earlier.mission_id, later


@pytest.mark.ledger("R137", symbol="harness.memory.fabric:MemoryFabric.arrivals")
@pytest.mark.ledger("R137", symbol="harness.supervisor.revisions:Revisions._memories")
def test_a_blocked_leg_drives_where_an_earlier_mission_saw_the_floor_free() -> None:
    with staged(seed=SEED) as stage:
        earlier, later = explored_then_blocked(stage, disputed=False)
        events = [DECIDER.codec.decode(one) for one in stage.runtime.events(later)]
        (revised,) = (event for event in events if isinstance(event, GraphRevised))
        assert isinstance(revised.reason, Reason) and revised.reason.code == "planned_from_memory"
        assert revised.reason.facts["missions"] == (earlier,)
        stage.until(later, lambda mission: mission.of(GO).status == "committed")


def test_what_a_person_disputed_is_no_floor_to_plan_on() -> None:
    with staged(seed=SEED) as stage:
        _, later = explored_then_blocked(stage, disputed=True)
        events = [DECIDER.codec.decode(one) for one in stage.runtime.events(later)]
        assert not [event for event in events if isinstance(event, GraphRevised)]
        said = [event.reason for event in events if isinstance(event, FailureClassified)]
        assert [one.code for one in said if isinstance(one, Reason)][-1] == "step_not_applicable"


class Renewed(DelegatingProvider):
    """The route follower with another card."""

    def __init__(self, inner: Provider, change: Callable[[CapabilityCard], CapabilityCard]) -> None:
        super().__init__(inner)
        self.change = change

    @property
    def card(self) -> CapabilityCard:
        card = self.inner.card
        return self.change(card) if card.provider_id == "route-follower" else card


def judged_and_shown(
    store: MemoryEventStore, change: Callable[[CapabilityCard], CapabilityCard], *, seed: int
) -> tuple[int, int]:
    """One circuit with that card: how many outcomes routing counted for it, how many examples C2 was shown."""

    def wire(robot: Robot) -> Robot:
        return CrewRobot(robot, lambda provider: Renewed(provider, change))  # type: ignore[arg-type]

    settings = HarnessSettings(speed=0, fidelity="kinematic")
    with simulated(settings, simulator=SIMULATOR, seed=seed, store=store, wire=wire) as harness:
        mission_id = begin(harness, "circuit")
        assert harness.supervisor.run(mission_id).status == "succeeded"
        events = (DECIDER.codec.decode(one) for one in harness.runtime.events(mission_id))
        intent = next(one for one in events if isinstance(one, DispatchIntended) and one.node_id == CIRCUIT)
        assert intent.provider_id == "route-follower" and intent.question is not None
        question = decode(harness.runtime.record(intent.question).body, RoutingQuestion)
        known = (one for one in question.need.history.settings if one.provider_id == "route-follower")
        context = decode(harness.runtime.record(intent.context).body, Context)
        return sum(one.sums.judged for one in known), len(context.all("example"))


@pytest.mark.ledger("R140", symbol="harness.memory.fabric:MemoryFabric.of_same_contract")
def test_outcomes_of_another_contract_of_a_provider_are_not_counted_or_shown() -> None:
    store = MemoryEventStore()
    assert judged_and_shown(store, lambda card: card, seed=1) == (0, 0)
    assert judged_and_shown(store, lambda card: card, seed=2) == (1, 1)
    assert judged_and_shown(store, lambda card: replace(card, version="1.0.1"), seed=3) == (2, 2), (
        "it declares the same"
    )
    slower = Latency(base_s=7.0, per_metre_s=2.2)
    assert judged_and_shown(store, lambda card: replace(card, version="2.0.0", latency=slower), seed=4) == (0, 0)
    assert judged_and_shown(store, lambda card: replace(card, version="2.0.0", latency=slower), seed=5) == (1, 1)
