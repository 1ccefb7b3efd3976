"""A generator runs where it can read neither the held-out set nor anything else that judges it: file, environment,
database.
"""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from harness.contracts.errors import StoreUnavailable
from rsi_reviews.generate.process import environment
from rsi_reviews.held_out import SECRET, secret_in
from tests.integration.runs import ROOT
from tests.saying import raises_saying

PROBE = """
import os, socket, sys
from pathlib import Path
from rsi_reviews.generate.confinement import confine
before = Path(sys.argv[1]).read_bytes()
confine([Path(sys.prefix)], connects=False)
tries = {
    "read": lambda: Path(sys.argv[1]).read_bytes(),
    "list": lambda: os.listdir(Path(sys.argv[1]).parent),
    "link": lambda: Path("/tmp/regen-probe-link").symlink_to(sys.argv[1]),
    "copy": lambda: os.link(sys.argv[1], "/tmp/regen-probe-copy"),
    "environment of the parent": lambda: Path(f"/proc/{os.getppid()}/environ").read_bytes(),
    "child": lambda: os.waitstatus_to_exitcode(os.wait()[1]) == 0 or 1 / 0 if os.fork() else _child(),
    "connect": lambda: socket.create_connection(("127.0.0.1", int(sys.argv[2])), timeout=5),
}

def _child():
    try:
        Path(sys.argv[1]).read_bytes()
    except OSError:
        os._exit(1)
    os._exit(0)

for name, act in tries.items():
    try:
        act()
    except (OSError, ZeroDivisionError):
        continue
    print(name)
"""


def regen(*words: str, **environment: str) -> Any:
    done = CliRunner(env=environment).invoke(app, ["rsi", "generate", *words, "--json"])
    if isinstance(done.exception, StoreUnavailable):
        raise done.exception
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with one mission, and beside it the evaluator's folder with its secret."""
    folder = tmp_path / "site"
    walk = ["mission", "run", "circuit", "--data", str(folder), "--fidelity", "kinematic", "--speed", "0", "--json"]
    assert CliRunner().invoke(app, walk).exit_code == 0
    secret_in(tmp_path / "site-evaluator", os.urandom)
    return folder


@pytest.mark.ledger("R168", entry="command line", symbol="rsi_reviews.generate.confinement:confine")
def test_the_generators_process_reads_no_data_folder_no_evaluator_and_no_environment(data: Path) -> None:
    found = regen("--data", str(data), REGEN_DATABASE="", EVALUATOR_SECRET="held out", REGEN_MODEL="m")
    assert found["missions"] == 1, "the records were read, by the program that asks"
    process = found["process"]
    assert process["unreadable"] == [str(data), str(data.with_name("site-evaluator"))]
    assert "EVALUATOR_SECRET" not in process["environment"]
    assert not [name for name in process["environment"] if name.startswith("REGEN_") and "MODEL" not in name]


@pytest.mark.ledger("R168", entry="command line", symbol="rsi_reviews.generate.__main__:_refuse_readable")
def test_a_held_out_set_that_lies_where_the_program_may_read_stops_the_generator(data: Path) -> None:
    with raises_saying(StoreUnavailable, match="can read what judges it"):
        regen("--data", str(data), "--evaluator", str(ROOT / "rsi_reviews" / "suites"))


@pytest.mark.ledger("R168", symbol="rsi_reviews.generate.confinement:confine")
def test_a_confined_process_cannot_get_at_the_secret_by_any_of_these_ways(tmp_path: Path) -> None:
    secret_in(tmp_path, os.urandom)
    with socket.create_server(("127.0.0.1", 0)) as database:
        probe = [sys.executable, "-c", PROBE, str(tmp_path / SECRET), str(database.getsockname()[1])]
        done = subprocess.run(probe, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_only_the_models_endpoint_of_the_harness_environment_is_passed_on() -> None:
    whole = {"PATH": "/bin", "REGEN_DATABASE": "postgresql://u:p@h/d", "REGEN_MODEL_URL": "http://x", "HOME": "/root"}
    assert environment(whole) == {"PATH": "/bin", "REGEN_MODEL_URL": "http://x"}
