"""A lost sign-in link: a new one is printed on the machine of the console, while it runs; the lost one is void."""

from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import pytest
import uvicorn
from fastapi.testclient import TestClient
from pydantic import SecretStr
from typer.testing import CliRunner, Result

from app.auth.permissions import Principal
from app.cli.main import app as regen
from app.main import bind
from app.settings import ConsoleSettings
from harness.adapters.stores.owner import OwnerLock
from tests.builders.consoles import OWNER, Stand, console_stand
from tests.saying import said

ADMIN = Principal(name="ana", roles=("admin",), source="terminal")


@pytest.fixture
def owned(tmp_path: Path) -> Iterator[Stand]:
    """A console that answers on a port of its own and owns this folder."""
    listener = bind(0)
    settings = ConsoleSettings(port=listener.getsockname()[1], robots=("vbot-1",), owner_token=SecretStr(OWNER))
    with console_stand(settings=settings) as stand, OwnerLock(tmp_path) as lock:
        server = uvicorn.Server(uvicorn.Config(stand.app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        lock.take(token=OWNER, url=settings.address)
        yield stand
        server.should_exit = True
        thread.join(timeout=60)


def linked(folder: Path) -> Result:
    return CliRunner().invoke(regen, ["account", "link", "--data", str(folder)])


def entering(stand: Stand, path: str) -> int:
    address = stand.app.state.console.settings.address
    return TestClient(stand.app, base_url=address, follow_redirects=False).get(path).status_code


def test_a_new_link_takes_the_place_of_the_lost_one_once_and_stands_in_the_trail(owned: Stand, tmp_path: Path) -> None:
    lost = owned.app.state.sessions.invite()
    said, told = f"Sign in once: {owned.app.state.console.settings.address}", linked(tmp_path)
    assert told.exit_code == 0, told.output
    assert told.output.startswith(f"{said}/account/sign-in?token=")
    new = told.output.strip().removeprefix(said)
    assert entering(owned, lost) == 403
    assert entering(owned, new) == 200
    assert entering(owned, new) == 403
    page = TestClient(owned.app, base_url=owned.app.state.console.settings.address).get(lost).text
    assert "<code>regen account link</code>" in page
    (made,) = owned.app.state.sessions.accounts.store.audit_log(kind="sign_in.link_made")
    assert (made.actor, made.source) == ("host:owner", "127.0.0.1")
    assert new.rpartition("=")[2] not in str(made)


def test_with_accounts_there_is_no_link_and_it_is_said_what_to_do(owned: Stand, tmp_path: Path) -> None:
    owned.app.state.sessions.accounts.add("root", roles=["admin"], password="correct horse battery", by=ADMIN)
    told = linked(tmp_path)
    assert told.exit_code != 0
    assert "lets nobody in" in str(told.exception) and "regen account password NAME" in str(told.exception)
    assert owned.app.state.sessions.accounts.store.audit_log(kind="sign_in.link_made") == []


def test_without_a_console_it_is_said_how_to_start_one(tmp_path: Path) -> None:
    told = linked(tmp_path)
    assert told.exit_code != 0
    assert "No console runs on this data folder" in said(told)
