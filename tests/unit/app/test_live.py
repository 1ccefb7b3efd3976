"""Signals: names reach the pages that asked for them, soon, and not too often."""

import asyncio
from itertools import pairwise
from threading import Thread

import pytest

from app.background.signals import HEARTBEAT_S, SPACING_S, SignalBroker, Traffic
from tests.builders.loops import in_virtual_time


async def heard(broker: SignalBroker, topics: tuple[str, ...], *, count: int, within_s: float = 60.0) -> list[str]:
    """The first `count` names (beats left out) that a page with these topics hears."""
    subscription = broker.subscribe(topics)
    names: list[str] = []
    try:
        async with asyncio.timeout(within_s):
            async for name in subscription.names():
                names += [name] if name else []
                if len(names) >= count:
                    return names
    finally:
        broker.unsubscribe(subscription)
    return names


def test_a_name_changed_in_another_thread_reaches_the_page() -> None:
    async def watch() -> list[str]:
        broker = SignalBroker()
        waiting = asyncio.create_task(heard(broker, ("mission/m1",), count=1))
        await asyncio.sleep(0)
        Thread(target=broker.changed, args=("mission/m1",)).start()
        return await waiting

    assert asyncio.run(watch()) == ["mission/m1"]


def test_a_page_hears_its_own_names_and_its_families_only() -> None:
    async def watch() -> list[str]:
        broker = SignalBroker()
        waiting = asyncio.create_task(heard(broker, ("mission/m1", "handoff/"), count=2))
        await asyncio.sleep(0)
        for name in ("mission/m2", "live/m1", "handoff/h7", "mission/m1"):
            broker.changed(name)
        return await waiting

    assert sorted(in_virtual_time(watch())) == ["handoff/h7", "mission/m1"]


def test_a_thousand_changes_of_one_name_are_told_at_most_ten_times_a_second_and_the_last_is_never_lost() -> None:
    async def watch() -> list[float]:
        broker = SignalBroker()
        subscription = broker.subscribe(("live/m1",))
        loop, told = asyncio.get_running_loop(), []

        async def listen() -> None:
            async for name in subscription.names():
                if name:
                    told.append(loop.time())

        listening = asyncio.create_task(listen())
        for _ in range(1000):
            broker.changed("live/m1")
            await asyncio.sleep(SPACING_S / 40)
        broker.changed("live/m1")
        last_s = loop.time()
        await asyncio.sleep(3 * SPACING_S)
        broker.close()
        await listening
        assert told[-1] >= last_s
        return told

    told = in_virtual_time(watch())
    assert len(told) > 20 and all(later - earlier >= 0.99 * SPACING_S for earlier, later in pairwise(told))


def test_what_is_told_together_and_what_is_never_told_are_counted() -> None:
    async def watch() -> tuple[Traffic, Traffic]:
        broker = SignalBroker()
        subscription = broker.subscribe(("live/m1", "mission/"))
        for name in ("live/m1", "live/m1", "live/m1", "mission/m1", "alert/a1"):
            broker.changed(name)
        told = subscription.names()
        assert [await anext(told), await anext(told)] == ["live/m1", "mission/m1"]
        broker.changed("mission/m2")
        before = broker.traffic
        broker.unsubscribe(subscription)
        return before, broker.traffic

    assert in_virtual_time(watch()) == (
        Traffic(offered=5, joined=2, dropped=0),
        Traffic(offered=5, joined=2, dropped=1),
    )


def test_silence_is_told_too_so_that_a_page_knows_the_stream_is_alive() -> None:
    async def watch() -> str:
        broker = SignalBroker()
        subscription = broker.subscribe(("mission/m1",))
        async with asyncio.timeout(2 * HEARTBEAT_S):
            return await anext(subscription.names())

    assert in_virtual_time(watch()) == ""


@pytest.mark.parametrize("before", [True, False])
def test_closing_ends_every_stream_at_once(before: bool) -> None:
    async def watch() -> list[str]:
        broker = SignalBroker()
        if before:
            broker.close()
        waiting = asyncio.create_task(heard(broker, ("mission/",), count=1, within_s=HEARTBEAT_S / 2))
        await asyncio.sleep(0)
        broker.close()
        return await waiting

    assert in_virtual_time(watch()) == []
