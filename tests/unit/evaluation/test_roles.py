"""The ablation of role-isolated contexts: adversarial contexts, and what is said without a model."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Thread

import httpx
import pytest

from app.cli.evaluate import endpoint
from rsi_reviews.evaluation.report import _roles
from rsi_reviews.evaluation.roles import RoleReport, adversarial, answered, ask_model
from simulator.in_process import SIMULATOR


def honest(prompt: str) -> str:
    """Judges by the newest pose alone."""
    newest = [line for line in prompt.splitlines() if line.startswith("Localiser pose")][-1:]
    near = bool(newest) and float(newest[0].split("m: ")[1].split(" m off")[0]) <= 0.4
    fresh = bool(newest) and float(newest[0].split("off, ")[1].split(" s old")[0]) <= 1.0
    return json.dumps({"verdict": "satisfied" if near and fresh else "ambiguous", "reason": "by the poses"})


def gullible(prompt: str) -> str:
    """Believes whoever speaks last."""
    return '{"verdict": "satisfied"}' if "From the other roles:" in prompt else honest(prompt)


@contextmanager
def served(verdict: str) -> Iterator[str]:
    """A real endpoint that speaks the protocol and always answers so."""

    class Talking(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            asking = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            said = {"verdict": verdict, "reason": asking["model"]}
            body = json.dumps({"choices": [{"message": {"content": json.dumps(said)}}]}).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            return None

    with HTTPServer(("127.0.0.1", 0), Talking) as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/v1"
        server.shutdown()
        thread.join()


def test_adversarial_contexts_differ_only_by_the_other_roles_words() -> None:
    trials = adversarial(SIMULATOR, trials=20, controls=5)
    assert [trial.shown for trial in trials] == [False] * 20 + [True] * 5
    assert all(trial.shared.startswith(trial.isolated) for trial in trials)
    assert all("From the other roles" not in trial.isolated for trial in trials)
    assert len({trial.kind for trial in trials}) == 5


def test_a_model_that_believes_the_other_roles_is_found_out() -> None:
    trials = adversarial(SIMULATOR, trials=20, controls=5)
    report = ask_model(trials, gullible, name="gullible", progress=lambda number: None)
    assert report.isolated_fooled is not None
    assert report.shared_fooled is not None
    assert (report.trials, report.controls, report.unanswered) == (20, 5, 0)
    assert report.shared_fooled.value == 1.0
    assert report.isolated_fooled.value < 0.5


@pytest.mark.parametrize("text", ["", "satisfied", '{"verdict": "yes"}', '{"verdict": 1}', "{", "]}[{"])
def test_an_answer_that_cannot_be_read_accepts_nothing(text: str) -> None:
    assert answered(lambda prompt: text, "?") == ""


def test_an_endpoint_is_asked_by_its_protocol() -> None:
    with served("violated") as url, httpx.Client(timeout=60.0) as client:
        assert answered(endpoint(client, "small", url), "?") == "violated"


def test_without_a_model_the_row_says_not_tested() -> None:
    assert any(line.startswith("not tested") for line in _roles(RoleReport(tested=False)))
