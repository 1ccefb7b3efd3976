"""Working memory: a view of the mission, with nothing of its own."""

import pytest

from harness.contracts.commands import RaiseVeto
from harness.contracts.memory import MemoryRecord
from harness.memory.working import working
from harness.projections.mission import Mission
from tests.builders.gate import GO
from tests.unit.memory.building import LOOK, Log


@pytest.mark.ledger("R136", symbol="harness.memory.working:working")
def test_working_memory_is_the_active_graph_and_who_acts() -> None:
    log = Log()
    mission_id = log.begin()
    begun = working(log.mission(mission_id))
    assert (begun.graph, begun.frontier, begun.acting) == ({GO: "pending", LOOK: "pending"}, (GO,), None)
    mission = log.dispatched(mission_id)
    assert mission.invocation is not None
    under_way = working(mission)
    assert (under_way.graph[GO], under_way.frontier) == ("dispatched", ())
    assert (under_way.acting, under_way.provider_id) == (mission.invocation.intent.invocation_id, "p1")
    done = working(log.judged(mission_id))
    assert (done.graph[GO], done.frontier, done.k) == ("committed", (LOOK,), log.mission(mission_id).k)


def test_working_memory_shows_vetoes_and_what_recovery_has_left() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id, "violated")
    log.looked_again(mission_id)
    log.judged(mission_id)
    now = working(log.commit(mission_id, RaiseVeto(layer="base", reason="bumper")))
    assert (now.vetoes, now.recovery_left, now.status) == ({"base": "bumper"}, 7, "active")


def test_working_memory_is_never_stored() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    assert {one.record.role for one in log.found()} == {"spatial", "episodic", "operational", "semantic"}
    assert "working" not in str(MemoryRecord.__annotations__["role"])


def test_a_mission_without_a_contract_has_no_graph() -> None:
    with pytest.raises(ValueError, match="no contract"):
        working(Mission())
