"""Rows of the ledger, proven by one mission that the command line ran: what its roles were shown, and how it ended."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from harness.bootstrap import read_harness
from harness.contracts import events
from harness.contracts.contexts import Context
from harness.contracts.ids import Digest, MissionId
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.projections.mission import eligible
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from tests.integration.runs import regen


@dataclass(frozen=True)
class Inspected:
    """One inspection whose first leg was interrupted once: what the command line printed, and its log."""

    data: Path
    outcome: dict[str, Any]
    events: tuple[Any, ...]
    runtime: Runtime

    def told(self, kind: type[Any]) -> list[Any]:
        return [one for one in self.events if isinstance(one, kind)]

    def context(self, name: Digest) -> Context:
        return decode(self.runtime.record(name).body, Context)


@pytest.fixture(scope="module")
def inspected(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Inspected]:
    data = tmp_path_factory.mktemp("inspected")
    fast = ("--data", data, "--speed", "0", "--fidelity", "kinematic", "--seed", "3", "--json")
    done = regen("mission", "run", "Check the storage area", *fast, "--fault", "interrupted")
    assert done.returncode == 0, done.stderr
    outcome = json.loads(done.stdout)
    with read_harness(HarnessSettings(data_folder=Path(data))) as runtime:
        log = runtime.events(MissionId(outcome["mission_id"]))
        yield Inspected(Path(data), outcome, tuple(DECIDER.codec.decode(one) for one in log), runtime)


@pytest.mark.ledger("R70", entry="command line", symbol="harness.contexts.planner:_failures")
def test_the_planner_was_shown_what_failed_before(inspected: Inspected) -> None:
    plans = {one.node_id: one for one in inspected.told(events.NodePlanned)}
    assert not inspected.context(plans["go"].context).all("failures")
    (coarse,) = inspected.context(plans["panorama"].context).all("failures")
    assert coarse.content == {"node_id": "go", "failures": {"interrupted": 1}}
    shown = {record.kind for plan in plans.values() for record in inspected.context(plan.context).records}
    assert {"goal", "frontier", "facts", "place", "map", "failures"} <= shown


@pytest.mark.ledger("R75", entry="command line", symbol="harness.supervisor.dispatch:_intention")
def test_the_planners_words_reached_the_skill_and_no_verifier(inspected: Inspected) -> None:
    first = [one for one in inspected.told(events.DispatchIntended) if one.action is None]
    assert [one.node_id for one in first] == [one.node_id for one in inspected.told(events.NodePlanned)]
    for one in first:
        (intention,) = inspected.context(one.context).all("intention")
        assert (intention.origin, intention.source) == ("planner", one.node_id)
    judged = [one.verdict.context for one in inspected.told(events.VerdictRecorded)]
    assert judged
    assert not [one for name in judged for one in inspected.context(name).records if one.origin == "planner"]


@pytest.mark.ledger("R136", entry="command line", symbol="harness.projections.mission_fold:apply")
def test_what_may_start_next_was_decided_by_the_missions_own_graph_and_control_state(inspected: Inspected) -> None:
    """Working memory is the fold of the mission's events: each plan is among what it makes eligible at that moment, and
    the planner is shown exactly these."""
    for index, event in enumerate(inspected.events):
        if isinstance(event, events.NodePlanned):
            then = eligible(DECIDER.fold(DECIDER.initial, inspected.events[:index]))
            assert event.node_id in then
            (frontier,) = inspected.context(event.context).all("frontier")
            assert [one["node_id"] for one in frontier.content] == list(then)


@pytest.mark.ledger("R203", entry="command line", symbol="harness.verification.predicates.facing:facing")
def test_the_return_ended_with_a_turn_by_the_lidar_and_a_body_at_rest_before_the_report(inspected: Inspected) -> None:
    verdicts = [one.verdict for one in inspected.told(events.VerdictRecorded)]
    results = {one.condition_id: one for verdict in verdicts for one in verdict.results}
    turned, still, near = (results[f"return.{name}"] for name in ("facing", "static", "arrival"))
    assert {turned.verdict, still.verdict, near.verdict} == {"satisfied"}
    assert turned.sources == ("lidar",) and turned.measured["off_rad"] <= turned.bounds["off_rad"] == 0.1745
    assert near.measured["distance_m"] <= 0.40
    done = [one.node_id for one in inspected.told(events.NodeCommitted)]
    assert done.index("return") < done.index("report")
    played = [one for one in inspected.outcome["receipts"] if one["kind"] == "playback"]
    assert len(played) == 1 and results["report.heard"].verdict == "satisfied"


@pytest.mark.ledger("R63", entry="command line", symbol="harness.routing.explanation:explained")
def test_the_command_line_says_why_a_provider_was_chosen_term_by_term(inspected: Inspected) -> None:
    asked = ("mission", "routing", inspected.outcome["mission_id"], "--data", inspected.data)
    found = json.loads(regen(*asked, "--json").stdout)
    (first, *_) = [one for one in found["decisions"] if one["node_id"] == "go"]
    scored = {one["provider_id"]: one for one in first["candidates"] if one["score"] is not None}
    assert first["chosen"] == max(scored, key=lambda name: scored[name]["score"])
    for one in scored.values():
        assert {"success", "risk", "uncertainty", "latency", "cost", "history"} <= one["terms"].keys()
        assert one["score"] == pytest.approx(sum(one["terms"].values()))
    turned_down = [one for one in first["candidates"] if one["score"] is None]
    assert turned_down and all(one["refused_by"] and one["reason"] for one in turned_down), (
        "who cannot do it is named with the reason"
    )
    text = regen(*asked).stdout
    assert "route-follower" in text and "history" in text
