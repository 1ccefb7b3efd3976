"""`regen handoff` where a console owns the folder: every word goes through its API and comes back as it stands."""

import json
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
import uvicorn
from pydantic import SecretStr
from typer.testing import CliRunner

from app.cli import app as regen
from app.live import SignalBroker
from app.main import bind, create_app, open_accounts
from app.scene import Scenes
from app.settings import ConsoleSettings
from harness.adapters.stores.owner import OwnerLock
from tests.builders.waiting import Waiting, waiting

TOKEN = "the-owner"


class Terminal:
    """A terminal on a folder that a console owns."""

    def __init__(self, folder: Path, asked: Waiting) -> None:
        self.folder, self.asked = folder, asked

    def says(self, *words: str, code: int = 0) -> dict[str, Any]:
        """The JSON that `regen handoff` prints."""
        done = CliRunner().invoke(regen, ["handoff", *words, "--data", str(self.folder), "--json"])
        assert done.exit_code == code, (done.output, done.exception)
        found: dict[str, Any] = json.loads(done.output.splitlines()[-1])
        return found

    def refused(self, *words: str) -> str:
        """What an error says."""
        done = CliRunner().invoke(regen, ["handoff", *words, "--data", str(self.folder)])
        assert done.exit_code != 0
        return f"{done.output} {done.exception}"


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    broker = SignalBroker()
    with waiting(signals=broker) as made, OwnerLock(tmp_path) as lock:
        asked = made.asked()
        listener = bind(0)
        port = listener.getsockname()[1]
        settings = ConsoleSettings(port=port, robots=("vbot-1",), owner_token=SecretStr(TOKEN))
        app = create_app(
            made.runtime,
            settings,
            broker,
            Scenes(made.runtime),
            accounts=open_accounts(settings),
            answer=made.supervisor.answer,
            starts=made.harness.starts,
        )
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        lock.take(token=TOKEN, url=f"http://127.0.0.1:{port}")
        yield Terminal(tmp_path, asked)
        server.should_exit = True
        thread.join(timeout=60)
        listener.close()


def test_every_word_at_a_handoff_can_be_said_from_a_terminal(terminal: Terminal) -> None:
    name = terminal.asked.handoff_id
    (row,) = terminal.says("list")["handoffs"]
    assert (row["handoff_id"], row["status"], row["cycle"]) == (name, "open", 2)
    assert terminal.says("show", name)["proposal"]["action"] == "retry"
    assert terminal.says("claim", name, "--claim", "t")["holder"] == "owner"
    assert "another window" in terminal.refused("reject", name, "--reason", "no")
    assert terminal.says("release", name, "--claim", "t")["status"] == "open"
    before = row["deadline_at_s"]
    assert terminal.says("on-my-way", name)["deadline_at_s"] == before + 600.0
    assert terminal.says("look", name)["cycle"] == 3
    chosen = terminal.says("choose", name, "--action", "verify_again")
    assert chosen["cycle"] == 4 and chosen["digest"] != row["digest"]
    assert "not what you saw" in terminal.refused("approve", name, "--digest", row["digest"], "--reason", "ok")
    terminal.says("claim", name, "--claim", "t")
    taken = terminal.says("take-over", name, "--device", "desk 2", "--reason", "by hand", "--claim", "t")
    assert taken["status"] == "taken_over"
    closed = terminal.says("close", name, "--reason", "I keep it", "--claim", "t")
    assert closed["status"] == "handed_off"
    assert terminal.says("list")["handoffs"] == []


def test_an_approval_from_a_terminal_names_the_digest_and_follows_the_mission(terminal: Terminal) -> None:
    (row,) = terminal.says("list")["handoffs"]
    before = len(terminal.asked.starts)
    done: list[dict[str, Any]] = []
    words = ("approve", row["handoff_id"], "--digest", row["digest"], "--reason", "seen on camera")
    following = Thread(target=lambda: done.append(terminal.says(*words, code=3)))
    following.start()
    while terminal.asked.handoff.status == "open" and following.is_alive():
        following.join(0.05)
    terminal.asked.run()
    following.join(120.0)
    assert done[0]["status"] == "awaiting_human"
    assert sum(start.moves for start in terminal.asked.starts[before:]) == 1
    answer = terminal.asked.handoff.answer
    assert answer is not None and (answer.actor.name, answer.reason) == ("owner", "seen on camera")
