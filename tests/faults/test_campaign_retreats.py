"""The adjudicator knows a retreat: a start that was intended as one is no loose start, any other is."""

from collections.abc import Iterator
from dataclasses import replace

import msgspec
import pytest

from experiments.campaigns.adjudicate import judged
from experiments.campaigns.mission import PlayedMission, WatchedStore
from experiments.campaigns.mission_course import MissionCourse
from experiments.campaigns.plan import MissionPlan
from harness.contracts.ports import StoredEvent
from harness.contracts.retreat_events import RETREAT
from tests.builders.retreating import ASKS, LATE_S, heal, retreating_site, sent
from tests.builders.waiting import waiting


@pytest.fixture(scope="module")
def retreated() -> Iterator[PlayedMission]:
    """A mission that nobody answered; its robot went to its safe place."""
    store = WatchedStore()
    with waiting(site=retreating_site(), store=store) as made:
        asked = made.asked(fault=ASKS)
        heal(asked)
        asked.pass_s(LATE_S)
        mission = asked.run()
        assert mission.status == "safe_stopped" and len(sent(asked)) == 1
        yield PlayedMission(
            plan=MissionPlan(seed=3, template="circuit", faults=(ASKS,), disturbances=(), approvals=0),
            mission=mission,
            log=tuple(store.read(limit=100_000)),
            commits=tuple(store.commits),
            truth=tuple(asked.robot.world.truth.records),
            starts=tuple(asked.robot.starts()),
            sent=frozenset(),
            struck={},
            course=MissionCourse(),
            harness=asked.harness,
        )


def test_a_retreat_that_was_intended_is_no_loose_start(retreated: PlayedMission) -> None:
    findings = judged(retreated)
    assert [start.node_id for start in retreated.starts].count(RETREAT) == 1
    assert (findings.breaches, findings.duplicate_starts, findings.unauthorised) == ((), (), ())


def test_a_retreat_whose_intent_is_of_another_request_is_a_loose_start(retreated: PlayedMission) -> None:
    (request,) = {start.request_id for start in retreated.starts if start.node_id == RETREAT}

    def other(event: StoredEvent) -> StoredEvent:
        if event.kind != "RetreatIntended":
            return event
        return msgspec.structs.replace(event, body=event.body.replace(request.encode(), b"0" * len(request)))

    forged = [other(event) for event in retreated.log]
    assert forged != list(retreated.log)
    found = judged(replace(retreated, log=tuple(forged))).breaches
    assert found == ("retreat started without an intent",)
