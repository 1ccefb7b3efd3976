"""`regen handoff` where a console owns the folder: every word goes through its API and comes back as it stands."""

import json
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
import uvicorn
from fastapi import FastAPI
from fastapi.testclient import TestClient
from msgspec.structs import asdict
from pydantic import SecretStr
from typer.testing import CliRunner

from app.auth.sessions import Origin
from app.background.signals import SignalBroker
from app.cli.main import app as regen
from app.main import bind, create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.adapters.stores.owner import OwnerLock
from tests.builders.accounts import quick_accounts
from tests.builders.terminals import PASSWORD, Terminals
from tests.builders.waiting import Waiting, waiting

TOKEN = "the-owner"


class Terminal:
    """A terminal on a folder that a console owns."""

    def __init__(self, folder: Path, asked: Waiting, app: FastAPI, url: str) -> None:
        self.folder, self.asked, self.app, self.url = folder, asked, app, url
        self.env = Terminals(folder).env("owner")

    def says(self, *words: str, code: int = 0) -> dict[str, Any]:
        """The JSON that `regen handoff` prints."""
        done = CliRunner().invoke(regen, ["handoff", *words, "--data", str(self.folder), "--json"], env=self.env)
        assert done.exit_code == code, (done.output, done.exception)
        found: dict[str, Any] = json.loads(done.output.splitlines()[-1])
        return found

    def refused(self, *words: str) -> str:
        """What an error says."""
        done = CliRunner().invoke(regen, ["handoff", *words, "--data", str(self.folder)], env=self.env)
        assert done.exit_code != 0
        return f"{done.output} {done.exception}"


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    broker = SignalBroker()
    data = tmp_path / "var"
    data.mkdir()
    with waiting(signals=broker) as made, OwnerLock(data) as lock:
        asked = made.asked()
        listener = bind(0)
        port = listener.getsockname()[1]
        settings = ConsoleSettings(port=port, robots=("vbot-1",), owner_token=SecretStr(TOKEN))
        app = create_app(
            made.runtime,
            settings,
            broker,
            Scenes(made.runtime),
            accounts=quick_accounts(settings, data),
            answer=made.supervisor.answer,
            starts=made.harness.starts,
        )
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        url = f"http://127.0.0.1:{port}"
        lock.take(token=TOKEN, url=url)
        Terminals(data).add("owner", "admin", "operator")
        yield Terminal(data, asked, app, url)
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


def test_one_act_by_form_api_and_command_line_is_stored_alike(terminal: Terminal) -> None:
    """One model behind three doors: only the name of who said it differs between the stored events."""
    own = {"Origin": terminal.url, "Sec-Fetch-Site": "same-origin"}
    form = TestClient(terminal.app, base_url=terminal.url, follow_redirects=False, headers=own)
    entering = {"name": "owner", "password": PASSWORD}
    assert form.post("/account/sign-in", data=entering).status_code == 303
    sessions = terminal.app.state.sessions
    token = sessions.terminal_sign_in("owner", PASSWORD, Origin())
    api = TestClient(terminal.app, base_url=terminal.url, headers={"Authorization": f"Bearer {token}"})
    name = terminal.asked.handoff_id
    at = f"/handoffs/{name}"
    cycle = str(terminal.asked.handoff.cycle)

    def stored(kind: str) -> dict[str, Any]:
        event = terminal.asked.told[-1]
        assert type(event).__name__ == kind
        return {field: value for field, value in asdict(event).items() if field != "actor"}

    assert form.post(f"{at}/claim", data={"claim": "t"}).status_code == 303
    by_form = [stored("HandoffClaimed")]
    assert form.post(f"{at}/release", data={"claim": "t", "cycle": cycle}).status_code == 303
    by_form.append(stored("HandoffReleased"))
    assert api.post(f"/api/v1{at}/claim", json={"claim": "t"}).status_code == 200
    by_api = [stored("HandoffClaimed")]
    assert api.post(f"/api/v1{at}/release", json={"claim": "t"}).status_code == 200
    by_api.append(stored("HandoffReleased"))
    terminal.says("claim", name, "--claim", "t")
    by_command = [stored("HandoffClaimed")]
    terminal.says("release", name, "--claim", "t")
    by_command.append(stored("HandoffReleased"))
    assert by_form == by_api == by_command


def test_the_old_words_of_the_command_line_still_say_the_same(terminal: Terminal) -> None:
    name = terminal.asked.handoff_id
    assert terminal.says("extend", name)["deadline_at_s"] > 0
    assert "already" in terminal.refused("on-my-way", name)
    terminal.says("claim", name, "--claim", "t")
    words = ("--device", "desk 2", "--reason", "by hand", "--claim", "t")
    assert terminal.says("take-control", name, *words)["status"] == "taken_over"
    assert terminal.says("take-over", name, *words)["status"] == "taken_over"
