"""A store that another process holds: 503 with Retry-After, and the same key is decided afterwards."""

import asyncio
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from pydantic import SecretStr
from starlette.responses import JSONResponse
from starlette.types import Receive, Scope, Send

from app.auth.commit_authority import authority
from app.auth.permissions import Principal
from app.background.signals import WRITES, SignalBroker
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from app.web.idempotency import Idempotency
from harness.adapters.stores.accounts import SqlAccounts
from harness.adapters.stores.accounts_rows import StoredAnswer
from harness.bootstrap import edit_harness
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import BASE, OWNER
from tests.builders.timeouts import TIMEOUT_S

PLACE = {"name": "Bay", "x_m": 1.0, "y_m": 1.0, "reason": "a new bay"}
PATH = "/api/v1/places/bay_1"


@dataclass(frozen=True)
class OnDisk:
    """A console on a data folder, and the files of its stores."""

    folder: Path
    app: FastAPI
    runtime: Runtime

    def client(self) -> TestClient:
        return TestClient(self.app, base_url=BASE, headers={"Authorization": f"Bearer {OWNER}"})

    @contextmanager
    def held(self, name: str) -> Iterator[None]:
        """Another process writes and does not end."""
        other = sqlite3.connect(self.folder / name, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        try:
            yield
        finally:
            other.execute("ROLLBACK")
            other.close()


@pytest.fixture
def here(tmp_path: Path) -> Iterator[OnDisk]:
    settings = ConsoleSettings(port=8000, owner_token=SecretStr(OWNER), password_memory_kib=19456)
    accounts = quick_accounts(settings, tmp_path)
    harness = HarnessSettings(data_folder=tmp_path)
    with edit_harness(harness, deciders=DECIDERS, select=selected, authority=authority(accounts)) as runtime:
        scenes = Scenes(runtime)
        app = create_app(runtime, settings, SignalBroker(), scenes, accounts=accounts, folder=tmp_path)
        yield OnDisk(tmp_path, app, runtime)
        scenes.close()
        app.state.console.lists.close()
        accounts.store.close()


@pytest.mark.long
def test_a_key_whose_first_request_found_the_log_held_is_executed_once_afterwards(here: OnDisk) -> None:
    client, under = here.client(), {"Idempotency-Key": "k"}
    head = here.runtime.head()
    with here.held("events.db"):
        for _ in range(2):
            refused = client.post(PATH, json=PLACE, headers=under)
            assert (refused.status_code, refused.headers["retry-after"]) == (503, "5"), refused.text
    assert here.runtime.head() == head
    done = client.post(PATH, json=PLACE, headers=under)
    assert done.status_code == 200, done.text
    again = client.post(PATH, json=PLACE, headers=under)
    assert (again.status_code, again.json()) == (200, done.json())
    assert again.headers["idempotency-replayed"] == "true"
    assert here.runtime.head().position == head.position + 1


def test_where_the_accounts_are_held_nothing_is_begun_and_reading_goes_on(here: OnDisk) -> None:
    client, under = here.client(), {"Idempotency-Key": "k"}
    head = here.runtime.head()
    with here.held("accounts.db"):
        refused = client.post(PATH, json=PLACE, headers=under)
        assert (refused.status_code, refused.headers["retry-after"]) == (503, "5"), refused.text
        assert refused.json()["code"] == "store_unavailable"
        assert client.get("/api/v1/places").status_code == 200
    assert here.runtime.head() == head
    assert client.post(PATH, json=PLACE, headers=under).status_code == 200


def test_a_command_that_was_decided_is_answered_though_its_audit_entry_must_wait(here: OnDisk) -> None:
    client = here.client()
    with here.held("accounts.db"):
        assert client.post(PATH, json=PLACE).status_code == 200
    assert client.post(f"{PATH}/remove", json={"basis": 1, "reason": "gone"}).status_code == 200
    kinds = [one.kind for one in here.app.state.sessions.accounts.store.audit_log(kind="command")]
    assert kinds == ["command.RemovePlace", "command.SavePlace"]
    here.app.state.sessions.accounts.store.verify_trail()


class Program:
    """An application that does what it is told, and counts."""

    def __init__(self) -> None:
        self.calls, self.commits, self.busy, self.status = 0, 0, False, 200
        self.goes_on = asyncio.Event()
        self.goes_on.set()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.calls += 1
        await self.goes_on.wait()
        writes = WRITES.get()
        assert writes is not None
        writes.commits, writes.busy = self.commits, self.busy
        await JSONResponse({"call": self.calls}, status_code=self.status)(scope, receive, send)


async def sent(app: Idempotency, body: bytes = b"{}") -> tuple[int, bytes]:
    """Status and body of one request under the key `k`."""
    told: list[dict[str, object]] = []

    async def receive() -> dict[str, object]:
        return {"type": "http.request", "body": body, "more_body": False}

    async def send(message: object) -> None:
        told.append(dict(message))  # type: ignore[call-overload]

    scope = {
        "type": "http",
        "method": "POST",
        "path": "/api/v1/missions",
        "query_string": b"",
        "headers": [(b"idempotency-key", b"k")],
        "state": {"principal": Principal(name="lea", roles=("operator",))},
    }
    await app(scope, receive, send)  # type: ignore[arg-type]
    return int(str(told[0]["status"])), b"".join(bytes(one.get("body", b"")) for one in told[1:])  # type: ignore[arg-type]


async def both(app: Idempotency, go_on: Callable[[], None]) -> tuple[tuple[int, bytes], tuple[int, bytes]]:
    """Two requests under one key, and what holds the first lets go only after the second came."""
    first = asyncio.create_task(sent(app))
    await asyncio.sleep(0.05)
    second = asyncio.create_task(sent(app))
    await asyncio.sleep(0.05)
    go_on()
    return await first, await second


def test_a_request_that_committed_before_it_found_the_log_held_is_not_done_again() -> None:
    program = Program()
    program.commits, program.busy, program.status = 1, True, 503
    app = Idempotency(program, store=SqlAccounts(), clock=lambda: 1000.0)
    assert asyncio.run(sent(app))[0] == 503
    status, body = asyncio.run(sent(app))
    assert (status, b"outcome_unknown" in body, program.calls) == (409, True, 1)


def test_the_second_sender_of_a_key_waits_for_the_first_and_gets_its_answer() -> None:
    program = Program()
    program.goes_on.clear()
    app = Idempotency(program, store=SqlAccounts(), clock=lambda: 1000.0)
    first, second = asyncio.run(both(app, program.goes_on.set))
    assert first == second == (200, b'{"call":1}')
    assert program.calls == 1


def test_the_second_sender_waits_also_while_the_first_one_is_only_being_recorded() -> None:
    class Slow(SqlAccounts):
        def begin(self, claim: StoredAnswer, *, forget_before_s: float) -> StoredAnswer | None:
            known = super().begin(claim, forget_before_s=forget_before_s)
            if known is None:
                assert recorded.wait(TIMEOUT_S)
            return known

    recorded, program = Event(), Program()
    app = Idempotency(program, store=Slow(), clock=lambda: 1000.0)
    assert asyncio.run(both(app, recorded.set)) == ((200, b'{"call":1}'), (200, b'{"call":1}'))
    assert program.calls == 1


def test_an_answer_that_could_not_be_stored_is_given_again_from_memory(tmp_path: Path) -> None:
    program, store = Program(), SqlAccounts(tmp_path / "accounts.db")
    app = Idempotency(program, store=store, clock=lambda: 1000.0)

    async def held_meanwhile() -> int:
        program.goes_on.clear()
        first = asyncio.create_task(sent(app))
        while not program.calls:
            await asyncio.sleep(0.01)
        other = sqlite3.connect(tmp_path / "accounts.db", isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        program.goes_on.set()
        status, _ = await first
        other.execute("ROLLBACK")
        other.close()
        return status

    assert asyncio.run(held_meanwhile()) == 200
    assert asyncio.run(sent(app)) == (200, b'{"call":1}')
    assert program.calls == 1
    store.close()
