"""From commit to changed page with a hundred readers of one running mission at five events a second.

The console serves in a process of its own. Most readers are connections that do what a page does: they hold the
stream of names open and fetch the same regions on the same signals; a few are real Chromium pages, in which the
change is seen. Everything is on one machine, so the readers' own work slows what they measure.
"""

import argparse
import asyncio
import multiprocessing
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median, quantiles
from threading import Thread

import httpx
import uvicorn
from playwright.async_api import Browser, Page, async_playwright
from playwright.sync_api import sync_playwright
from pydantic import SecretStr

from app.background.signals import SignalBroker
from app.main import bind, create_app, open_accounts
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from experiments.benchmarks.ours import PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions
from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.commands import PauseMission, ResumeMission
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId, RobotId
from harness.runtime import Runtime, Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tools import browser as chromium

ADA = Actor(name="ada", role="operator")
TARGET_MS, TARGET_SHARE = 250.0, 0.6
SETTLE_S = 3.0
FIRST_S, SHELL_S = 0.1, 1.0
"""How long after a signal a page fetches its bar and its rail, and how often at most: static/js/live.js, _bar.html."""
TICK = re.compile(rb"tick (\d+)")
SEEN = """() => { window.seen = {}; let newest = -1; new MutationObserver(() => {
    const said = [...document.querySelectorAll("#events tbody tr")].pop()?.textContent.match(/tick (\\d+)/);
    while (said && newest < Number(said[1])) window.seen[++newest] = Date.now() / 1000;
}).observe(document.body, { subtree: true, childList: true, characterData: true, attributes: true }); }"""


@dataclass
class BrowserReaders:
    """What the connections received: the time at which each got the answer with a tick, and what went wrong."""

    seen: dict[int, list[float]] = field(default_factory=dict)
    requests: int = 0
    failed: int = 0

    def note(self, body: bytes, newest: int) -> int:
        """Record an answer that one reader just got. The reader had seen the ticks up to `newest`; returns the
        newest now.
        """
        newest_tick = max((int(one) for one in TICK.findall(body)), default=newest)
        for tick in range(newest + 1, newest_tick + 1):
            self.seen.setdefault(tick, []).append(time.time())
        return max(newest_tick, newest)


@dataclass(frozen=True)
class MeasuredRun:
    """One measured stretch: latencies in milliseconds, and the console's own share of a core."""

    pages_ms: tuple[float, ...]
    readers_ms: tuple[float, ...]
    cpu: float
    requests: int
    failed: int
    wanted: int


@dataclass(frozen=True)
class BrowserPlan:
    """The console's address, what is read there, and by how many; `links` sign in one person each."""

    address: str
    mission_id: str
    links: tuple[str, ...]
    readers: int

    @property
    def port(self) -> int:
        return int(self.address.rpartition(":")[2])


def measure(*, readers: int, pages: int, events: int, per_s: float) -> list[Figure]:
    """Two rows: commit to changed DOM in the real pages, and the console's share of one core."""
    run = _run(readers=readers - pages, pages=pages, events=events, per_s=per_s)
    environment = {
        "versions": versions((*PACKAGES, "fastapi", "uvicorn", "playwright")),
        "durability": {"ours": "in memory"},
    }
    detail = {
        "readers": readers, "of them Chromium pages": pages, "events": events, "events per second": per_s,
        "pages p50 ms": round(median(run.pages_ms), 1), "connections p50 ms": round(median(run.readers_ms), 1),
        "connections p95 ms": round(_p95(run.readers_ms), 1), "requests": run.requests, "failed": run.failed,
        "changes seen in pages": len(run.pages_ms), "changes that could be seen": run.wanted,
    }  # fmt: skip
    title = f"{readers} browsers, {per_s:g} events/s"
    return [
        figure(
            f"commit to changed DOM, {title}, p95", unit="ms", ours=round(_p95(run.pages_ms), 1), n=len(run.pages_ms),
            environment=environment, targets=(Target(f"<= {TARGET_MS:g} ms", TARGET_MS, "lower"),), detail=detail,
        ),
        figure(
            f"the console's share of one core, {title}", unit="cores", ours=round(run.cpu, 2), n=events,
            environment=environment,
            targets=(Target(f"< {TARGET_SHARE:g}", TARGET_SHARE, "lower"),), detail=detail,
        ),
    ]  # fmt: skip


def _run(*, readers: int, pages: int, events: int, per_s: float) -> MeasuredRun:
    executable, spawn = _executable(), multiprocessing.get_context("spawn")
    near, far = spawn.Pipe()
    child = spawn.Process(target=_console, args=(far, events, per_s, pages + 1), daemon=True)
    child.start()
    far.close()
    try:
        address, mission_id, links = near.recv()
        plan = BrowserPlan(address=address, mission_id=mission_id, links=tuple(links), readers=readers)
        return asyncio.run(_stretch(plan, near, executable))
    finally:
        if child.is_alive():
            near.send("end")
        child.join(timeout=20)


async def _stretch(plan: BrowserPlan, near: Connection, executable: Path) -> MeasuredRun:
    """Sign everybody in, let the console commit, and collect what was seen."""
    found = BrowserReaders()
    async with async_playwright() as driver, httpx.AsyncClient() as client:
        cookie = "; ".join(f"{k}={v}" for k, v in (await client.get(plan.address + plan.links[0])).cookies.items())
        running = await driver.chromium.launch(executable_path=executable, args=list(chromium.FLAGS))
        readers = [asyncio.create_task(_reader(plan, cookie, found)) for _ in range(plan.readers)]
        opened = await _opened(running, plan, plan.links[1:])
        await asyncio.sleep(SETTLE_S)
        near.send("go")
        committed, cpu = await asyncio.to_thread(near.recv)
        await asyncio.sleep(SETTLE_S)
        seen = [await page.evaluate("window.seen") for page in opened]
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)
        await running.close()
    return MeasuredRun(
        pages_ms=tuple(1000 * (at - committed[int(tick)]) for one in seen for tick, at in one.items()),
        readers_ms=tuple(1000 * (at - committed[tick]) for tick, times in found.seen.items() for at in times),
        cpu=cpu,
        requests=found.requests,
        failed=found.failed,
        wanted=len(committed) * len(opened),
    )


async def _reader(plan: BrowserPlan, cookie: str, found: BrowserReaders) -> None:
    """A page without a browser: reads signal names, fetches regions. Speaks HTTP/1.1 itself, to use little of the
    machine.

    After each signal it does what static/js does: the whole region at once, a little later the bar and the rail.
    """
    topics = "&".join(f"topic={name}" for name in (f"mission/{plan.mission_id}", "mission/", "handoff/", "alert/"))
    instant, shell = asyncio.Event(), asyncio.Event()
    whole, counts = (f"/missions/{plan.mission_id}/instant",), ("/overview/bar", "/overview/rail?section=missions")
    fetching = (
        asyncio.create_task(_fetching(plan, cookie, instant, found, paths=whole)),
        asyncio.create_task(_fetching(plan, cookie, shell, found, paths=counts, after_s=FIRST_S, every_s=SHELL_S)),
    )
    names, way = await asyncio.open_connection("127.0.0.1", plan.port)
    try:
        way.write(_request(f"/live?{topics}", plan, cookie))
        while line := await names.readline():
            if line.startswith(b"data: mission/"):
                instant.set()
                shell.set()
    finally:
        for task in fetching:
            task.cancel()
        way.close()


async def _fetching(
    plan: BrowserPlan,
    cookie: str,
    changed: asyncio.Event,
    found: BrowserReaders,
    *,
    paths: Sequence[str],
    after_s: float = 0.0,
    every_s: float = 0.0,
) -> None:
    """Each path over one connection of its own: `after_s` after a signal, at most once in `every_s`."""
    newest = -1
    answers, way = await asyncio.open_connection("127.0.0.1", plan.port, limit=2**20)
    while True:
        await changed.wait()
        changed.clear()
        await asyncio.sleep(after_s)
        for path in paths:
            way.write(_request(path, plan, cookie))
            head = (await answers.readuntil(b"\r\n\r\n")).lower()
            length = int(head.split(b"content-length: ")[1].split(b"\r\n")[0])
            body = await answers.readexactly(length)
            found.requests += 1
            found.failed += not head.startswith(b"http/1.1 200")
            newest = found.note(body, newest)
        await asyncio.sleep(every_s)


def _request(path: str, plan: BrowserPlan, cookie: str) -> bytes:
    lines = (f"GET {path} HTTP/1.1", f"Host: 127.0.0.1:{plan.port}", f"Cookie: {cookie}", "HX-Request: true", "", "")
    return "\r\n".join(lines).encode()


async def _opened(running: Browser, plan: BrowserPlan, links: Sequence[str]) -> list[Page]:
    """Real pages of the mission, each with its own person, observing their own first line."""
    opened = []
    for link in links:
        page = await (await running.new_context()).new_page()
        await page.route("**/scene/**", lambda route: route.abort())
        await page.goto(plan.address + link)
        await page.wait_for_url("**/")
        await page.goto(f"{plan.address}/missions/{plan.mission_id}")
        await page.wait_for_selector("body[data-link=live]")
        await page.evaluate(SEEN)
        opened.append(page)
    return opened


def _console(way: Connection, events: int, per_s: float, entries: int) -> None:
    """The console's own process: reports its address, commits when asked, and reports the time and the cost of
    each commit.
    """
    broker = SignalBroker()
    with (
        simulated(HarnessSettings(fidelity="kinematic", speed=0), simulator=SIMULATOR, seed=1) as harness,
        bind(0) as listener,
    ):
        mission_id = _under_way(harness)
        settings = ConsoleSettings(
            port=listener.getsockname()[1],
            robots=("vbot-1",),
            owner_token=SecretStr("t"),
            rate_per_s=1e6,
            rate_burst=1e6,
            streams=10_000,
            connections=10_000,
        )
        app = create_app(
            harness.runtime,
            settings,
            broker,
            Scenes(harness.runtime),
            accounts=open_accounts(settings),
            answer=harness.supervisor.answer,
        )
        server = uvicorn.Server(uvicorn.Config(app, log_level="error", timeout_graceful_shutdown=1))
        serving = Thread(target=server.run, kwargs={"sockets": [listener]})
        serving.start()
        links = [app.state.sessions.invite() for _ in range(entries)]
        way.send((f"http://127.0.0.1:{settings.port}", mission_id, links))
        way.recv()
        way.send(_committing(harness.runtime, broker, mission_id, events=events, per_s=per_s))
        way.recv()
        broker.close()
        server.should_exit = True
        serving.join(timeout=10)


def _under_way(harness: Harness) -> MissionId:
    """A mission that has begun; nothing advances it while it is observed."""
    decision = harness.runtime.start(
        Start(actor=ADA, robot_id=RobotId("vbot-1"), template="warehouse-inspection", seed=1)
    )
    assert isinstance(decision, Accepted), decision
    mission_id = harness.runtime.missions()[0].mission_id
    while harness.runtime.mission(mission_id).status != "active":
        harness.clock.wait_until(harness.supervisor.step(mission_id) or 0.0)
    return mission_id


def _committing(
    runtime: Runtime, broker: SignalBroker, mission_id: MissionId, *, events: int, per_s: float
) -> tuple[dict[int, float], float]:
    """The time at which each pause was in the log, and this process's CPU time over wall time meanwhile."""
    committed: dict[int, float] = {}
    begun_s, used_s = time.perf_counter(), time.process_time()
    for number in range(events):
        time.sleep(max(0.0, begun_s + number / per_s - time.perf_counter()))
        pauses = number % 2 == 0
        message = f"tick {number}"
        command = PauseMission(actor=ADA, reason=message) if pauses else ResumeMission(actor=ADA, reason=message)
        decision = runtime.submit(mission_id, command)
        assert isinstance(decision, Accepted), decision
        committed[number] = time.time()
        broker.changed(f"mission/{mission_id}")
    share = (time.process_time() - used_s) / (time.perf_counter() - begun_s)
    return committed, share


def _executable() -> Path:
    with sync_playwright() as driver:
        found = chromium.find(driver)
    if found is None:
        raise SystemExit("No Chromium works here: run `make install-test`")
    return found


def _p95(values: Sequence[float]) -> float:
    return quantiles(values, n=20)[-1] if len(values) > 1 else max(values, default=0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--browsers", type=int, default=100)
    parser.add_argument("--pages", type=int, default=3, help="how many of them are real Chromium pages")
    parser.add_argument("--events", type=int, default=100)
    parser.add_argument("--per-s", type=float, default=5.0)
    parser.add_argument("--keep", action="store_true", help="write the rows to docs/results")
    arguments = parser.parse_args()
    figures = measure(readers=arguments.browsers, pages=arguments.pages, events=arguments.events, per_s=arguments.per_s)
    print(table(figures))
    print(figures[0].detail)
    if arguments.keep:
        keep(figures)


if __name__ == "__main__":
    main()
