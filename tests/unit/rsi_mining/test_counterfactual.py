"""Stored decisions derived again under a candidate: the same one differs nowhere, another one where it should."""

from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted
from harness.contracts.errors import UnknownName
from harness.contracts.ids import MissionId, RobotId
from harness.contracts.regularities import HiddenSite, Regularity
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.counterfactual import Counterfactual, MissionCounterfactual, counterfactual
from rsi_reviews.generate.changes import with_items, with_ladder, with_timeout, with_wait, with_weight
from rsi_reviews.generate.trace import MissionTrace, read_trace
from simulator.in_process import SIMULATOR
from tests.saying import raises_saying

H0 = baseline()
ADA = Actor(name="ada", role="operator")
SITE = HiddenSite(
    name="a bend and a slow start",
    regularities=(
        Regularity(name="bend", kind="giving_up", share=1.0, at_m=(4.9, 2.513), provider_id="route-follower"),
        Regularity(name="warm-up", kind="unready", share=1.0, lasts_s=12.0),
    ),
)


@pytest.fixture(scope="module")
def harness() -> Iterator[Harness]:
    """Two circuits: a wait at the start, a retry in vain, then another provider; the second mission knows the first."""
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=5, hidden=SITE) as opened:
        for number in range(2):
            start = Start(actor=ADA, robot_id=RobotId("vbot-1"), template="circuit", seed=50 + number)
            assert isinstance(opened.runtime.start(start), Accepted)
            opened.supervisor.run(opened.runtime.missions()[0].mission_id)
        yield opened


def missions(harness: Harness) -> list[MissionId]:
    return [one.mission_id for one in reversed(harness.runtime.missions())]


def under(harness: Harness, configuration: Configuration) -> tuple[MissionCounterfactual, ...]:
    return counterfactual(harness.runtime, configuration).missions


def kinds(found: MissionCounterfactual) -> set[str]:
    return {one.kind for one in found.differences}


def test_under_the_configuration_they_ran_under_nothing_differs(harness: Harness) -> None:
    found = under(harness, H0)
    assert [(one.differences, one.unreadable) for one in found] == [((), ())] * 2
    derived = [(one.derived["routing"], one.derived["recovery"]) for one in found]
    assert derived == [(4, 3), (2, 1)], "the second mission knows what failed in the first, and recovers from less"
    assert all(one.derived["context"] >= 5 for one in found)


def test_another_ladder_changes_the_first_rung_and_says_what_it_was(harness: Harness) -> None:
    other = with_ladder(H0, "interrupted", ("switch_skill", "human"))
    found = under(harness, other)[0]
    first = next(one for one in found.differences if one.kind == "recovery")
    assert (first.before, first.after) == ("retry by route-follower", "switch_skill by careful-local-planner")
    assert first.node_id == "circuit"
    stored = next(one for one in harness.runtime.events(found.mission_id) if one.position == first.position)
    assert stored.kind.startswith("RecoveryAuthorised")


def test_a_longer_wait_and_a_shorter_timeout_differ_where_they_are_used(harness: Harness) -> None:
    waits = under(harness, with_wait(H0, 40.0))[0].differences
    assert [(one.kind, one.before, one.after) for one in waits] == [("wait", "20 s", "40 s")]
    shorter = with_timeout(H0, template="circuit", node_id="circuit", timeout_s=95.0)
    found = [one for one in under(harness, shorter)[0].differences if one.kind == "timeout"]
    assert [(one.before, one.after) for one in found] == [("180 s", "95 s")] * 3


def test_other_weights_choose_another_provider_only_where_history_speaks(harness: Harness) -> None:
    first, second = under(harness, with_weight(H0, history=0.0))
    routed = [one for one in second.differences if one.kind == "routing"]
    assert [one for one in first.differences if one.kind == "routing"] == []
    assert [(one.before, one.after) for one in routed] == [("careful-local-planner", "route-follower")]
    assert all("routing" not in kinds(one) for one in under(harness, with_weight(H0, history=3.0)))


def test_a_smaller_context_says_which_records_would_be_missing(harness: Harness) -> None:
    narrow = with_items(H0, c1_items=4)
    found = under(harness, narrow)[0]
    shown = [one for one in found.differences if one.kind == "context"]
    assert shown and all(one.before.startswith("planner") and "without" in one.after for one in shown)


def test_a_candidate_starts_nothing_and_writes_nothing(harness: Harness) -> None:
    head, starts = harness.runtime.head(), [harness.starts(one) for one in missions(harness)]
    under(harness, with_ladder(H0, "interrupted", ("human",)))
    assert harness.runtime.head() == head
    assert [harness.starts(one) for one in missions(harness)] == starts


def test_only_the_missions_asked_for_are_looked_at(harness: Harness) -> None:
    only = missions(harness)[1]
    report: Counterfactual = counterfactual(harness.runtime, with_wait(H0, 40.0), [only])
    assert [one.mission_id for one in report.differing] == [only]
    with pytest.raises(UnknownName):
        counterfactual(harness.runtime, H0, [MissionId("mis_none")])


# what a generator reads of the same missions -------------------------------------------------------------------------


def traced(harness: Harness) -> tuple[MissionTrace, ...]:
    return read_trace(harness.runtime, missions(harness)).missions


@pytest.mark.ledger("R155", symbol="rsi_reviews.generate.trace:mission_trace")
def test_a_trace_holds_what_the_mission_recorded_of_failures_rungs_costs_and_providers(harness: Harness) -> None:
    first, second = traced(harness)
    assert [one.failure for one in first.failures] == ["precondition_unmet", "interrupted", "interrupted"]
    assert [(one.action, one.cost, one.came) for one in first.rungs] == [
        ("wait", 0, "failed_otherwise"), ("retry", 1, "failed_again"), ("switch_skill", 1, "committed"),
    ]  # fmt: skip
    walked = [one for one in first.executions if one.node_id == "circuit"]
    assert [(one.provider_id, one.place, one.verdict, one.committed) for one in walked] == [
        ("route-follower", "anchor_a", "violated", False),
        ("route-follower", "anchor_a", "violated", False),
        ("careful-local-planner", "anchor_a", "satisfied", True),
    ]
    assert walked[0].expected_s["careful-local-planner"] > walked[0].expected_s["route-follower"] > 40.0
    assert first.configuration == second.configuration == H0.configuration_id
    assert first.status == "succeeded" and 40.0 < first.seconds < 120.0


def test_positions_in_a_trace_are_those_of_the_log(harness: Harness) -> None:
    second = traced(harness)[1]
    by_position = {one.position: one.kind for one in harness.runtime.log(limit=10_000)}
    assert all(by_position[one.position].startswith("FailureClassified") for one in second.failures)
    assert all(by_position[one.position].startswith("RecoveryAuthorised") for one in second.rungs)


def test_a_trace_says_nothing_of_the_truth_or_of_the_site(harness: Harness) -> None:
    text = repr(traced(harness))
    assert "bend" not in text and "warm-up" not in text and SITE.name not in text


def test_a_mission_that_does_not_exist_is_named(harness: Harness) -> None:
    with raises_saying(UnknownName, match="mis_none"):
        read_trace(harness.runtime, [MissionId("mis_none")])


def test_a_second_configuration_of_the_same_content_is_the_same(harness: Harness) -> None:
    same = replace(H0, recovery=replace(H0.recovery, wait_s=H0.recovery.wait_s))
    assert counterfactual(harness.runtime, same).differing == ()
