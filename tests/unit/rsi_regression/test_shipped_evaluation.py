"""The evaluated candidate that ships: its bytes, its terms, and the predicate that judges it again today."""

import gzip
from functools import cache
from importlib.resources import files
from pathlib import Path

import msgspec

from app.cli.shipped_candidate import put_in_review
from harness.baseline.load import baseline, earlier
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import Digest, RobotId, sha256
from harness.contracts.values import digest
from harness.runtime import Runtime
from rsi_reviews.acceptance import accepted, predicate_digest
from rsi_reviews.held_out import Looks
from rsi_reviews.regression.cases import cases_of, seeds_digest
from rsi_reviews.regression.suite import shipped
from rsi_reviews.release_service import ReleaseService
from rsi_reviews.shipped_evaluation import SUMS, Shipped, shipped_evaluation
from tests.builders.releases import bench, candidate
from tests.saying import raises_saying


@cache
def one() -> Shipped:
    return shipped_evaluation()


@cache
def allowed() -> Shipped:
    """The same evaluation as if it had been made of a candidate that today's rules let be proposed.

    The shipped one waits 60 s before a person is asked, which is a loosening today. This one waits a second time in
    the place of a step that frees no lease, so a person is asked no later.
    """
    found = one()
    old = found.candidate.configuration
    before = next(known for known in (baseline(), *earlier()) if known.configuration_id == found.candidate.baseline)
    ladders = {**before.recovery.ladders, "resource_conflict": ("wait", "wait", "human")}
    changed = msgspec.structs.replace(before, recovery=msgspec.structs.replace(before.recovery, ladders=ladders))
    made = msgspec.structs.replace(found.candidate, configuration=changed)
    terms = msgspec.structs.replace(found.terms, candidate=made.candidate_id, configuration=changed.configuration_id)
    results = tuple(
        msgspec.structs.replace(result, configuration=changed.configuration_id)
        if result.configuration == old.configuration_id
        else result
        for result in found.results.results
    )
    looks = tuple(
        msgspec.structs.replace(look, candidate=made.candidate_id)
        if look.candidate == found.candidate.candidate_id
        else look
        for look in found.looks
    )
    return msgspec.structs.replace(
        found,
        candidate=made,
        terms=terms,
        results=msgspec.structs.replace(found.results, terms=digest(terms), results=results),
        looks=looks,
    )


def measured_against(runtime: Runtime, robot_id: RobotId) -> Digest:
    """Missions run under the baseline that the candidate was measured against."""
    return one().candidate.manifest.baseline


def test_it_is_about_a_baseline_that_ships_and_the_predicate_of_now() -> None:
    found, cases = one(), (*cases_of(shipped("regression")), *cases_of(shipped("safety")))
    assert found.candidate.baseline in {known.configuration_id for known in (baseline(), *earlier())}
    assert found.terms.candidate == found.candidate.candidate_id
    assert found.terms.predicate == predicate_digest(), "the predicate changed: evaluate the candidate anew"
    assert found.terms.seeds == seeds_digest(tuple(dict.fromkeys(cases)))
    assert len(found.results.results) == 2 * found.terms.cases == 6244
    assert found.results.terms == digest(found.terms)


def test_a_result_that_is_missing_is_no_pass() -> None:
    found = one()
    fewer = msgspec.structs.replace(found.results, results=found.results.results[1:])
    cut = msgspec.structs.replace(found, results=fewer)
    assert accepted(cut.judged_on()).answer == "error"


def test_damaged_bytes_are_refused(tmp_path: Path) -> None:
    place = files("rsi_reviews").joinpath("evaluated")
    name = place.joinpath(SUMS).read_text().split()[-1]
    body = place.joinpath(name).read_bytes()
    (tmp_path / SUMS).write_text(place.joinpath(SUMS).read_text())
    (tmp_path / name).write_bytes(body[:-1])
    with raises_saying(ContractInvalid, match="not those that were kept"):
        shipped_evaluation(tmp_path)
    other = gzip.compress(b"{}")
    (tmp_path / name).write_bytes(other)
    (tmp_path / SUMS).write_text(f"{sha256(other)}  {name}\n")
    with raises_saying(ContractInvalid, match="cannot be read"):
        shipped_evaluation(tmp_path)
    with raises_saying(ContractInvalid, match="No evaluation ships"):
        shipped_evaluation(tmp_path / "nowhere")


def test_a_shipped_candidate_that_would_ask_a_person_later_is_not_put_in_review_any_more(tmp_path: Path) -> None:
    with bench(select=measured_against) as made:
        releases = ReleaseService(made.harness.runtime)
        assert {refusal.rule for refusal in releases.refusals(one().candidate)} == {"asks_later"}
        put_in_review(releases, tmp_path / "evaluator")
        assert releases.reviews() == [] and len(Looks(tmp_path / "evaluator")) == 0


def test_a_new_data_folder_shows_it_in_review_judged_by_the_predicate_of_today(tmp_path: Path) -> None:
    with bench(select=measured_against) as made:
        releases = ReleaseService(made.harness.runtime)
        put_in_review(releases, tmp_path / "evaluator", allowed())
        [review] = releases.reviews()
        assert (review.status, review.cycle, review.candidate) == ("in_review", 1, allowed().candidate.candidate_id)
        assert [clause.answer for clause in releases.clauses(review.candidate)] == [
            "pass",
            "pass",
            "pass",
            "inconclusive",
        ]
        assert any(said.by.reason == allowed().label for said in review.said)
        head = made.harness.runtime.head()
        put_in_review(releases, tmp_path / "evaluator", allowed())
        assert made.harness.runtime.head() == head


def test_where_missions_run_under_another_baseline_its_results_are_not_shown(tmp_path: Path) -> None:
    with bench(select=lambda runtime, robot_id: Digest("0" * 64)) as made:
        put_in_review(ReleaseService(made.harness.runtime), tmp_path / "evaluator")
        assert made.releases.reviews() == []
        assert len(Looks(tmp_path / "evaluator")) == 0


def test_where_anything_was_proposed_before_nothing_is_shown(tmp_path: Path) -> None:
    with bench() as made:
        made.proposed(candidate())
        put_in_review(made.releases, tmp_path)
        assert len(made.releases.reviews()) == 1


def test_the_looks_that_were_taken_for_it_stay_counted(tmp_path: Path) -> None:
    with bench(select=measured_against) as made:
        put_in_review(ReleaseService(made.harness.runtime), tmp_path, allowed())
        taken = {look.look for look in made.releases.pointer().looks}
    made_next = candidate()
    opened = Looks(tmp_path).open(made_next.candidate_id, digest(made_next.manifest))
    assert opened.look == len(one().looks) + 1 > max(taken)
    assert Looks(tmp_path).taken(allowed().candidate.candidate_id) == one().results.held_out
