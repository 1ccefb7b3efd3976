"""Evaluation as a job of the running console: queue, progress, cancel, and what a restart finds."""

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from pydantic import SecretStr

from app.background.evaluation_jobs import EvaluationJobs
from app.background.signals import SignalBroker
from app.main import create_app
from app.scene.port import NoSceneViews
from app.settings import ConsoleSettings
from harness.bootstrap import Harness, simulated
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.contracts import Candidate
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.evaluation_jobs import EvaluationJob
from rsi_reviews.regression.cases import CaseGroup, Situation, Suite
from rsi_reviews.release_service import ReleaseService
from simulator.in_process import SIMULATOR
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import OWNER, Stand
from tests.builders.releases import LAUNCHER, candidate, expect, routed, say

FIRST, SECOND = candidate(), routed()
FEW = 4
WITHIN_S = 60.0


def suite(name: str, seeds: int) -> Suite:
    situation = Situation(family="nominal", template="circuit")
    return Suite(name=name, version=1, groups=(CaseGroup(situation=situation, first_seed=1, seeds=seeds),))


def always(count: int) -> bytes:
    """A secret that is the same in every test."""
    return b"s" * count


class Evaluator:
    """A harness with two candidates on record, and the jobs of its console on suites of a few circuits."""

    def __init__(self, harness: Harness, folder: Path) -> None:
        self.harness, self.folder = harness, folder
        self.releases = ReleaseService(harness.runtime)
        for made in (FIRST, SECOND):
            expect(self.releases.propose(made, say(LAUNCHER)))
        self.jobs = self.opened()

    def opened(self) -> EvaluationJobs:
        """What a console that starts on this folder has."""
        return EvaluationJobs(
            self.harness.runtime,
            self.folder,
            SIMULATOR,
            clock=time.time,
            now_s=time.monotonic,
            fresh=always,
            processes=0,
            suites=lambda: (suite("regression", FEW), suite("safety", FEW)),
        )

    def job(self, made: Candidate = FIRST) -> EvaluationJob:
        found = self.jobs.newest(made.candidate_id)
        assert found is not None
        return found

    def until(self, *statuses: str, done: int = 0, made: Candidate = FIRST) -> EvaluationJob:
        """Step the queue until the job is there."""
        end_s = time.monotonic() + WITHIN_S
        while time.monotonic() < end_s:
            self.jobs.step()
            job = self.job(made)
            if job.status in statuses and job.done >= done:
                return job
            time.sleep(0.02)
        raise AssertionError(self.job(made))

    def client(self) -> TestClient:
        settings = ConsoleSettings(port=8000, owner_token=SecretStr(OWNER), password_memory_kib=19456)
        app = create_app(
            self.harness.runtime,
            settings,
            SignalBroker(),
            NoSceneViews(),
            accounts=quick_accounts(settings),
            evaluations=self.jobs,
        )
        return Stand(self.harness, app).operator()


@contextmanager
def evaluator(folder: Path) -> Iterator[Evaluator]:
    settings = HarnessSettings(fidelity="kinematic", speed=0)
    with simulated(settings, simulator=SIMULATOR, seed=3, deciders=DECIDERS, select=selected) as harness:
        made = Evaluator(harness, folder)
        try:
            yield made
        finally:
            made.jobs.close()


@pytest.fixture
def made(tmp_path: Path) -> Iterator[Evaluator]:
    with evaluator(tmp_path / "evaluator") as found:
        yield found


def test_two_evaluations_asked_for_on_the_pages_outlive_the_console_and_run_one_after_the_other(
    made: Evaluator,
) -> None:
    operator = made.client()
    page = operator.get(f"/candidates/{FIRST.candidate_id}").text
    assert re.search(rf"{2 * FEW} to run,\s+in simulation", page) and "Start the evaluation" in page
    for one in (FIRST, SECOND):
        answer = operator.post(f"/candidates/{one.candidate_id}/evaluate", data={})
        assert answer.status_code == 303, answer.text
    assert "evaluations before it: 1" in operator.get(f"/candidates/{SECOND.candidate_id}/evaluation").text
    asked = made.until("running", done=1)
    assert made.job(SECOND).status == "queued"
    assert f"of {2 * FEW} missions," in operator.get(f"/candidates/{FIRST.candidate_id}/evaluation").text

    made.jobs.close()
    made.jobs = made.opened()
    operator = made.client()
    assert (made.job().job_id, made.job().status) == (asked.job_id, "running")
    first = made.until("done")
    assert (first.done, first.of) == (2 * FEW, 2 * FEW) and first.kept > 0
    review = made.releases.review(FIRST.candidate_id)
    assert review.evaluation is not None and review.evaluation.answer == first.answer
    assert review.terms is not None and review.terms.launched_by == ("operator",)
    again = operator.post(f"/candidates/{FIRST.candidate_id}/evaluate", data={})
    assert again.status_code == 409, "it has its answer"

    made.until("running", done=1, made=SECOND)
    assert operator.post(f"/candidates/{SECOND.candidate_id}/cancel-evaluation", data={}).status_code == 303
    assert made.job(SECOND).status == "cancelled"
    page = operator.get(f"/candidates/{SECOND.candidate_id}").text
    assert "Go on with the evaluation" in page and "The evaluation was cancelled" in page
    assert "evaluation cancelled" in page and made.releases.review(SECOND.candidate_id).status == "evaluating"
    assert "evaluation cancelled" in operator.get("/candidates?status=draft").text
    assert "evaluate: begin" not in page
    assert str(SECOND.candidate_id) not in operator.get("/candidates?status=evaluating").text
    assert "Status of the candidate: evaluation cancelled" in page and "candidate: evaluating" not in page
    assert "Under evaluation" not in page
    sides = operator.get(f"/candidates/compare?a={SECOND.candidate_id}&b={FIRST.candidate_id}").text
    assert "evaluation cancelled" in sides and not re.search(r">\s*evaluating\s*<", sides)
    assert 0 < made.jobs.cost(SECOND.candidate_id, by="lea").kept < 2 * FEW


def test_the_api_says_how_far_it_is_and_cancels_what_waits(made: Evaluator) -> None:
    operator = made.client()
    path = f"/api/v1/candidates/{FIRST.candidate_id}"
    before = operator.get(f"{path}/evaluation").json()
    assert before["job"] is None and before["cost"]["missions"] == 2 * FEW
    asked = operator.post(f"{path}/evaluate", json={}).json()
    assert (asked["job"]["status"], asked["job"]["by"]["name"]) == ("queued", "operator")
    assert operator.post(f"{path}/evaluate", json={"processes": 900}).status_code == 422
    cancelled = operator.post(f"{path}/cancel-evaluation", json={}).json()
    assert cancelled["job"]["status"] == "cancelled"
    nothing = operator.post(f"{path}/cancel-evaluation", json={})
    assert (nothing.status_code, nothing.json()["rule"]) == (409, "no_evaluation_open")
