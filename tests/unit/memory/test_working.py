"""Working memory is the mission's own fold: the active graph and the control state, with nothing stored beside it."""

import pytest

from harness.contracts.commands import RaiseVeto
from harness.contracts.memory import MemoryRecord
from harness.projections.mission import eligible
from tests.builders.gate import GO
from tests.unit.memory.building import LOOK, Log


@pytest.mark.ledger("R136", symbol="harness.projections.mission_fold:apply")
def test_working_memory_is_the_active_graph_and_who_acts() -> None:
    log = Log()
    mission_id = log.begin()
    begun = log.mission(mission_id)
    assert {node_id: node.status for node_id, node in begun.nodes.items()} == {GO: "pending", LOOK: "pending"}
    assert (eligible(begun), begun.invocation) == ((GO,), None)
    under_way = log.dispatched(mission_id)
    assert under_way.invocation is not None
    assert (under_way.of(GO).status, eligible(under_way)) == ("dispatched", ())
    assert under_way.invocation.intent.provider_id == "p1"
    done = log.judged(mission_id)
    assert (done.of(GO).status, eligible(done), done.k) == ("committed", (LOOK,), log.mission(mission_id).k)


@pytest.mark.ledger("R136", symbol="harness.projections.mission:Mission.spent_total")
def test_working_memory_holds_vetoes_and_what_recovery_has_spent() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id, "violated")
    log.looked_again(mission_id)
    log.judged(mission_id)
    now = log.commit(mission_id, RaiseVeto(layer="base", reason="bumper"))
    assert now.contract is not None
    assert (now.vetoes, now.contract.recovery_total - now.spent_total, now.status) == ({"base": "bumper"}, 7, "active")


def test_working_memory_is_never_stored() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    assert {one.record.role for one in log.found()} == {"spatial", "episodic", "operational", "semantic"}
    assert "working" not in str(MemoryRecord.__annotations__["role"])
