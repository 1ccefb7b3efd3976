"""A context that cannot hold what it must show ends in a person's hands or in a stop, never in a broken step."""

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.auditing.replay import replay_mission
from harness.baseline.load import baseline
from harness.bootstrap import simulated
from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContextOverflow
from harness.contracts.ids import NodeId
from harness.projections.mission import Mission
from harness.settings import HarnessSettings
from harness.verification.finding import UNAVAILABLE
from simulator.in_process import SIMULATOR
from tests.builders.missions_run import begin


def narrow(**items: int) -> Configuration:
    return replace(baseline(), context_rules=replace(baseline().context_rules, **items))


def run(configuration: Configuration, *faults: str) -> Mission:
    """A circuit under it, in virtual time, with its audit replay."""
    with simulated(
        HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3, configuration=configuration
    ) as harness:
        mission = harness.supervisor.run(begin(harness, "circuit", *faults))
        assert replay_mission(harness.runtime, mission.mission_id).differences == ()
        return mission


@pytest.mark.ledger("R45", symbol="harness.supervisor.verification:judgement")
def test_more_attempts_than_c3_holds_are_ambiguous_and_a_person_is_asked() -> None:
    mission = run(narrow(c3_items=6))
    request = mission.nodes[NodeId("request")]
    assert mission.status == "awaiting_human"
    assert request.verdicts[0].verifier != UNAVAILABLE
    assert [(one.verdict, one.verifier) for one in request.verdicts[1:]] == [("ambiguous", UNAVAILABLE)] * 2
    assert "8 mandatory records do not fit the verifier's budget of 6" in sentence(request.verdicts[-1].reason)
    assert request.failures[-1].failure == "verifier_unavailable"
    assert len(request.packets) == len(request.verdicts)
    assert not mission.facts


def test_a_packet_that_c3_cannot_hold_even_alone_is_no_acceptance() -> None:
    mission = run(narrow(c3_items=2))
    assert mission.status in ("awaiting_human", "failed", "safe_stopped")
    assert not mission.facts
    assert any(
        "do not fit the verifier's budget" in sentence(one.reason) for one in mission.nodes[NodeId("request")].failures
    )


@pytest.mark.parametrize("budget", [{"c1_items": 1}, {"c4_items": 4}])
def test_a_role_that_cannot_be_shown_what_it_must_stops_the_mission_and_says_so(budget: dict[str, int]) -> None:
    mission = run(narrow(**budget), "early-success")
    assert mission.status == "cancelled"
    assert "mandatory records do not fit" in sentence(mission.reason)
    assert ContextOverflow.code not in sentence(mission.reason)
