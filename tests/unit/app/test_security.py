"""Who may enter, for how long, and from where."""

import pytest
from starlette.datastructures import Headers

from app.security import Doors, same_origin


class Watch:
    """A clock that moves when told."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def doors(watch: Watch) -> Doors:
    return Doors(owner_token="secret", operator="ada", idle_s=60.0, age_s=600.0, clock=watch)


def token(doors: Doors) -> str:
    return doors.invite().split("token=")[1]


def test_a_link_lets_one_person_in_once(doors: Doors) -> None:
    link = token(doors)
    session = doors.enter(link)
    assert session is not None
    actor = doors.who(session)
    assert actor is not None
    assert (actor.name, actor.role) == ("ada", "operator")
    assert doors.enter(link) is None


def test_a_link_is_worth_nothing_after_an_hour(doors: Doors, watch: Watch) -> None:
    link = token(doors)
    watch.now_s += 3601
    assert doors.enter(link) is None


def test_a_made_up_link_or_session_is_nobody(doors: Doors) -> None:
    assert doors.enter("guess") is None
    assert doors.who("guess") is None


def test_a_session_ends_when_it_is_idle(doors: Doors, watch: Watch) -> None:
    session = doors.enter(token(doors)) or ""
    watch.now_s += 59
    assert doors.who(session) is not None
    watch.now_s += 61
    assert doors.who(session) is None


def test_a_session_ends_when_it_is_old_however_busy(doors: Doors, watch: Watch) -> None:
    session = doors.enter(token(doors)) or ""
    for _ in range(12):
        watch.now_s += 50
        assert doors.who(session) is not None
    watch.now_s += 50
    assert doors.who(session) is None


def test_signing_out_ends_the_session(doors: Doors) -> None:
    session = doors.enter(token(doors)) or ""
    doors.leave(session)
    assert doors.who(session) is None


@pytest.mark.parametrize("header", ["", "Bearer", "Bearer wrong", "Basic secret", "secret"])
def test_only_the_owners_token_is_the_owner(doors: Doors, header: str) -> None:
    assert doors.owner(header) is None
    assert doors.owner("Bearer secret") is not None


def test_an_installation_without_an_owner_token_has_no_owner(watch: Watch) -> None:
    doors = Doors(owner_token="", operator="ada", idle_s=60.0, age_s=600.0, clock=watch)
    assert doors.owner("Bearer ") is None


@pytest.mark.parametrize(
    ("headers", "own"),
    [
        ({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000"}, True),
        ({"host": "127.0.0.1:8000", "sec-fetch-site": "same-origin"}, True),
        ({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000", "sec-fetch-site": "cross-site"}, False),
        ({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:9000"}, False),
        ({"host": "127.0.0.1:8000", "origin": "null"}, False),
        ({"host": "127.0.0.1:8000", "sec-fetch-site": "same-site"}, False),
        ({"host": "127.0.0.1:8000", "sec-fetch-site": "none"}, False),
        ({"host": "127.0.0.1:8000"}, False),
    ],
)
def test_a_command_counts_only_from_our_own_pages(headers: dict[str, str], own: bool) -> None:
    assert same_origin(Headers(headers), websocket=False) is own


def test_a_socket_must_name_its_origin() -> None:
    assert not same_origin(Headers({"host": "127.0.0.1:8000", "sec-fetch-site": "same-origin"}), websocket=True)
    assert same_origin(Headers({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000"}), websocket=True)
