"""Memory in whole missions: what one learns reaches the next one's routing and its skill role."""

from collections.abc import Iterator

import pytest

from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.bootstrap import Harness, simulated
from harness.contracts.contexts import Context
from harness.contracts.events import DispatchIntended, NodePlanned
from harness.contracts.ids import MissionId, NodeId
from harness.contracts.memory import MemoryQuery, ProviderOutcome, Sighting
from harness.contracts.proposals import CandidateSet
from harness.contracts.values import decode, encode
from harness.gate.decide import DECIDER
from harness.memory.examples import Example
from harness.memory.fabric import MemoryFabric
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.missions_run import begin
from tests.unit.memory.building import EVERY_STANDING, EVERYTHING

FIRST, SECOND = 0, 1
STORE = MemoryEventStore()


@pytest.fixture(scope="module")
def inspected() -> Iterator[tuple[Harness, list[MissionId]]]:
    """Two inspections by one harness: in the first one the controller reports success too early once."""
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3, store=STORE) as harness:
        missions = [begin(harness, "warehouse-inspection", *faults) for faults in (("early-success",), ())]
        assert [harness.supervisor.run(mission_id).status for mission_id in missions] == ["succeeded", "succeeded"]
        yield harness, missions


def intents(harness: Harness, mission_id: MissionId, node: str) -> list[DispatchIntended]:
    events = (DECIDER.codec.decode(event) for event in harness.runtime.events(mission_id))
    return [event for event in events if isinstance(event, DispatchIntended) and event.node_id == node]


def scored(harness: Harness, mission_id: MissionId, node: str) -> CandidateSet:
    """The candidates of a node's first dispatch, as stored with the plan."""
    events = (DECIDER.codec.decode(event) for event in harness.runtime.events(mission_id))
    planned = next(event for event in events if isinstance(event, NodePlanned) and event.node_id == node)
    return decode(harness.runtime.record(planned.candidates).body, CandidateSet)


def history_term(candidates: CandidateSet, provider: str) -> float:
    return next(one.terms["history"] for one in candidates.candidates if one.provider_id == provider)


def examples(harness: Harness, mission_id: MissionId, node: str) -> list[Example]:
    """What C2 of a node's last dispatch was shown, as it is stored."""
    intent = intents(harness, mission_id, node)[-1]
    context = decode(harness.runtime.record(intent.context).body, Context)
    return [record.read(Example) for record in context.all("example")]


@pytest.mark.ledger("R60", symbol="harness.supervisor.roles:RoleContexts.history")
def test_verified_failures_of_one_mission_weigh_on_the_next_ones_routing(
    inspected: tuple[Harness, list[MissionId]],
) -> None:
    harness, missions = inspected
    weight, half_life = 0.8, 0.5 ** (1 / 20.0)
    before, after = (scored(harness, mission_id, "go") for mission_id in missions)
    assert history_term(before, "route-follower") == history_term(before, "careful-local-planner") == -weight * 0.5
    asked = MemoryQuery(kinds=("outcome",), mission_id=missions[FIRST], place="office_storage")
    found = harness.runtime.memory.find(asked)
    drives = [one.record.knowledge for one in found if isinstance(one.record.knowledge, ProviderOutcome)]
    arrived, refuted = (one for one in drives if one.provider_id == "route-follower")
    assert (refuted.verdict, arrived.verdict) == ("violated", "satisfied")
    penalty = (1.0 + arrived.residual + half_life) / (2.0 + 1.0 + half_life)
    assert history_term(after, "route-follower") == pytest.approx(-weight * penalty)
    assert history_term(after, "careful-local-planner") == -weight * 0.5


@pytest.mark.ledger("R139", symbol="harness.supervisor.roles:RoleContexts.examples")
def test_the_skill_role_is_shown_what_worked_here_before(inspected: tuple[Harness, list[MissionId]]) -> None:
    harness, missions = inspected
    assert [len(examples(harness, missions[FIRST], node)) for node in ("request", "go", "panorama")] == [0, 0, 0]
    (example,) = examples(harness, missions[SECOND], "go")
    worked = intents(harness, missions[FIRST], "go")[-1]
    assert (example.verdict, example.parameters) == ("satisfied", worked.parameters)
    assert example.place == "office_storage" and example.measured["distance_m"] <= 0.4
    cited = harness.runtime.memory.get(example.record_id).record
    assert cited.provenance.position == example.position
    assert example.packet_id in {
        packet.identity.packet_id for packet in harness.runtime.mission(missions[FIRST]).of(NodeId("go")).packets
    }


def test_a_failed_attempt_is_never_an_example(inspected: tuple[Harness, list[MissionId]]) -> None:
    harness, missions = inspected
    nodes = harness.runtime.mission(missions[SECOND]).nodes
    shown = {node: examples(harness, missions[SECOND], node) for node in nodes}
    assert {one.verdict for found in shown.values() for one in found} == {"satisfied"}
    assert all(shown[NodeId(node)] for node in ("request", "go", "panorama", "report"))


def test_an_example_that_does_not_fit_the_budget_is_named_among_what_was_withheld(
    inspected: tuple[Harness, list[MissionId]],
) -> None:
    harness, missions = inspected
    for node in harness.runtime.mission(missions[SECOND]).nodes:
        intent = intents(harness, missions[SECOND], node)[-1]
        context = decode(harness.runtime.record(intent.context).body, Context)
        dropped = [one for one in context.withheld if (one.kind, one.reason) == ("example", "budget")]
        assert len(context.all("example")) + len(dropped) == 1


def test_the_passage_that_was_found_obstructed_is_known_with_the_report_that_says_so(
    inspected: tuple[Harness, list[MissionId]],
) -> None:
    harness, missions = inspected
    asked = MemoryQuery(kinds=("sighting",), standings=EVERY_STANDING, subject="passage/storage_passage")
    new, old = harness.runtime.memory.find(asked)
    assert (old.standing, new.standing) == ("superseded", "observed")
    assert isinstance(new.record.knowledge, Sighting) and new.record.knowledge.states["blocked"] == 1.0
    assert new.record.provenance.mission_id == missions[SECOND]
    assert all(harness.runtime.has_blob(digest) for digest in new.record.provenance.blobs)


def test_memory_of_whole_missions_is_rebuilt_from_the_log_byte_for_byte(
    inspected: tuple[Harness, list[MissionId]],
) -> None:
    harness, _ = inspected
    again = MemoryFabric(store=STORE, index=VolatileMemoryIndex())
    query = MemoryQuery(kinds=EVERYTHING, standings=EVERY_STANDING, limit=10_000)
    assert encode(again.find(query)) == encode(harness.runtime.memory.find(query))
    roles = {one.record.role for one in again.find(query)}
    assert roles == {"spatial", "episodic", "operational", "semantic"}
    cards = [one for one in again.find(query) if one.record.kind == "card"]
    assert len(cards) == 6
