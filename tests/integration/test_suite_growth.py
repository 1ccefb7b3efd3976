"""A disputed mission becomes a regression case by a person's hand, once, and its author may not approve on it."""

from msgspec.structs import replace

from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId
from harness.contracts.revision_commands import DisputeCompletion
from rsi_reviews.regression.cases import cases_of
from rsi_reviews.regression.grown_suite import with_growth
from rsi_reviews.regression.suite import shipped
from rsi_reviews.suite_growth import AddedCase, case_of
from rsi_reviews.trial import prepared
from simulator.in_process import SIMULATOR
from tests.builders.releases import REVIEWER, Bench, bench, candidate, expect, rule_of, say

EVE = Actor(name="eve", role="operator")


def disputed(on: Bench, *faults: str) -> MissionId:
    """A mission whose first accepted fact somebody disputes."""
    mission_id = on.mission(*faults)
    fact = on.harness.runtime.mission(mission_id).facts[0]
    asked = DisputeCompletion(condition_id=fact.condition_id, actor=EVE, reason="it stood beside the dock")
    expect(on.harness.runtime.submit(mission_id, asked))
    return mission_id


def test_a_disputed_mission_is_a_case_of_the_suite_once_and_the_suite_lost_none() -> None:
    with bench() as on:
        mission_id = disputed(on, "stale-pose")
        expect(on.releases.add_case(mission_id, say(EVE)))
        assert on.releases.add_case(mission_id, say(EVE)) == Accepted(())
        suite, larger = shipped("regression"), with_growth(shipped("regression"), on.releases.growth())
        added = set(cases_of(larger)) - set(cases_of(suite))
        assert [(one.situation.family, one.situation.faults) for one in added] == [("stale_evidence", ("stale-pose",))]
        assert {one.seed for one in added} == {on.harness.runtime.mission(mission_id).seed}
        assert set(cases_of(suite)) < set(cases_of(larger)) and larger.suite_id != suite.suite_id


def test_what_nobody_disputed_and_what_no_person_asks_for_becomes_no_case() -> None:
    with bench() as on:
        assert rule_of(on.releases.add_case(on.mission(), say(EVE))) == "not_disputed"
        machine = replace(EVE, channel="policy")
        assert rule_of(on.releases.add_case(disputed(on), say(machine))) == "not_a_person"
        assert on.releases.growth().added == ()


def test_a_mission_that_failed_is_a_case_without_a_dispute_and_one_that_was_called_off_is_none() -> None:
    with bench() as on:
        ended = on.harness.runtime.mission(on.mission("blocked-passage:persistent"))
        for status in ("failed", "safe_stopped", "handed_off"):
            case = case_of(replace(ended, status=status))
            assert isinstance(case, AddedCase) and case.faults == ("blocked-passage:persistent",)
        assert rule_of(case_of(replace(ended, status="cancelled"))) == "not_disputed"


def test_who_grew_the_suite_is_an_author_of_what_is_evaluated_on_it() -> None:
    with bench() as on:
        grower = replace(REVIEWER, role="operator+reviewer")
        expect(on.releases.add_case(disputed(on), say(grower)))
        growth, made = on.releases.growth(), candidate()
        suites = (with_growth(shipped("regression"), growth), shipped("safety"))
        baseline = on.harness.runtime.stored_configuration(made.baseline)
        trial = prepared(
            made, baseline, suites, launched_by=("lea",), simulator=SIMULATOR, suite_edited_by=growth.hands
        )
        expect(on.releases.propose(made, say(EVE)))
        expect(on.releases.begin(trial.terms, say(EVE)))
        assert REVIEWER.name in on.releases.review(made.candidate_id).authors
