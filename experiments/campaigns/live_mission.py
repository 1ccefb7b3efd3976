"""Runs one mission over HTTP as somebody outside sees it: a console or a worker in a process of its own, a reader of
its log, and what the robot itself kept of the truth.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal

from experiments.campaigns.kills import commits_of
from experiments.campaigns.ledgers import read_books
from experiments.campaigns.regen import ROOT
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.sql import SqlEventStore
from harness.conformance.hostile.truth import metric_of, truly_reached
from harness.contracts.errors import HarnessError
from harness.contracts.ports import StoredEvent
from harness.contracts.reasons import Reason, plain
from harness.contracts.values import decode
from simulator.truth import Truth

HostKind = Literal["console", "worker"]
SPEED = ("--speed", "4", "--fidelity", "kinematic")
LASTS_S = 45.0
"""About how long an undisturbed circuit takes, in mission seconds: what goes wrong comes within this."""
PATIENCE_S = 900.0
"""Wall seconds after which a mission counts as one without an end: no verdict rests on how fast the machine is."""
POLL_S = 0.05


class LogReader:
    """Follows a log as somebody who was told of each event: `seen` are the digests by position."""

    def __init__(self, data: Path) -> None:
        self._data = data
        self._known: tuple[tuple[int, int], ...] = ()
        self.seen: dict[int, str] = {}
        self.mission_id = self.asked = ""
        self.status = "never created"

    def look(self) -> None:
        """Read what is new; nothing while there is no log, while it is busy, or while its files stay as they are."""
        files = self._files()
        if not files or files == self._known:
            return
        try:
            store = SqlEventStore(prepare(self._data).log_url)
            try:
                for event in store.read(after=max(self.seen, default=0), limit=100_000):
                    self._take(event)
            finally:
                store.close()
        except HarnessError:
            return
        self._known = files

    def _files(self) -> tuple[tuple[int, int], ...]:
        """Size and time of the log's files; none while there is no log."""
        found = []
        for name in ("events.db", "events.db-wal"):
            with suppress(FileNotFoundError):
                stat = (self._data / name).stat()
                found.append((stat.st_size, stat.st_mtime_ns))
        return tuple(found)

    def is_over(self) -> bool:
        """Whether the mission is over or waits for a person."""
        return self.status in ("succeeded", "partly_verified", "failed", "cancelled", "safe_stopped", "awaiting_human")

    def lost(self, log: Sequence[StoredEvent]) -> int:
        """How many events that were read are not there any more, or say something else."""
        now = {event.position: event.digest for event in log}
        return sum(now.get(position) != digest for position, digest in self.seen.items())

    def _take(self, event: StoredEvent) -> None:
        self.seen[event.position] = event.digest
        body = json.loads(event.body)
        match event.kind:
            case "MissionCreated":
                self.mission_id, self.status = event.stream.partition("/")[2], "draft"
            case "MissionEnded":
                self.status = str(body["status"])
            case "HandoffRequested" | "HandoffOpened":
                self.status, self.asked = "awaiting_human", self.asked or _about(body)
            case _ if self.status == "draft":
                self.status = "active"


def _about(body: dict[str, object]) -> str:
    """Of which class the failure is that a person is asked about; else the question in plain words."""
    for name in ("failure", "failure_class"):
        if isinstance(found := body.get(name), str) and found:
            return found
    reason = body.get("reason")
    return plain(decode(json.dumps(reason).encode(), Reason))[:60] if isinstance(reason, dict) else str(reason)[:60]


def started(
    host: HostKind,
    data: Path,
    *,
    first: bool,
    mission_id: str = "",
    changes: Mapping[str, str] | None = None,
) -> subprocess.Popen[bytes]:
    """A console or a worker on this folder, with a mission to begin or the one that was left open.

    What it says on standard error is added to a file beside the folder. `changes` of its environment.
    """
    if host == "console":
        words = [
            "up",
            "--data",
            str(data),
            "--port",
            "0",
            *SPEED,
            *(("--start", "circuit", "--start-now") if first else ()),
        ]
    elif first or not mission_id:
        words = ["mission", "run", "circuit", "--data", str(data), *SPEED, "--json"]
    else:
        words = ["mission", "resume", mission_id, "--data", str(data), *SPEED, "--json"]
    plain_environment = {name: value for name, value in os.environ.items() if not name.startswith("REGEN_")}
    with (data.parent / f"{data.name}.err").open("ab") as errors:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "app.cli.main", *words],
            cwd=ROOT,
            env={**plain_environment, "PYTHONPATH": str(ROOT), **(changes or {})},
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )


def until(true: Callable[[], bool], reader: LogReader, *, seconds: float) -> bool:
    end_s = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end_s:
            return False
        time.sleep(POLL_S)
        reader.look()
    return True


def end_host(host: subprocess.Popen[bytes]) -> None:
    """End a host in order; its robot stands and ends by itself."""
    if host.poll() is None:
        host.terminate()
        try:
            host.wait(timeout=60)
        except subprocess.TimeoutExpired:
            host.kill()
            host.wait()


def attachment(data: Path) -> Path:
    return data / "robots" / "vbot-1" / "robot.json"


def truth_of(data: Path) -> list[Truth]:
    """What the robot's process wrote of the truth, in order of time; whole lines only."""
    files = sorted((data / "robots" / "vbot-1" / "truth").glob("*.jsonl"))
    lines = (line for file in files for line in file.read_bytes().split(b"\n")[:-1])
    return sorted((decode(line, Truth) for line in lines), key=lambda one: one.at_s)


def doubled_starts(data: Path) -> int:
    file = data / "robots" / "vbot-1" / "starts.jsonl"
    requests = [json.loads(line)["request_id"] for line in file.read_text().splitlines()] if file.exists() else []
    return len(requests) - len(set(requests))


def false_completions(data: Path, log: Sequence[StoredEvent]) -> Iterator[str]:
    """Stages that were accepted and where the body was not, by what the robot itself kept of the truth."""
    books, truth = read_books(log, commits_of(log)), truth_of(data)
    for event in books.committed:
        node, packet = books.node(event.node_id), books.packets.get(event.packet_id)
        effect = metric_of(node) if node is not None else None
        if packet is None:
            yield f"{event.node_id} was committed on a packet that is not there"
        elif effect is not None:
            begun_s = min(one.dispatched_s for one in books.intents.values() if one.node_id == event.node_id) - 3.0
            why = truly_reached(effect, truth, from_s=begun_s, at_s=packet.collected_s)
            if why:
                yield f"{event.node_id}: {why}"
