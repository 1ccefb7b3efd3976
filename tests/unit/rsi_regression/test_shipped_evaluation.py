"""The evaluated candidate that ships: its bytes, its terms, and the predicate that judges it again today."""

import gzip
from functools import cache
from importlib.resources import files
from pathlib import Path

import msgspec

from app.cli.shipped_candidate import put_in_review
from harness.baseline.load import baseline
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import Digest, RobotId, sha256
from harness.contracts.values import digest
from harness.runtime import Runtime
from rsi_reviews.acceptance import accepted, predicate_digest
from rsi_reviews.held_out import Looks
from rsi_reviews.regression.cases import cases_of, seeds_digest
from rsi_reviews.regression.suite import shipped
from rsi_reviews.release_service import ReleaseService
from rsi_reviews.shipped_evaluation import SUMS, ShippedEvaluation, shipped_evaluation
from tests.builders.releases import bench, candidate
from tests.saying import raises_saying


@cache
def one() -> ShippedEvaluation:
    return shipped_evaluation()


def waiting_longer() -> ShippedEvaluation:
    """The same evaluation as if it were of a candidate that waits 60 s before a person is asked."""
    configuration = one().candidate.configuration
    recovery = msgspec.structs.replace(configuration.recovery, wait_s=60.0)
    changed = msgspec.structs.replace(configuration, recovery=recovery)
    return msgspec.structs.replace(one(), candidate=msgspec.structs.replace(one().candidate, configuration=changed))


def measured_against(runtime: Runtime, robot_id: RobotId) -> Digest:
    """Missions run under the baseline that the candidate was measured against."""
    return one().candidate.manifest.baseline


def test_it_is_about_a_baseline_that_ships_and_the_predicate_of_now() -> None:
    found, cases = one(), (*cases_of(shipped("regression")), *cases_of(shipped("safety")))
    assert found.candidate.baseline == baseline().configuration_id
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
    with raises_saying(ContractInvalid, match="not those that were shipped"):
        shipped_evaluation(tmp_path)
    other = gzip.compress(b"{}")
    (tmp_path / name).write_bytes(other)
    (tmp_path / SUMS).write_text(f"{sha256(other)}  {name}\n")
    with raises_saying(ContractInvalid, match="cannot be read"):
        shipped_evaluation(tmp_path)
    with raises_saying(ContractInvalid, match="No evaluation ships"):
        shipped_evaluation(tmp_path / "nowhere")


def test_a_candidate_that_would_ask_a_person_later_is_not_put_in_review(tmp_path: Path) -> None:
    found = waiting_longer()
    with bench(select=measured_against) as made:
        releases = ReleaseService(made.harness.runtime)
        assert {refusal.rule for refusal in releases.refusals(found.candidate)} == {"asks_later"}
        put_in_review(releases, tmp_path / "evaluator", found)
        assert releases.reviews() == [] and len(Looks(tmp_path / "evaluator")) == 0


def test_a_new_data_folder_shows_it_in_review_judged_by_the_predicate_of_today(tmp_path: Path) -> None:
    with bench(select=measured_against) as made:
        releases = ReleaseService(made.harness.runtime)
        put_in_review(releases, tmp_path / "evaluator")
        [review] = releases.reviews()
        assert (review.status, review.cycle, review.candidate) == ("in_review", 1, one().candidate.candidate_id)
        assert [clause.answer for clause in releases.clauses(review.candidate)] == [
            "pass",
            "pass",
            "pass",
            "inconclusive",
        ]
        assert any(said.by.reason == one().label for said in review.said)
        head = made.harness.runtime.head()
        put_in_review(releases, tmp_path / "evaluator")
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
        put_in_review(ReleaseService(made.harness.runtime), tmp_path)
        taken = {look.look for look in made.releases.pointer().looks}
    made_next = candidate()
    opened = Looks(tmp_path).open(made_next.candidate_id, digest(made_next.manifest))
    assert opened.look == len(one().looks) + 1 > max(taken)
    assert Looks(tmp_path).taken(one().candidate.candidate_id) == one().results.held_out
