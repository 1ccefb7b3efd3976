"""The stream of events: in order, complete, and resumed from where a reader lost it."""

import asyncio
import json
from collections.abc import Iterator

import pytest

from app.routes.api_events import events, frames
from tests.builders.consoles import Stand, console_stand


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        made.run()
        yield made


def read(stand: Stand, after: int, until: int, *, prefix: str = "") -> list[str]:
    """Frames of events after a position, up to the one at `until`."""
    console = stand.app.state.console

    async def listen() -> list[str]:
        found = []
        async for one in frames(console, after, prefix):
            if one.startswith("id: "):
                found.append(one)
                if one.startswith(f"id: {until}\n"):
                    break
        return found

    return asyncio.run(asyncio.wait_for(listen(), 60))


def test_a_reader_gets_every_event_once_in_order_as_the_log_has_it(stand: Stand) -> None:
    head = stand.harness.runtime.head().position
    found = read(stand, 0, head)
    assert [int(one.split("\n")[0].removeprefix("id: ")) for one in found] == list(range(1, head + 1))
    stored = stand.harness.runtime.log(0, 1)[0]
    said = json.loads(found[0].split("data: ")[1])
    assert (said["digest"], said["kind"], said["stream"]) == (stored.digest, stored.kind, stored.stream)
    assert said["event"] == json.loads(stored.body)


def test_a_reader_that_comes_back_goes_on_after_the_last_one_it_saw(stand: Stand) -> None:
    head = stand.harness.runtime.head().position
    assert [one.split("\n")[0] for one in read(stand, head - 2, head)] == [f"id: {head - 1}", f"id: {head}"]


def test_last_event_id_counts_before_after_and_none_of_both_means_from_now_on(stand: Stand) -> None:
    console, head = stand.app.state.console, stand.harness.runtime.head().position

    async def first(**asked: object) -> str:
        answer = await events(console, **{"after": None, "stream": "", "last_event_id": "", **asked})  # type: ignore[arg-type]
        async for one in answer.body_iterator:
            if str(one).startswith("id: "):
                return str(one).split("\n")[0]
            if str(one).startswith(": beat"):
                return "nothing yet"
        return "ended"

    assert asyncio.run(first(last_event_id=str(head - 1), after=0)) == f"id: {head}"
    assert asyncio.run(first(after=3)) == "id: 4"
    assert asyncio.run(first()) == "nothing yet"


def test_what_is_committed_while_somebody_listens_arrives_and_other_streams_do_not(stand: Stand) -> None:
    console = stand.app.state.console

    async def listen() -> list[str]:
        found: list[str] = []
        before = stand.harness.runtime.head().position
        mine = ""
        async for one in frames(console, before, "mission/"):
            if one.startswith("retry"):
                mine = await asyncio.to_thread(stand.created)
                console.broker.changed(f"mission/{mine}")
            elif one.startswith("id: "):
                found.append(json.loads(one.split("data: ")[1])["stream"])
                if len(found) == 2:
                    break
        assert set(found) == {f"mission/{mine}"}
        return found

    assert len(asyncio.run(asyncio.wait_for(listen(), 60))) == 2
    assert console.broker.watching == 0


def test_a_stream_ends_when_the_console_stops() -> None:
    with console_stand() as stand:
        console = stand.app.state.console

        async def listen() -> int:
            count = 0
            async for _ in frames(console, 0, ""):
                count += 1
                console.broker.close()
            return count

        assert asyncio.run(asyncio.wait_for(listen(), 60)) >= 1


def test_an_id_that_no_log_gave_is_a_problem(stand: Stand) -> None:
    answer = stand.owner().get("/api/v1/events", headers={"Last-Event-ID": "yesterday"})
    assert (answer.status_code, answer.headers["content-type"]) == (422, "application/problem+json")
