"""Disputes: what a person calls false is learnt from no more, and stays readable."""

from harness.contracts.actors import Actor
from harness.contracts.commands import EndMission
from harness.contracts.ids import ConditionId, MissionId, mission_stream, packet_id
from harness.contracts.ports import Batch
from harness.contracts.revision_events import CompletionDisputed, GraphRevised
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Moment
from harness.gate.decide import DECIDER
from tests.builders.gate import CONFIGURATION, GO
from tests.unit.memory.building import LOOK, Log, going_and_looking, intents
from tests.unit.planning.building import card

ADA = Actor(name="ada", role="auditor")


def told(log: Log, mission_id: MissionId, event: CompletionDisputed | GraphRevised) -> None:
    """An event of the mission, as the log holds it."""
    stream = mission_stream(mission_id)
    batch = Batch(stream=stream, expected_version=len(log.store.load(stream)), events=(DECIDER.codec.encode(event),))
    log.store.append([batch], [], Moment(mission_s=log.clock.at_s, wall_s=log.clock.at_s))


def dispute_arrival(log: Log, mission_id: MissionId, *dependents: str) -> None:
    """Ada says that the body was never there."""
    committed = intents(log, mission_id)[0]
    event = CompletionDisputed(
        condition_id=ConditionId("go.again"),
        packet_id=packet_id(committed.invocation_id),
        node_id=GO,
        actor=ADA,
        reason="it stood in the corridor",
        dependents=tuple(ConditionId(name) for name in dependents),
    )
    told(log, mission_id, event)


def learnt(log: Log) -> list[tuple[str, str]]:
    """Kinds and missions of what may still be learnt from."""
    found = log.found("episode", "outcome", "pose", "sighting", standings=("observed", "verified"))
    return [(one.record.kind, one.record.provenance.mission_id) for one in found]


def test_a_disputed_completion_leaves_episodes_outcomes_and_examples() -> None:
    log = Log()
    good, bad = log.begin("msn_good"), log.begin("msn_bad")
    log.went(good)
    log.went(bad)
    log.memory.catch_up()
    dispute_arrival(log, bad)
    assert learnt(log) == [("episode", good), ("outcome", good)]
    asked = {"place": "dock", "configuration": CONFIGURATION, "half_life": 20.0, "limit": 3}
    assert len(log.memory.examples(card("p1"), **asked)) == 1  # type: ignore[arg-type]
    (dispute,) = log.found("dispute")
    assert dispute.record.provenance.sources == ("ada",)
    assert {log.memory.get(name).standing for name in dispute.record.conflicts} == {"disputed"}
    assert len(log.found("episode")) == 2


def test_a_dispute_right_after_the_end_of_its_mission_reaches_what_the_index_has_not_yet() -> None:
    log = Log()
    asked = {"place": "dock", "configuration": CONFIGURATION, "half_life": 20.0}
    log.went(log.begin("msn_good"))
    log.memory.history(card("p1"), **asked)  # type: ignore[arg-type]
    bad = log.begin("msn_bad")
    log.went(bad)
    log.commit(bad, EndMission(status="failed", reason="enough"))
    assert len(log.memory.history(card("p1"), **asked).examples) == 2  # type: ignore[arg-type]
    assert log.index.mark().position < log.store.head().position
    dispute_arrival(log, bad)
    left = log.memory.history(card("p1"), **asked)  # type: ignore[arg-type]
    assert ([one.provenance.mission_id for one in left.examples], left.sums.weight) == (["msn_good"], 1.0)
    assert learnt(log) == [("episode", "msn_good"), ("outcome", "msn_good")]


def test_what_builds_on_a_disputed_fact_is_disputed_with_it() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    dispute_arrival(log, MissionId("msn_a"), "look.seen")
    assert learnt(log) == []
    assert [one.record.subject for one in log.found("dispute")] == ["dispute/msn_a/go.again", "dispute/msn_a/look.seen"]


def test_a_dispute_of_a_second_look_reaches_the_attempt_that_looked_and_the_one_that_acted() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id, "ambiguous")
    log.looked_again(mission_id)
    log.judged(mission_id)
    acted, looked = intents(log, mission_id)
    event = CompletionDisputed(
        condition_id=ConditionId("go.arrival"),
        packet_id=packet_id(looked.invocation_id),
        node_id=GO,
        actor=ADA,
        reason="no",
    )
    told(log, mission_id, event)
    (dispute,) = log.found("dispute")
    subjects = {log.memory.get(name).record.subject for name in dispute.record.conflicts}
    assert {f"attempt/{looked.invocation_id}", f"outcome/{acted.invocation_id}"} <= subjects


def test_a_revised_graph_is_what_later_attempts_are_read_by() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id)
    told(log, mission_id, _revision(going_and_looking(map_version="m2")))
    maps = log.found("map")
    assert [one.standing for one in maps] == ["superseded", "configured"]
    told(log, mission_id, _revision(None))
    assert log.found("map") == maps


def _revision(contract: TaskContract | None) -> GraphRevised:
    return GraphRevised(
        revision=1, cause="planner", responsible=LOOK, reopened=(LOOK,), reason="another way", contract=contract
    )


def test_an_index_that_is_built_anew_knows_what_was_disputed_after_the_end_of_its_mission() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id)
    log.commit(mission_id, EndMission(status="failed", reason="enough"))
    dispute_arrival(log, mission_id)
    assert learnt(log) == []
