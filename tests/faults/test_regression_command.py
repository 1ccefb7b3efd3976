"""`regen rsi evaluate` from a terminal: a quick look, a run broken off, and what the desk makes of a whole one."""

import json
import signal
import socket
import subprocess
import sys
import time
from http.server import BaseHTTPRequestHandler, HTTPServer
from importlib import import_module
from pathlib import Path
from threading import Thread

import pytest
from msgspec import json as msgspec_json
from typer.testing import CliRunner, Result

from app.cli.main import app
from app.cli.rsi_evaluate import executor
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import HarnessError
from rsi_reviews.held_out import Looks, Secret
from rsi_reviews.regression.executors import Here, Processes
from rsi_reviews.release_service import ReleaseService
from rsi_reviews.trial import HeldOut, Means, Trial, carried_out, judged_on, prepared
from simulator.in_process import SIMULATOR
from tests.builders.evaluations import BASELINE, Saying, candidate, suite, waiting_again
from tests.builders.releases import LAUNCHER, bench, say
from tests.saying import raises_saying
from tests.saying import said as said_by


@pytest.fixture
def proposed(tmp_path: Path) -> Path:
    """A data folder in which a candidate was proposed."""
    made, data = candidate(waiting_again()), tmp_path / "var"
    (tmp_path / "c.json").write_bytes(msgspec_json.encode(made.configuration))
    (tmp_path / "m.json").write_bytes(msgspec_json.encode(made.manifest))
    files = ["--file", str(tmp_path / "c.json"), "--manifest", str(tmp_path / "m.json")]
    assert said("propose", *files, data=data).exit_code == 0
    return data


def said(*words: str, data: Path) -> Result:
    return CliRunner().invoke(app, ["rsi", *words, "--data", str(data), "--json"])


def status(data: Path) -> str:
    (only,) = json.loads(said("list", data=data).stdout)["candidates"]
    return str(only["status"])


def test_a_quick_look_runs_real_missions_and_decides_nothing(proposed: Path) -> None:
    answered = said(
        "evaluate", candidate(waiting_again()).candidate_id[:12], "--cases", "3", "--processes", "0", data=proposed
    )
    report = json.loads(answered.stdout)
    assert (answered.exit_code, report["answer"], report["recorded"], report["results"]) == (
        1,
        "inconclusive",
        False,
        12,
    )
    assert [clause["clause"] for clause in report["clauses"]] == [
        "contracts_preserved",
        "checks_not_worse",
        "metric_better",
    ]
    assert report["held_out"] is None
    assert status(proposed) == "draft"


def listening() -> None:
    """A shell's background job ignores Ctrl-C; a person's terminal does not."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_a_run_that_is_broken_off_keeps_what_is_finished(proposed: Path) -> None:
    words = [
        sys.executable,
        "-m",
        "app.cli.main",
        "rsi",
        "evaluate",
        candidate(waiting_again()).candidate_id[:12],
        "--data",
        str(proposed),
    ]
    run = subprocess.Popen(
        [*words, "--processes", "1", "--cases", "400"], stderr=subprocess.PIPE, text=True, preexec_fn=listening
    )
    folder = proposed.with_name("var-evaluator")
    for _ in range(1500):
        if run.poll() is not None or any(path.read_bytes().count(b"\n") > 8 for path in folder.glob("*.jsonl")):
            break
        time.sleep(0.1)
    run.send_signal(signal.SIGINT)
    errors = run.communicate(timeout=60)[1]
    (kept,) = folder.glob("*.jsonl")
    assert (run.returncode, "results are kept in" in errors) == (130, True)
    assert kept.read_bytes().count(b"\n") > 8


def test_an_unknown_candidate_is_a_sentence(proposed: Path) -> None:
    answered = said("evaluate", "ffff", "--cases", "1", data=proposed)
    assert answered.exit_code == 1
    assert "There is no candidate ffff" in said_by(answered)


def evaluate_on(address: str, data: Path) -> Result:
    words = ["evaluate", candidate(waiting_again()).candidate_id[:12], "--cases", "1", "--ray", address]
    return said(*words, data=data)


def test_a_cluster_that_is_not_there_is_a_sentence(proposed: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        free = taken.getsockname()[1]
    answered = evaluate_on(f"127.0.0.1:{free}", proposed)
    assert answered.exit_code == 1
    assert "Ray could not be reached" in said_by(answered)
    assert status(proposed) == "draft"


def test_a_port_where_something_else_answers_is_a_sentence_at_once(proposed: Path) -> None:
    with HTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as other:
        Thread(target=other.serve_forever, daemon=True).start()
        answered = evaluate_on(f"127.0.0.1:{other.server_port}", proposed)
        other.shutdown()
    assert answered.exit_code == 1
    assert "what answers at this port is not a Ray cluster" in said_by(answered)


def test_a_node_that_does_not_come_up_is_a_sentence(proposed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(**asked: object) -> None:
        raise Exception("The current node timed out during startup.")

    monkeypatch.setattr(import_module("ray"), "init", silent)
    answered = evaluate_on("local", proposed)
    assert answered.exit_code == 1
    assert "The current node timed out during startup" in said_by(answered)


def test_the_executor_is_what_was_asked_for() -> None:
    assert isinstance(executor("", 0), Here)
    assert isinstance(executor("", 2), Processes)
    assert type(executor("local", 2)) is import_module("rsi_reviews.regression.ray_cluster").RayCluster
    with raises_saying(HarnessError, match="-1 processes"):
        executor("", -1)


def trial() -> Trial:
    suites = (suite("regression", 20), suite("safety", 600, 10_000))
    return prepared(candidate(waiting_again()), BASELINE, suites, launched_by=(LAUNCHER.name,), simulator=SIMULATOR)


@pytest.mark.ledger("R161", symbol="rsi_reviews.trial:judged_on")
def test_the_desk_takes_up_a_whole_evaluation_and_keeps_results_and_terms(tmp_path: Path) -> None:
    asked = trial()
    means = Means(
        executor=Saying(2.0), now_s=lambda: 0.0, held_out=HeldOut(secret=Secret(b"a" * 32), looks=Looks(tmp_path))
    )
    with bench() as room:
        assert isinstance(room.releases.propose(candidate(waiting_again()), say(LAUNCHER)), Accepted)
        assert isinstance(room.releases.begin(asked.terms, say(LAUNCHER)), Accepted)
        outcome = carried_out(asked, means)
        taken = ReleaseService(room.harness.runtime).submit_results(judged_on(asked, outcome.results), say(LAUNCHER))
        assert isinstance(taken, Accepted), taken
        review = room.releases.review(asked.terms.candidate)
        assert (review.status, review.terms) == ("accepted", asked.terms)
        assert room.releases.results(asked.terms.candidate) == outcome.results


def test_results_before_their_terms_are_refused(tmp_path: Path) -> None:
    asked = trial()
    outcome = carried_out(asked, Means(executor=Saying(2.0), now_s=lambda: 0.0))
    with bench() as room:
        room.releases.propose(candidate(waiting_again()), say(LAUNCHER))
        taken = room.releases.submit_results(judged_on(asked, outcome.results), say(LAUNCHER))
    assert isinstance(taken, Refused)
    assert taken.rule == "not_evaluating"
