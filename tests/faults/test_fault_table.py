"""Every cell of the fault table, asserted on events, on physical starts and against the truth."""

import pytest

from harness.contracts.events import DispatchIntended
from tests.builders.missions_run import Ran, ran

TEMPLATES = ("warehouse-inspection", "circuit")
LEG = {"warehouse-inspection": "go", "circuit": "circuit"}


def safe(mission: Ran, fault: str) -> None:
    """What holds in every cell: the fault struck, nothing is false, nothing started twice."""
    struck = mission.harness.robots["vbot-1"].struck()  # type: ignore[index, attr-defined]
    assert struck.get(fault.partition(":")[0], 0) >= 1
    assert mission.false_completions() == []
    assert mission.duplicate_starts() == 0


@pytest.mark.parametrize("template", TEMPLATES)
@pytest.mark.ledger("R39", "R46", symbol="harness.supervisor.recovery:Recovery.answer")
@pytest.mark.parametrize(
    ("fault", "verdict", "actions"),
    [
        ("stale-pose", "stale", ["re_perceive"]),
        ("missing-pose", "ambiguous", ["re_perceive"]),
        ("frozen-localiser", "ambiguous", ["re_perceive"]),
        ("early-success", "violated", ["retry"]),
        ("interrupted", "violated", ["retry"]),
        ("blocked-passage", "violated", ["switch_skill"]),
    ],
)
def test_a_transient_fault_is_recovered_from(template: str, fault: str, verdict: str, actions: list[str]) -> None:
    with ran(template, fault) as mission:
        safe(mission, fault)
        assert mission.verdicts(LEG[template])[0] == verdict
        around = (template, fault) == ("warehouse-inspection", "blocked-passage")
        taken = [
            one.action
            for one in mission.events
            if isinstance(one, DispatchIntended) and one.action and one.node_id == LEG[template]
        ]
        assert taken == (["local_replan"] if around else actions), "the corridor leaves room for a detour"
        assert mission.mission.status == "succeeded"


@pytest.mark.parametrize("template", TEMPLATES)
@pytest.mark.ledger("R132", "R174", symbol="harness.supervisor.handoffs:HandoffService.open")
@pytest.mark.parametrize(
    "fault",
    ["stale-pose", "missing-pose", "frozen-localiser", "early-success", "interrupted", "blocked-passage"],
)
def test_a_persistent_fault_ends_with_a_person_and_without_a_false_completion(template: str, fault: str) -> None:
    with ran(template, f"{fault}:persistent") as mission:
        safe(mission, fault)
        assert mission.mission.status == "awaiting_human"
        assert mission.mission.of(LEG[template]).status == "escalated"  # type: ignore[arg-type]
        assert mission.mission.handoff_id is not None


@pytest.mark.ledger("R81", "R89", symbol="simulator.robot:SimulatedRobot.find")
@pytest.mark.parametrize("fault", ["duplicate-request", "duplicate-request:persistent"])
def test_a_request_that_arrives_twice_starts_once(fault: str) -> None:
    with ran("circuit", fault) as mission:
        safe(mission, fault)
        assert mission.mission.status == "succeeded"
        assert len(mission.harness.starts(mission.mission.mission_id)) == 1
        assert mission.actions == []


@pytest.mark.ask("flotilla#1349")
@pytest.mark.ledger("R18", "R173", symbol="harness.supervisor.dispatch:Dispatcher.blocked")
def test_lost_localisation_refuses_the_dispatch_until_it_is_back() -> None:
    with ran("circuit", "lost-localisation") as mission:
        safe(mission, "lost-localisation")
        assert mission.mission.status == "succeeded"
        assert mission.waits == ["wait"]
        assert mission.mission.spent_total == 0


def test_localisation_that_never_comes_back_asks_a_person() -> None:
    with ran("circuit", "lost-localisation:persistent") as mission:
        safe(mission, "lost-localisation")
        assert mission.mission.status == "awaiting_human"
        assert mission.harness.starts(mission.mission.mission_id) == ()
