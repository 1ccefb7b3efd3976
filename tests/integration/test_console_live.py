"""The stream of names: where the log stood, then what changed, as long as somebody listens."""

import asyncio
from collections.abc import Iterator

import pytest

from app.routes.live import stream
from tests.builders.consoles import Stand, console_stand


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


def test_a_stream_begins_with_the_logs_position_and_tells_what_changed(stand: Stand) -> None:
    console = stand.app.state.console
    mission_id = stand.created()

    async def listen() -> list[str]:
        frames: list[str] = []
        async for frame in stream(console, (f"mission/{mission_id}",)):
            if not frames:
                assert console.broker.watching == 1
                console.broker.changed(f"mission/{mission_id}")
                console.broker.changed("mission/another")
            frames.append(frame)
            if frame.startswith("event: beat"):
                break
        return frames

    frames = asyncio.run(listen())
    assert f"event: hello\ndata: {stand.harness.runtime.head().position}\n\n" in frames[0]
    assert frames[1:-1] == [f"event: changed\ndata: mission/{mission_id}\n\n"]
    assert console.broker.watching == 0


def test_a_page_and_the_metrics_are_told_how_many_changes_came_together(stand: Stand) -> None:
    console = stand.app.state.console
    before = console.broker.traffic

    async def listen() -> list[str]:
        frames: list[str] = []
        async for frame in stream(console, ("live/m1",)):
            for _ in range(0 if frames else 4):
                console.broker.changed("live/m1")
            frames.append(frame)
            if frame.startswith("event: beat"):
                break
        return frames

    assert asyncio.run(listen())[1:-1] == ["event: changed\ndata: live/m1\n\n", "event: joined\ndata: 3\n\n"]
    told = dict(line.split() for line in stand.owner().get("/metrics").text.splitlines() if line[0] != "#")
    assert told["regen_live_signals_total"] == str(before.offered + 4)
    assert told["regen_live_joined_total"] == str(before.joined + 3)
    assert told["regen_live_dropped_total"] == str(before.dropped)


def test_a_stream_without_topics_or_with_too_many_is_refused(stand: Stand) -> None:
    operator = stand.operator()
    assert operator.get("/live").status_code == 422
    assert operator.get("/live?" + "&".join(f"topic=mission/m{n}" for n in range(41))).status_code == 422
