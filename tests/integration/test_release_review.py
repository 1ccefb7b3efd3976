"""Persons at a candidate: on exactly what they saw, never on their own work, once, and only while it still holds."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.ids import Digest
from harness.contracts.reasons import plain
from rsi_reviews.contracts import Author, ReleasePolicy
from rsi_reviews.release_service import SeenSubject
from tests.builders.releases import (
    LAUNCHER,
    MINER,
    OTHER_REVIEWER,
    RELEASER,
    REVIEWER,
    ROBOT,
    bench,
    candidate,
    evaluation,
    expect,
    routed,
    rule_of,
    say,
    terms_of,
    tried,
)

SINGLE = ReleasePolicy(kind="single_operator", cooling_off_s=3600.0)


def test_an_author_cannot_approve_whatever_their_part() -> None:
    author = Actor(name=LAUNCHER.name, role="reviewer")
    with bench() as on:
        name = on.in_review(candidate())
        refused = on.releases.approve(name, say(author), on.seen(name))
        assert rule_of(refused) == "own_candidate"
        assert isinstance(refused, Refused) and "launched" in plain(refused.reason)
        wrote = candidate(tried(wait_s=9.0), author=Author(name=REVIEWER.name, kind="person"))
        second = on.in_review(wrote, look=2)
        assert rule_of(on.releases.approve(second, say(REVIEWER), on.seen(second))) == "own_candidate"
        expect(on.releases.approve(second, say(OTHER_REVIEWER), on.seen(second)))


def test_neither_a_model_nor_a_policy_nor_another_role_approves() -> None:
    machine = Actor(name=MINER, role="reviewer", channel="policy")
    with bench() as on:
        name = on.in_review(candidate())
        assert rule_of(on.releases.approve(name, say(machine), on.seen(name))) == "not_a_person"
        assert rule_of(on.releases.approve(name, say(RELEASER), on.seen(name))) == "wrong_role"
        assert on.releases.review(name).approvals == ()


def test_a_decision_on_another_digest_or_cycle_than_what_is_asked_is_refused() -> None:
    with bench() as on:
        name = on.in_review(candidate())
        seen = on.seen(name)
        assert (
            rule_of(on.releases.approve(name, say(REVIEWER), SeenSubject(seen.cycle, Digest("0" * 64))))
            == "wrong_digest"
        )
        assert (
            rule_of(on.releases.approve(name, say(REVIEWER), SeenSubject(seen.cycle + 1, seen.subject)))
            == "wrong_cycle"
        )


def test_requested_changes_void_approvals_and_the_question_comes_in_a_new_cycle() -> None:
    with bench() as on:
        name = on.in_review(candidate())
        before = on.seen(name)
        expect(on.releases.approve(name, say(REVIEWER), before))
        expect(on.releases.comment(name, say(OTHER_REVIEWER, "Which missions are these?")))
        expect(on.releases.request_changes(name, say(OTHER_REVIEWER, "Name the missions."), before))
        assert (on.releases.review(name).status, on.releases.review(name).approvals) == ("accepted", ())
        assert rule_of(on.releases.authorise(name, say(RELEASER), before)) == "decided"
        expect(on.releases.submit(name, say(LAUNCHER)))
        assert on.releases.review(name).cycle == before.cycle + 1
        assert rule_of(on.releases.approve(name, say(REVIEWER), before)) == "wrong_cycle"
        assert rule_of(on.releases.authorise(name, say(RELEASER), on.seen(name))) == "no_quorum"
        assert "Which missions are these?" in [said.by.reason for said in on.releases.review(name).said]


def test_its_own_authors_may_recall_it_and_nobody_else() -> None:
    with bench() as on:
        name = on.in_review(candidate())
        assert rule_of(on.releases.recall(name, say(REVIEWER))) == "not_an_author"
        expect(on.releases.recall(name, say(LAUNCHER)))
        assert on.releases.review(name).status == "accepted"


def test_the_same_word_again_is_the_same_receipt_and_another_one_names_who_decided() -> None:
    with bench() as on:
        name = on.in_review(candidate())
        seen = on.seen(name)
        first = on.releases.approve(name, say(REVIEWER, key="once"), seen)
        again = on.releases.approve(name, say(REVIEWER, key="once"), seen)
        assert len(expect(first).events) == 1 and expect(again).events == ()
        assert rule_of(on.releases.reject(name, say(REVIEWER, key="once"), seen)) == "key_reused"
        expect(on.releases.reject(name, say(OTHER_REVIEWER, "It helps in one corner only."), seen))
        refused = on.releases.authorise(name, say(RELEASER), seen)
        assert rule_of(refused) == "decided"
        assert isinstance(refused, Refused) and refused.reason.code == "candidate_decided"
        message = sentence(refused.reason)
        assert "ria" in message and "one corner only" in message and "UTC" in message


def test_a_receipt_stays_a_receipt_after_everything_moved_on() -> None:
    """The release itself, asked twice: the pointer moved once, and the second answer is no refusal."""
    with bench() as on:
        name = on.authorised(candidate())
        seen, word = on.seen(name), say(RELEASER, key="go")
        expect(on.releases.release(name, word, seen, robot_id=ROBOT))
        assert expect(on.releases.release(name, word, seen, robot_id=ROBOT)).events == ()
        assert on.releases.pointer().revision == 1
        assert rule_of(on.releases.release(name, say(RELEASER), seen, robot_id=ROBOT)) == "decided"


def test_a_stale_baseline_cannot_be_submitted_approved_authorised_or_released() -> None:
    """Another candidate became current meanwhile; nothing is rebased."""
    with bench() as on:
        other, reviewed, approved, ready = (candidate(tried(wait_s=float(number))) for number in (5, 6, 7, 8))
        waiting = on.evaluated(other, look=1)
        asked = on.in_review(reviewed, look=2)
        agreed = on.in_review(approved, look=3)
        expect(on.releases.approve(agreed, say(REVIEWER), on.seen(agreed)))
        late = on.authorised(ready, look=4)
        on.current(routed(), look=5)
        assert rule_of(on.releases.submit(waiting, say(LAUNCHER))) == "stale_baseline"
        assert rule_of(on.releases.approve(asked, say(REVIEWER), on.seen(asked))) == "stale_baseline"
        assert rule_of(on.releases.authorise(agreed, say(RELEASER), on.seen(agreed))) == "stale_baseline"
        assert rule_of(on.releases.release(late, say(RELEASER), on.seen(late), robot_id=ROBOT)) == "stale_baseline"


@pytest.mark.parametrize("author", [Author(name=MINER, kind="optimiser"), Author(name="maintainers", kind="person")])
def test_one_person_with_an_optimiser_or_with_a_name_in_a_manifest_is_still_one_person(author: Author) -> None:
    alone = Actor(name="solo", role="reviewer+releaser")
    with bench() as on:
        made = candidate(author=author)
        name = made.candidate_id
        machine = Actor(name=MINER, role="optimiser", channel="policy")
        expect(on.releases.propose(made, say(machine)))
        terms = terms_of(made, launched_by=(MINER,))
        expect(on.releases.begin(terms, say(machine)))
        expect(on.releases.submit_results(evaluation(made, terms=terms), say(machine)))
        expect(on.releases.submit(name, say(machine)))
        expect(on.releases.approve(name, say(alone), on.seen(name)))
        assert rule_of(on.releases.authorise(name, say(alone), on.seen(name))) == "one_person"
        expect(on.releases.authorise(name, say(RELEASER), on.seen(name)))


def test_a_single_operator_decides_alone_only_under_a_policy_that_says_so_and_after_its_time() -> None:
    alone = Actor(name=LAUNCHER.name, role="reviewer+releaser")
    with bench() as on:
        short = ReleasePolicy(kind="single_operator", cooling_off_s=0.001)
        expect(on.releases.save_policy(SINGLE, say(alone), reviewers=("lea",), releasers=("lea",)))
        name = on.in_review(candidate())
        assert rule_of(on.releases.approve(name, say(alone), on.seen(name))) == "cooling_off"
        expect(on.releases.save_policy(short, say(alone), reviewers=("lea",), releasers=("lea",)))
        on.mission()
        expect(on.releases.approve(name, say(alone), on.seen(name)))
        expect(on.releases.authorise(name, say(alone), on.seen(name)))
        review = on.releases.review(name)
        assert review.approvals[0].override and review.authorised is not None and review.authorised.by.override


def test_an_own_approval_under_a_single_operator_policy_counts_for_nothing_once_two_are_needed() -> None:
    alone = Actor(name=LAUNCHER.name, role="reviewer+releaser")
    with bench() as on:
        short = ReleasePolicy(kind="single_operator", cooling_off_s=0.001)
        expect(on.releases.save_policy(short, say(alone), reviewers=("lea",), releasers=("lea",)))
        name = on.in_review(candidate())
        on.mission()
        expect(on.releases.approve(name, say(alone), on.seen(name)))
        expect(on.releases.save_policy(ReleasePolicy(), say(alone), reviewers=("rob",), releasers=("sam",)))
        assert rule_of(on.releases.authorise(name, say(RELEASER), on.seen(name))) == "no_quorum"


def test_a_policy_that_nobody_could_meet_is_refused_when_it_is_saved() -> None:
    with bench() as on:
        save = on.releases.save_policy
        three = ReleasePolicy(quorum=3)
        assert rule_of(save(three, say(LAUNCHER), reviewers=("a", "b"), releasers=("c",))) == "nobody_could"
        assert rule_of(save(ReleasePolicy(), say(LAUNCHER), reviewers=("a",), releasers=())) == "nobody_could"
        assert rule_of(save(ReleasePolicy(), say(LAUNCHER), reviewers=("a",), releasers=("a",))) == "nobody_could"
        assert rule_of(save(ReleasePolicy(quorum=0), say(LAUNCHER), reviewers=("a",), releasers=("b",))) == "quorum"
        hasty = ReleasePolicy(kind="single_operator")
        assert rule_of(save(hasty, say(LAUNCHER), reviewers=("a",), releasers=("a",))) == "cooling_off"
        expect(save(ReleasePolicy(quorum=2), say(LAUNCHER), reviewers=("a", "b"), releasers=("c",)))


def test_two_approvals_are_two_people() -> None:
    with bench() as on:
        policy = ReleasePolicy(quorum=2)
        expect(on.releases.save_policy(policy, say(LAUNCHER), reviewers=("rob", "ria"), releasers=("sam",)))
        name = on.in_review(candidate())
        expect(on.releases.approve(name, say(REVIEWER), on.seen(name)))
        assert rule_of(on.releases.approve(name, say(REVIEWER), on.seen(name))) == "approved_already"
        assert rule_of(on.releases.authorise(name, say(RELEASER), on.seen(name))) == "no_quorum"
        expect(on.releases.approve(name, say(OTHER_REVIEWER), on.seen(name)))
        expect(on.releases.authorise(name, say(RELEASER), on.seen(name)))


def test_an_authorisation_that_expired_has_to_be_asked_for_again() -> None:
    with bench() as on:
        policy = ReleasePolicy(authorisation_s=0.001)
        expect(on.releases.save_policy(policy, say(LAUNCHER), reviewers=("rob",), releasers=("sam",)))
        name = on.authorised(candidate())
        on.mission()
        refused = on.releases.release(name, say(RELEASER), on.seen(name), robot_id=ROBOT)
        assert rule_of(refused) == "decided"
        assert (on.releases.review(name).status, on.releases.pointer().revision) == ("accepted", 0)
        assert on.releases.clauses(name)[3].answer == "inconclusive"
