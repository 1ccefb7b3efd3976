"""Every stream ends within 2 s of a revocation, of the disabling of an account, or of signing out."""

import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from harness.contracts.ids import MissionId
from tests.builders.listening import Listening, listening
from tests.builders.people import SETTING_UP

ENDS_S = 2.0


@pytest.fixture(scope="module")
def here() -> Iterator[Listening]:
    with listening() as made:
        made.add("root", "admin")
        yield made


@pytest.fixture(scope="module")
def mission_id(here: Listening) -> MissionId:
    return here.stand.created()


def seconds_until_it_ends(client: httpx.Client, path: str, act: Callable[[], object]) -> float:
    """How long the stream goes on after the act; it must have been open before."""
    with client.stream("GET", path) as answer:
        assert answer.status_code == 200
        frames = answer.iter_text()
        next(frames)
        next(frames)
        act()
        begun = time.monotonic()
        for _ in frames:
            assert time.monotonic() - begun < 20.0, "the stream goes on"
    return time.monotonic() - begun


def disabled(here: Listening, name: str) -> None:
    here.stand.app.state.sessions.accounts.change(name, disabled=True, by=SETTING_UP)


def signed_out_everywhere(here: Listening, name: str) -> None:
    here.stand.app.state.sessions.accounts.store.close_sessions(name=name)


def role_changed(here: Listening, name: str) -> None:
    here.stand.app.state.sessions.accounts.change(name, roles=["viewer"], by=SETTING_UP)


def signed_out(client: httpx.Client) -> None:
    assert client.post("/account/sign-out").status_code == 303


@pytest.mark.parametrize("path", ["/live?topic=handoff/", "/api/v1/events?after=0"])
@pytest.mark.parametrize("act", [disabled, signed_out_everywhere, role_changed])
def test_a_persons_streams_end_when_their_account_or_session_does(
    here: Listening, act: Callable[[Listening, str], None], path: str
) -> None:
    name = f"{act.__name__.replace('_', '-')}-{len(path)}"
    client = here.add(name, "operator")
    assert seconds_until_it_ends(client, path, lambda: act(here, name)) < ENDS_S
    assert client.get(path).status_code == 401


@pytest.mark.parametrize("path", ["/live?topic=handoff/", "/api/v1/events?after=0"])
def test_a_persons_streams_end_when_they_sign_out_in_another_tab(here: Listening, path: str) -> None:
    client = here.add(f"leaver-{len(path)}", "operator")
    other = here.client(headers=client.headers, cookies=client.cookies)
    assert seconds_until_it_ends(client, path, lambda: signed_out(other)) < ENDS_S


def test_a_tokens_stream_of_events_ends_when_it_is_revoked(here: Listening) -> None:
    program, token_id = here.program("read")
    accounts = here.stand.app.state.sessions.accounts
    revoked = seconds_until_it_ends(program, "/api/v1/events?after=0", lambda: accounts.revoke(token_id, by=SETTING_UP))
    assert revoked < ENDS_S
    assert program.get("/api/v1/events?after=0").status_code == 401


def drained(view: ClientConnection) -> None:
    """Read until the view is closed. Raises ConnectionClosed."""
    while True:
        view.recv(timeout=20.0)


@pytest.mark.parametrize("act", [disabled, signed_out_everywhere])
def test_a_3d_view_ends_when_its_reader_may_no_longer_look(
    here: Listening, mission_id: MissionId, act: Callable[[Listening, str], None]
) -> None:
    name = f"watcher-{act.__name__.replace('_', '-')}"
    client = here.add(name, "viewer")
    with here.view(client, mission_id) as view:
        assert len(view.recv(timeout=20.0)) > 16
        act(here, name)
        begun = time.monotonic()
        with pytest.raises(ConnectionClosed) as ended:
            drained(view)
        assert time.monotonic() - begun < ENDS_S
        assert ended.value.rcvd is not None
        assert (ended.value.rcvd.code, ended.value.rcvd.reason) == (1008, "signed_out")


def test_a_stream_goes_on_when_the_cookie_of_its_session_is_exchanged(here: Listening) -> None:
    client = here.add("stayer", "operator")
    store = here.stand.app.state.sessions.accounts.store
    with client.stream("GET", "/live?topic=handoff/") as answer:
        frames = answer.iter_text()
        next(frames)
        (before,) = store.sessions("stayer")
        for fresh in ("a" * 64, "b" * 64):
            (now,) = store.sessions("stayer")
            changed = {"digest": fresh, "previous": now.digest, "previous_until_s": time.time() + 1.0}
            assert store.change_session(now.digest, type(now)(**{**_fields(now), **changed}))
            until = time.monotonic() + 2.0
            while time.monotonic() < until:
                next(frames)
        assert before.digest != store.sessions("stayer")[0].digest
        signed_out_everywhere(here, "stayer")
        assert sum(1 for _ in frames) < 10


def _fields(value: object) -> dict[str, object]:
    return {name: getattr(value, name) for name in value.__struct_fields__}  # type: ignore[attr-defined]


def test_one_caller_holds_so_many_streams_and_the_next_is_refused_in_words(mission_id: MissionId) -> None:
    with listening(streams=3) as here:
        client, other = here.add("root", "admin"), here.add("lea", "viewer")
        held = [client.stream("GET", "/live?topic=handoff/") for _ in range(3)]
        opened = [one.__enter__() for one in held]
        assert [one.status_code for one in opened] == [200, 200, 200]
        refused = client.get("/live?topic=handoff/")
        assert (refused.status_code, refused.headers["retry-after"]) == (429, "5")
        assert "Too many live views" in refused.text
        problem = client.get("/api/v1/events?after=0")
        assert (problem.status_code, problem.json()["code"]) == (429, "too_many_streams")
        with other.stream("GET", "/live?topic=handoff/") as free:
            assert free.status_code == 200
        held[0].__exit__(None, None, None)
        until, status = time.monotonic() + 10.0, 429
        while status == 429:
            assert time.monotonic() < until
            with client.stream("GET", "/live?topic=handoff/") as again:
                status = again.status_code
        for one in held[1:]:
            one.__exit__(None, None, None)


def listeners() -> set[int]:
    """TCP ports on which this process listens."""
    inodes = set()
    for file in Path("/proc/self/fd").iterdir():
        try:
            name = os.readlink(file)
        except OSError:
            continue
        if name.startswith("socket:["):
            inodes.add(name.removeprefix("socket:[").rstrip("]"))
    found = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            parts = line.split()
            if parts[3] == "0A" and parts[9] in inodes:
                found.add(int(parts[1].rsplit(":", 1)[1], 16))
    return found


def test_an_open_3d_view_listens_on_no_port_and_only_the_owner_may_enter_its_folder(
    here: Listening, mission_id: MissionId
) -> None:
    client = here.add("looker", "viewer")
    before = listeners()
    with here.view(client, mission_id) as view:
        assert len(view.recv(timeout=20.0)) > 16
        assert listeners() == before
        path = here.stand.app.state.console.scenes.socket(mission_id, "one")
        assert path.is_socket()
        assert path.parent.stat().st_mode & 0o777 == 0o700
        with socket.socket(socket.AF_UNIX) as direct:
            direct.connect(str(path))


def test_a_viewer_has_no_handler_that_would_open_a_public_tunnel(here: Listening, mission_id: MissionId) -> None:
    scenes = here.stand.app.state.console.scenes
    scenes.socket(mission_id, "shared")
    server = scenes._open[mission_id, "shared"].server
    assert not [one for one in server._websock_server._incoming_handlers if "Share" in one.__name__]
    assert server.request_share_url() is None
