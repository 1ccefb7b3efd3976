"""May a mission change its configuration? Before it is active, for the same goal, by being compiled again."""

import pytest
from msgspec.structs import replace

from harness.contracts.commands import ActivateMission, RecompileContract
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.events import ContractRecompiled, MissionEvent
from harness.contracts.ids import Digest, NodeId, sha256
from harness.contracts.tasks import Goal, TaskContract
from harness.contracts.values import digest
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from tests.builders.gate import CONFIGURATION, NOW, POLICY, after, contract, created, creation

NEWER = Digest("d" * 64)


def compiled(**changes: object) -> Mission:
    return after(Mission(), creation(**changes))  # type: ignore[arg-type]


def again(mission: Mission, *, under: Digest = NEWER, to: TaskContract | None = None) -> Decision[MissionEvent]:
    command = RecompileContract(configuration=under, contract=to or contract(), policy=replace(POLICY, wait_s=33.0))
    return DECIDER.decide(mission, command, NOW)


def patient() -> TaskContract:
    """The same goal as another version would compile it: one timeout is longer, one stage is called otherwise."""
    go, tell = contract().nodes
    renamed = replace(tell, node_id=NodeId("report"))
    return replace(contract(), nodes=(replace(go, timeout_s=200.0), renamed))


def test_a_compiled_mission_is_pinned_again_with_its_new_contract() -> None:
    decision = again(compiled(), to=patient())
    assert isinstance(decision, Accepted)
    (event,) = decision.events
    assert isinstance(event, ContractRecompiled)
    assert (event.replaces, event.configuration) == (CONFIGURATION, NEWER)
    assert event.contract_digest == digest(patient())
    mission = DECIDER.fold(compiled(), decision.events)
    assert (mission.status, mission.configuration, mission.contract) == ("compiled", NEWER, patient())
    assert mission.policy is not None
    assert mission.policy.wait_s == 33.0
    assert list(mission.nodes) == ["go", "report"]


def test_what_was_approved_for_the_old_contract_is_of_an_older_state() -> None:
    before = compiled()
    decision = again(before)
    assert isinstance(decision, Accepted)
    assert DECIDER.fold(before, decision.events).k == before.k + 1


@pytest.mark.ledger("R163", symbol="harness.gate.pins:recompile")
def test_an_active_mission_is_never_swapped() -> None:
    refused = again(created())
    assert isinstance(refused, Refused)
    assert refused.rule == "pinned"


def test_a_replay_keeps_its_pin() -> None:
    refused = again(compiled(replay=True))
    assert isinstance(refused, Refused)
    assert refused.rule == "pinned"


def test_the_same_version_changes_nothing() -> None:
    assert again(compiled(), under=CONFIGURATION) == Accepted(())


def test_a_mission_is_compiled_again_for_its_own_goal_only() -> None:
    text = "Go somewhere else"
    refused = again(compiled(), to=replace(contract(), goal=Goal(text=text, digest=sha256(text.encode()))))
    assert isinstance(refused, Refused)
    assert refused.rule == "another_goal"


def test_a_mission_begins_after_it_was_compiled_again() -> None:
    mission = after(
        compiled(), RecompileContract(configuration=NEWER, contract=contract(), policy=POLICY), ActivateMission()
    )
    assert (mission.status, mission.configuration) == ("active", NEWER)
