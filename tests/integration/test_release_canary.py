"""From an authorised candidate to what is current, and back: whole missions in virtual time under the pointer."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.ids import ConditionId, RobotId
from harness.contracts.revision_commands import DisputeCompletion
from harness.contracts.values import digest
from rsi_reviews.contracts import CanaryTest
from tests.builders.releases import (
    LAUNCHER,
    OTHER_REVIEWER,
    RELEASER,
    REVIEWER,
    ROBOT,
    Bench,
    bench,
    candidate,
    expect,
    routed,
    rule_of,
    say,
    tried,
)

MADE = candidate()
H0, H1 = MADE.baseline, MADE.configuration.configuration_id


def pinned(on: Bench, *faults: str) -> str:
    """What a mission that is begun and run now was pinned to."""
    return on.harness.runtime.mission(on.mission(*faults)).configuration


@pytest.mark.ledger("R163", symbol="rsi_reviews.candidate_queries:selected")
def test_new_missions_follow_the_pointer_and_running_ones_keep_their_pin() -> None:
    with bench() as on:
        name = on.authorised(MADE)
        early = on.begun("stale-pose:persistent")
        on.harness.supervisor.run(early)
        assert on.harness.runtime.mission(early).status == "awaiting_human"
        expect(on.releases.release(name, say(RELEASER), on.seen(name), robot_id=ROBOT))
        assert on.harness.runtime.mission(early).configuration == H0
        assert on.releases.current(ROBOT) == H1
        assert on.releases.current(RobotId("another")) == H0
        assert early in on.releases.pins()[H0]


def test_a_mission_that_waits_to_begin_is_compiled_again_under_what_became_current() -> None:
    with bench() as on:
        name = on.authorised(MADE)
        waiting = on.begun()
        expect(on.releases.release(name, say(RELEASER), on.seen(name), robot_id=ROBOT))
        on.harness.supervisor.run(waiting)
        assert on.harness.runtime.mission(waiting).configuration == H1


@pytest.mark.ledger("R159", "R226", symbol="rsi_reviews.release:promote")
def test_five_sound_missions_that_exercised_the_change_make_it_current_everywhere() -> None:
    """The fault strikes whoever drives: one that only some providers meet is routed around after two missions."""
    with bench() as on:
        name = on.in_canary(MADE)
        missions = []
        for number in range(5):
            assert on.releases.current(RobotId("another")) == H0
            missions.append(on.mission("stale-pose"))
            assert on.releases.review(name).status == "canary", number
            expect(on.releases.adjudicate(name, missions[-1], "sound", say(REVIEWER)))
        review, pointer = on.releases.review(name), on.releases.pointer()
        assert review.status == "current" and len(review.exercised) == 5
        assert {on.harness.runtime.mission(mission).configuration for mission in missions} == {H1}
        assert on.releases.current(RobotId("another")) == H1 == pinned(on)
        assert [(move.revision, move.cause) for move in pointer.history] == [
            (0, "shipped"),
            (1, "canary"),
            (2, "released"),
        ]


@pytest.mark.ledger("R160", symbol="rsi_reviews.release:release_clause")
def test_the_fourth_clause_passes_only_with_an_authorised_release() -> None:
    with bench() as on:
        name = on.in_review(MADE)
        answers = {clause.clause: clause.answer for clause in on.releases.clauses(name)}
        assert answers == {
            "contracts_preserved": "pass",
            "checks_not_worse": "pass",
            "metric_better": "pass",
            "release_authorised": "inconclusive",
        }
        assert rule_of(on.releases.release(name, say(RELEASER), on.seen(name), robot_id=ROBOT)) == "not_open"
        expect(on.releases.approve(name, say(REVIEWER), on.seen(name)))
        expect(on.releases.authorise(name, say(RELEASER), on.seen(name)))
        assert on.releases.clauses(name)[3].answer == "pass"
        expect(on.releases.release(name, say(RELEASER), on.seen(name), robot_id=ROBOT))
        expect(on.releases.rollback(name, say(RELEASER, "It circled.")))
        assert on.releases.clauses(name)[3].answer == "fail"


def test_the_canary_runs_one_mission_at_a_time_and_waits_for_its_adjudication() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        first = on.mission("blocked-passage")
        assert pinned(on) == H0
        expect(on.releases.adjudicate(name, first, "sound", say(REVIEWER)))
        assert pinned(on) == H1


def test_whoever_released_it_does_not_adjudicate_its_missions() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        mission = on.mission("blocked-passage")
        releaser = Actor(name=RELEASER.name, role="reviewer")
        assert rule_of(on.releases.adjudicate(name, mission, "sound", say(releaser))) == "own_release"
        expect(on.releases.adjudicate(name, mission, "sound", say(REVIEWER)))
        again = on.releases.adjudicate(name, mission, "false_completion", say(OTHER_REVIEWER))
        assert rule_of(again) == "decided"


@pytest.mark.ledger("R164", symbol="rsi_reviews.pointer_rules:_move")
def test_a_hard_fault_rolls_back_at_once_to_the_version_before_and_quarantines() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        mission = on.mission("blocked-passage")
        expect(on.releases.adjudicate(name, mission, "false_completion", say(REVIEWER, "It stood 3 m off.")))
        review, pointer = on.releases.review(name), on.releases.pointer()
        assert review.status == "rolled_back"
        assert sentence(review.ended_reason) == f"hard fault: false completion in {mission}"
        assert (pointer.configuration, pointer.canary, pointer.revision) == (H0, None, 2)
        assert H1 in pointer.quarantined
        assert pinned(on) == H0


def test_a_disputed_completion_that_the_log_shows_is_a_hard_fault_without_anybody_adjudicating() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        mission_id = on.begun()
        on.harness.supervisor.run(mission_id)
        word = DisputeCompletion(condition_id=ConditionId("circuit.closed"), actor=REVIEWER, reason="It did not close.")
        assert isinstance(on.harness.runtime.submit(mission_id, word), Accepted)
        expect(on.releases.catch_up())
        assert on.releases.review(name).status == "rolled_back"


def test_a_second_start_in_the_robots_own_journal_is_a_hard_fault() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        mission_id = on.begun()
        on.harness.supervisor.run(mission_id)
        expect(on.releases.catch_up(lambda one: int(one == mission_id)))
        assert on.releases.review(name).status == "rolled_back"


def test_a_metric_that_is_worse_than_the_baselines_bound_each_time_rolls_back_by_the_declared_test() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        for number in range(3):
            assert on.releases.review(name).status == "canary", number
            mission = on.mission("blocked-passage:persistent")
            if not on.harness.runtime.mission(mission).ended:
                on.called_off(mission)
            on.releases.adjudicate(name, mission, "sound", say(REVIEWER))
        review = on.releases.review(name)
        assert review.status == "rolled_back", [entry.measured for entry in review.canary]
        assert "recovery cost was worse" in sentence(review.ended_reason)


def test_a_change_that_its_window_of_missions_never_exercised_is_withdrawn_and_not_quarantined() -> None:
    """With a window of 5; the default is 50 (D34)."""
    with bench() as on:
        name = on.in_canary(candidate(canary=CanaryTest(window=5)))
        for _ in range(5):
            assert on.releases.review(name).status == "canary"
            expect(on.releases.adjudicate(name, on.mission(), "sound", say(REVIEWER)))
        review, pointer = on.releases.review(name), on.releases.pointer()
        assert (review.status, pointer.configuration, pointer.canary) == ("withdrawn", H0, None)
        assert H1 not in pointer.quarantined


@pytest.mark.ledger("R164", "R226", symbol="rsi_reviews.pointer_rules:_rolled_back")
def test_rollback_returns_to_the_same_digest_under_a_higher_revision_and_goes_on_back() -> None:
    older = routed()
    h1 = older.configuration.configuration_id
    with bench() as on:
        first = on.current(older)
        newer = routed(0.9, baseline=h1, rollback=h1)
        second = on.current(newer, look=2)
        assert on.releases.pointer().configuration == newer.configuration.configuration_id
        assert rule_of(on.releases.rollback(first, say(RELEASER))) == "not_current"
        expect(on.releases.rollback(second, say(RELEASER, "Too many handoffs.")))
        after = on.releases.pointer()
        assert (after.configuration, after.released, after.revision) == (h1, first, 5)
        expect(on.releases.rollback(first, say(RELEASER, "The same in the older one.")))
        last = on.releases.pointer()
        assert (last.configuration, last.released, last.revision) == (H0, None, 6)
        assert set(last.quarantined) == {h1, newer.configuration.configuration_id}
        assert digest(on.harness.runtime.stored_configuration(H0)) == H0


def test_a_quarantined_configuration_never_comes_again() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        expect(on.releases.rollback(name, say(RELEASER, "It circled.")))
        again = candidate(reason="Surely it works this time.")
        assert rule_of(on.releases.propose(again, say(LAUNCHER))) == "quarantined"


def test_one_candidate_is_in_canary_at_a_time() -> None:
    with bench() as on:
        first, second = on.authorised(MADE), on.authorised(candidate(tried(wait_s=7.0)), look=2)
        expect(on.releases.release(first, say(RELEASER), on.seen(first), robot_id=ROBOT))
        refused = on.releases.release(second, say(RELEASER), on.seen(second), robot_id=ROBOT)
        assert rule_of(refused) == "canary_open"
        assert on.releases.review(second).status == "authorised"


def test_rolling_back_what_is_current_takes_the_canary_on_it_along() -> None:
    older = routed()
    h1 = older.configuration.configuration_id
    with bench() as on:
        first = on.current(older)
        on_top = on.in_canary(routed(0.9, baseline=h1, rollback=h1), look=2)
        expect(on.releases.rollback(first, say(RELEASER, "It circled.")))
        pointer = on.releases.pointer()
        assert (pointer.configuration, pointer.canary, pointer.trial) == (H0, None, None)
        assert on.releases.review(on_top).status == "withdrawn"


def test_a_rollback_pauses_what_runs_under_the_revoked_version_and_swaps_nothing() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        running = on.begun("blocked-passage")
        for _ in range(6):
            on.harness.supervisor.step(running)
        assert on.harness.runtime.mission(running).status == "active"
        expect(on.releases.rollback(name, say(RELEASER, "It circled.")))
        mission = on.harness.runtime.mission(running)
        assert (mission.status, mission.configuration) == ("paused", H1)


def test_what_was_current_at_an_instant_is_answered_from_the_history() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        moves = on.releases.pointer().history
        expect(on.releases.rollback(name, say(RELEASER)))
        shipped_s, canary_s = (move.at_s for move in moves)
        assert on.releases.current_at(shipped_s - 1.0) is None
        assert on.releases.current_at(shipped_s) in (H0,)
        assert on.releases.current_at(canary_s, robot_id=ROBOT) == H1
        assert on.releases.current_at(canary_s) == H0
        assert on.releases.current_at(canary_s + 1e6, robot_id=ROBOT) == H0


@pytest.mark.ledger("R167", symbol="rsi_reviews.projections:apply")
def test_a_revision_keeps_motives_difference_results_decision_and_rollback_record() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        expect(on.releases.rollback(name, say(RELEASER, "It circled.")))
        review = on.releases.review(name)
        assert review.manifest == MADE.manifest and review.evaluation is not None
        assert [change.path for change in on.releases.diff(name).changes]
        assert on.releases.results(name) is not None
        assert [said.what for said in review.said] == [
            "proposed",
            "evaluation_begun",
            "evaluated",
            "review_opened",
            "approved",
            "authorised",
            "canary_begun",
            "rolled_back",
        ]
        assert (review.ended_reason, review.said[-1].by.actor.name) == ("It circled.", RELEASER.name)
        kinds = [event.kind for event in on.releases.events(name)]
        assert kinds[0] == "CandidateProposed" and kinds[-1] == "CandidateRolledBack"


def test_versions_are_active_draining_drained_or_inactive_by_what_runs_under_them() -> None:
    with bench() as on:
        unused = candidate(tried(wait_s=7.0))
        on.proposed(unused)
        name = on.in_canary(MADE)
        held = on.begun("stale-pose:persistent")
        on.harness.supervisor.run(held)
        assert on.releases.versions()[H1] == "active"
        expect(on.releases.rollback(name, say(RELEASER, "It circled.")))
        states = on.releases.versions()
        assert (states[H0], states[H1]) == ("active", "draining")
        assert states[unused.configuration.configuration_id] == "inactive"
        on.called_off(held)
        assert on.releases.versions()[H1] == "drained"


def test_the_shipped_version_is_active_while_nothing_was_ever_proposed() -> None:
    with bench() as on:
        on.begun("stale-pose:persistent")
        assert on.releases.pointer().version == 0
        assert on.releases.versions() == {H0: "active"}


def test_a_version_with_pinned_missions_or_one_that_is_in_use_is_not_retired() -> None:
    with bench() as on:
        name = on.in_canary(MADE)
        held = on.begun("stale-pose:persistent")
        on.harness.supervisor.run(held)
        assert rule_of(on.releases.retire(H1, say(RELEASER))) == "in_use"
        expect(on.releases.rollback(name, say(RELEASER, "It circled.")))
        assert rule_of(on.releases.retire(H1, say(RELEASER))) == "pinned_missions"
        assert rule_of(on.releases.retire(H0, say(RELEASER))) == "in_use"
        on.called_off(held)
        expect(on.releases.retire(H1, say(RELEASER)))
        assert H1 in on.releases.pointer().retired


def test_workers_uptake_is_on_record_once_per_revision() -> None:
    with bench() as on:
        on.in_canary(MADE)
        for _ in range(2):
            expect(on.releases.take_up("worker-1"))
        (uptake,) = on.releases.pointer().uptakes
        assert (uptake.worker, uptake.revision) == ("worker-1", 1)


def test_a_person_approves_each_motion_of_a_canary_mission_and_none_of_the_next_release() -> None:
    with bench(watched=True) as on:
        before = on.harness.runtime.mission(on.mission())
        assert before.status == "succeeded" and not before.trial
        on.in_canary(MADE)
        watched = on.harness.runtime.mission(on.mission())
        assert watched.trial and watched.status == "awaiting_human"
        question = on.harness.runtime.handoffs()[0].opened
        assert question is not None and "is in canary" in sentence(question.reason)
        assert not [start for start in on.harness.starts(watched.mission_id) if start.moves]
