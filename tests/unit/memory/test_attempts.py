"""Episodic and operational memory: what was verified about an attempt, credited to whoever acted."""

import pytest
from msgspec.structs import replace

from harness.contracts.commands import EndInvocation, RaiseVeto, StopInvocation
from harness.contracts.ids import Digest
from harness.contracts.memory import Episode, MemoryQuery, ProviderOutcome
from harness.contracts.verdicts import ConditionResult, NodeVerdict
from harness.memory.attempts import residual
from tests.builders.gate import CONFIGURATION, GO
from tests.unit.memory.building import LOOK, Log, intents
from tests.unit.planning.building import card


def outcomes(log: Log, **changes: object) -> list[ProviderOutcome]:
    """What operational memory holds now, oldest first."""
    found = [one.record.knowledge for one in log.found("outcome", standings=("verified",), **changes)]
    assert all(isinstance(one, ProviderOutcome) for one in found)
    return found  # type: ignore[return-value]


def episodes(log: Log) -> list[Episode]:
    found = [one.record.knowledge for one in log.found("episode")]
    return [one for one in found if isinstance(one, Episode)]


@pytest.mark.ledger("R138", symbol="harness.projections.memory:judgement")
def test_a_committed_attempt_and_a_refuted_one_become_episodes() -> None:
    log = Log()
    mission_id = log.begin()
    log.dispatched(mission_id)
    log.judged(mission_id, "violated", distance_m=2.0, terminal="failed", failure="interrupted")
    log.retried(mission_id)
    log.judged(mission_id)
    assert [(one.attempt, one.verdict, one.committed, one.action) for one in episodes(log)] == [
        (1, "violated", False, None),
        (2, "satisfied", True, "retry"),
    ]
    assert [one.provider_id for one in episodes(log)] == ["p1", "p1"]
    assert episodes(log)[0].duration_s == 10.0


@pytest.mark.ledger("R138", symbol="harness.memory.attempts:episodic")
@pytest.mark.parametrize("word", ["ambiguous", "stale"])
def test_an_attempt_that_nobody_could_decide_is_no_episode_and_no_outcome(word: str) -> None:
    log = Log()
    undecided, decided = log.begin("msn_a"), log.begin("msn_b")
    log.went(undecided, word)  # type: ignore[arg-type]
    log.went(decided)
    assert [one.record.provenance.mission_id for one in log.found("episode", "outcome")] == [decided, decided]


@pytest.mark.parametrize(
    "change",
    [{"k_ctx": 99}, {"identity": {"attempt": 7}}, {"configuration": Digest("9" * 64)}, {"terminal": "failed"}],
    ids=["version", "identity", "configuration", "execution"],
)
def test_a_satisfied_verdict_that_the_gate_refused_teaches_nothing(change: dict[str, object]) -> None:
    log = Log()
    mission_id = log.begin()
    log.dispatched(mission_id)
    assert log.judged(mission_id, **change).of(GO).status != "committed"  # type: ignore[arg-type]
    assert log.found("episode", "outcome") == []


def test_a_vetoed_result_teaches_nothing() -> None:
    log = Log()
    mission_id = log.begin()
    log.dispatched(mission_id)
    log.commit(mission_id, RaiseVeto(layer="base", reason="bumper"))
    log.judged(mission_id)
    assert log.found("episode", "outcome") == []


@pytest.mark.ledger("R60", symbol="harness.projections.memory:judgement")
def test_a_providers_own_word_for_its_end_is_no_outcome() -> None:
    log = Log()
    gone, told = log.begin("msn_a"), log.begin("msn_b")
    mission = log.dispatched(gone)
    assert mission.invocation is not None
    ended = EndInvocation(
        invocation_id=mission.invocation.intent.invocation_id,
        status="failed",
        failure="motor",
        reason="it says so",
        at_s=log.clock.at_s,
    )
    log.commit(gone, ended)
    log.dispatched(told)
    log.judged(told, "violated", declared={"distance_m": 0.0})
    assert [(one.verdict, one.residual) for one in outcomes(log)] == [("violated", 0.25)]


@pytest.mark.ledger("R60", symbol="harness.memory.attempts:residual")
def test_a_residual_is_the_share_of_the_bound_by_which_the_effect_was_missed() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id, distance_m=0.3)
    assert [one.residual for one in outcomes(log)] == [pytest.approx(0.75)]


def judged_as(**measured: tuple[float, float]) -> NodeVerdict:
    """A verdict over one condition whose values stand beside their bounds."""
    values = {name: value for name, (value, _) in measured.items()}
    bounds = {name: bound for name, (_, bound) in measured.items()}
    result = ConditionResult(
        condition_id=GO,
        text="x",
        verdict="satisfied",
        reason="",
        measured=values,
        bounds=bounds,  # type: ignore[arg-type]
    )
    log = Log()
    mission = log.went(log.begin())
    return replace(mission.of(GO).verdicts[0], results=(result,))


def test_a_residual_is_the_worst_of_the_effects_and_never_above_one() -> None:
    assert residual(judged_as(distance_m=(0.1, 0.4), displacement_m=(0.015, 0.02))) == pytest.approx(0.75)
    assert residual(judged_as(progress=(0.98, 0.95))) == pytest.approx(0.4)
    assert residual(judged_as(distance_m=(2.0, 0.4))) == 1.0
    assert residual(judged_as(progress=(1.01, 0.95))) == 0.0
    assert residual(judged_as(pose_age_s=(0.9, 1.0), samples=(3.0, 3.0))) == 0.0


@pytest.mark.ledger("R139", symbol="harness.memory.attempts:operational")
def test_outcomes_are_kept_by_provider_capability_place_and_configuration() -> None:
    log = Log()
    other = Digest("b" * 64)
    log.went(log.begin("msn_a"), "violated", distance_m=1.0)
    log.went(log.begin("msn_b"), provider="p2")
    log.went(log.begin("msn_c", configuration=other))
    log.sighted("msn_d", blocked=1.0, provider="eye")
    assert [(one.provider_id, one.capability, one.place, one.configuration, one.verdict) for one in outcomes(log)] == [
        ("p1", "navigate", "dock", CONFIGURATION, "violated"),
        ("p2", "navigate", "dock", CONFIGURATION, "satisfied"),
        ("p1", "navigate", "dock", other, "satisfied"),
        ("p1", "navigate", "dock", CONFIGURATION, "satisfied"),
        ("eye", "analyse_passage", "dock", CONFIGURATION, "satisfied"),
    ]
    asked = {"capability": "navigate", "place": "dock", "configuration": CONFIGURATION}
    assert [one.verdict for one in outcomes(log, provider_id="p1", **asked)] == ["violated", "satisfied"]
    assert outcomes(log, provider_id="p1", **(asked | {"place": "elsewhere"})) == []


def test_a_second_look_decides_about_the_provider_that_acted_not_about_the_observer() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id, "ambiguous")
    assert outcomes(log) == []
    log.looked_again(mission_id)
    log.judged(mission_id)
    (outcome,) = outcomes(log)
    assert (outcome.provider_id, outcome.capability, outcome.verdict) == ("p1", "navigate", "satisfied")
    assert outcome.duration_s == 10.0
    assert [one.provider_id for one in episodes(log)] == ["observer"]


def test_a_second_look_at_a_refuted_attempt_replaces_the_first_word_and_does_not_count_twice() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id, "violated", distance_m=1.0)
    log.memory.catch_up()
    log.looked_again(mission_id)
    log.judged(mission_id, "violated", distance_m=1.0)
    assert len(outcomes(log)) == 1
    first, second = log.found("outcome")
    assert (first.standing, second.standing) == ("superseded", "verified")
    assert second.record.supersedes == (first.record.record_id,)
    acted, _ = intents(log, mission_id)
    assert second.record.subject == f"outcome/{acted.invocation_id}"


def test_an_execution_that_was_stopped_says_nothing_about_its_provider_unless_it_was_late() -> None:
    log = Log()
    for name, failure in (("msn_a", "stopped"), ("msn_b", "timeout")):
        mission_id = log.begin(name)
        mission = log.dispatched(mission_id)
        assert mission.invocation is not None
        stop = StopInvocation(invocation_id=mission.invocation.intent.invocation_id, reason=failure)
        log.commit(mission_id, stop)
        log.judged(mission_id, "violated", distance_m=3.0, terminal="cancelled", failure=failure)
    assert [one.record.provenance.mission_id for one in log.found("outcome")] == ["msn_b"]
    assert len(episodes(log)) == 2


@pytest.mark.ledger("R139", symbol="harness.memory.fabric:MemoryFabric.examples")
def test_examples_for_c2_are_the_newest_verified_successes_of_the_same_setting() -> None:
    log = Log()
    for index in range(5):
        log.went(log.begin(f"msn_{index}"), distance_m=index / 20)
    log.went(log.begin("msn_bad"), "violated", distance_m=2.0)
    log.went(log.begin("msn_other"), provider="p2")
    able = card("p1")
    examples = log.memory.examples(able, place="dock", configuration=CONFIGURATION, half_life=20.0, limit=3)
    assert [one.content["measured"]["distance_m"] for one in examples] == [0.2, 0.15, 0.1]
    assert {(one.kind, one.origin, one.confidence) for one in examples} == {("example", "verifier", 0.9)}
    assert log.memory.examples(able, place="elsewhere", configuration=CONFIGURATION, half_life=20.0, limit=3) == ()
    assert log.memory.examples(able, place="dock", configuration=CONFIGURATION, half_life=20.0, limit=0) == ()


@pytest.mark.ledger("R139", symbol="harness.memory.fabric:MemoryFabric.outcomes")
def test_history_for_routing_is_the_newest_outcomes_oldest_first() -> None:
    log = Log()
    for name, word in (("a", "violated"), ("b", "satisfied"), ("c", "satisfied"), ("d", "violated")):
        log.went(log.begin(name), word)  # type: ignore[arg-type]
    asked = {"capability": "navigate", "place": "dock", "configuration": CONFIGURATION}
    newest = log.memory.outcomes(card("p1").provider_id, limit=3, **asked)  # type: ignore[arg-type]
    assert [one.provenance.mission_id for one in newest] == ["b", "c", "d"]


def test_a_node_without_a_target_works_where_what_it_builds_on_ended() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    assert [(one.node_id, one.place) for one in episodes(log)] == [(GO, "dock"), (LOOK, "dock")]
    assert len(log.memory.find(MemoryQuery(kinds=("episode",), place="dock"))) == 2
    assert log.memory.find(MemoryQuery(kinds=("episode",), place="")) == []
