"""Kills a mission by SIGKILL at every fail-point, then again during recovery, and checks that it continues and nothing
starts twice.

Every run is a `regen` process of its own with the robot as its child. The fail-points are not listed here: a mission
without any kill runs first, and every kind of event in its log and every act of a provider becomes a point.
"""

import json
import signal
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from app.i18n.reasons.rendering import sentence
from experiments.campaigns.chance import uniform
from experiments.campaigns.ledgers import read_books
from experiments.campaigns.regen import KINEMATIC, regen
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.sql import SqlEventStore
from harness.auditing.replay import replay_mission
from harness.bootstrap import read_harness
from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId
from harness.contracts.ports import StoredEvent
from harness.contracts.values import Value
from harness.settings import HarnessSettings

SCENARIOS: tuple[tuple[str, ...], ...] = (
    (),
    ("early-success",),
    ("blocked-passage",),
    ("lost-localisation",),
    ("stale-pose:persistent",),
)
"""Faults of the missions that are killed: none; retried; answered by two rungs; waited out; asked of a person."""
ACTS: dict[str, tuple[str, ...]] = {
    "start": (),
    "report": (),
    "keepalive": (),
    "find": ("duplicate-request",),
}
"""Acts of a provider, each with the faults that lead to it."""
WHENS = ("before", "after")
ENDS = ("succeeded", "partly_verified", "failed", "awaiting_human", "safe_stopped")
SIDE_BY_SIDE = 4
SECOND = "after:report"


class KillPoint(Value):
    """A fail-point, in a mission with these faults of the robot."""

    faults: tuple[str, ...]
    name: str


class KillReport(Value):
    """The result of the kills. `kills` counts processes that really died by SIGKILL; second kills are counted apart.

    `idle`: points that no run of their mission reached.
    """

    points: int
    kills: int
    second_kills: int
    idle: tuple[str, ...]
    ends: dict[str, int]
    offences: tuple[str, ...]


class KilledMission(Value):
    """One mission that was killed, and killed again inside its recovery."""

    first: bool
    second: bool
    end: str
    wrong: tuple[str, ...]


def kill_campaign(*, most: int | None = None, seed: int = 1) -> KillReport:
    """Every point of every scenario, or `most` of them, drawn by the seed; SIDE_BY_SIDE missions at once."""
    points = every_point()
    if most is not None:
        points = sorted(points, key=lambda point: uniform(seed, point.faults, point.name))[:most]
    with ThreadPoolExecutor(SIDE_BY_SIDE) as threads:
        done = []
        for number, kill in enumerate(threads.map(killed_twice, points), start=1):
            done.append(kill)
            print(f"{number} of {len(points)} fail-points", file=sys.stderr, flush=True)
    found = list(zip(points, done, strict=True))
    return KillReport(
        points=len(points),
        kills=sum(kill.first for kill in done),
        second_kills=sum(kill.second for kill in done),
        idle=tuple(_title(point) for point, kill in found if not kill.first),
        ends=dict(Counter(kill.end for kill in done)),
        offences=tuple(f"{_title(point)}: {sentence}" for point, kill in found for sentence in kill.wrong),
    )


def every_point() -> list[KillPoint]:
    """Before and after each kind of commit that these missions make, and each act of a provider."""
    seen: set[frozenset[str]] = set()
    points = []
    for faults in SCENARIOS:
        with TemporaryDirectory(prefix="kills-") as folder:
            data = Path(folder)
            regen("mission", "run", "circuit", "--data", data, *_with(faults), *KINEMATIC)
            log = stored_log(data)
        counts: Counter[str] = Counter()
        for low, high in commits_of(log):
            kinds = list(dict.fromkeys(event.kind for event in log[low:high]))
            counts.update(kinds)
            if frozenset(kinds) in seen:
                continue
            seen.add(frozenset(kinds))
            rarest = min(kinds, key=lambda kind: counts[kind])
            points += [KillPoint(faults=faults, name=f"{when}:{rarest}#{counts[rarest]}") for when in WHENS]
    acts = [KillPoint(faults=faults, name=f"{when}:{act}") for act, faults in ACTS.items() for when in WHENS]
    return [*points, *acts]


def _title(point: KillPoint) -> str:
    return f"{point.name} ({' '.join(point.faults) or 'no fault'})"


def killed_twice(point: KillPoint) -> KilledMission:
    """One mission in its own folder: killed at the point, killed again once it continues, then run to the end."""
    with TemporaryDirectory(prefix="kills-") as folder:
        data = Path(folder)
        run = ("mission", "run", "circuit", "--data", data, *_with(point.faults), *KINEMATIC)
        first = regen(*run, REGEN_FAILPOINT=point.name).returncode == -signal.SIGKILL
        missions = _missions(data)
        if not missions:
            return KilledMission(first=first, second=False, end="never created", wrong=() if first else ("no mission",))
        resume = ("mission", "resume", missions[0], "--data", data, *KINEMATIC)
        second = first and regen(*resume, REGEN_FAILPOINT=SECOND).returncode == -signal.SIGKILL
        last = regen(*resume) if first else None
        wrong = list(offences_in(data, missions[0]))
        status = _status(data, missions[0])
        if last is not None and last.returncode not in (0, 1, 3):
            wrong.append(f"the last resume ended with {last.returncode}: {last.stderr[-300:]}")
        if status not in ENDS:
            wrong.append(f"the mission is left {status}")
        return KilledMission(first=first, second=second, end=status, wrong=tuple(wrong))


def offences_in(data: Path, mission_id: str) -> Iterator[str]:
    """What the log, the robot's journal and the auditor report against a mission, in sentences."""
    starts = data / "robots" / "vbot-1" / "starts.jsonl"
    lines = [json.loads(line) for line in starts.read_text().splitlines()] if starts.exists() else []
    requests = [line["request_id"] for line in lines]
    if len(requests) != len(set(requests)):
        yield "a request started twice"
    log = stored_log(data)
    books = read_books(log, commits_of(log))
    intended = {intent.request_id for intent in books.intents.values()}
    if not set(requests) <= intended:
        yield "something started without an intent"
    yield from (*books.unauthorised, *books.breaches)
    with read_harness(HarnessSettings(data_folder=data)) as runtime:
        runtime.verify()
        yield from map(sentence, replay_mission(runtime, MissionId(mission_id)).differences)


def commits_of(log: Sequence[StoredEvent]) -> list[tuple[int, int]]:
    """Which events were appended together, as far as a finished log shows: the same two instants, unbroken."""
    edges = [0]
    for place, (before, after) in enumerate(pairwise(log), start=1):
        if (before.recorded_s, before.mission_s) != (after.recorded_s, after.mission_s):
            edges.append(place)
    return list(zip(edges, [*edges[1:], len(log)], strict=True))


def _status(data: Path, mission_id: str) -> str:
    with read_harness(HarnessSettings(data_folder=data)) as runtime:
        return runtime.mission(MissionId(mission_id)).status


def _missions(data: Path) -> list[str]:
    try:
        with read_harness(HarnessSettings(data_folder=data)) as runtime:
            return [mission.mission_id for mission in runtime.missions()]
    except HarnessError:
        return []


def stored_log(data: Path) -> list[StoredEvent]:
    """Every event in the log of a data folder."""
    store = SqlEventStore(prepare(data).log_url)
    try:
        return store.read(limit=1_000_000)
    finally:
        store.close()


def _with(faults: Sequence[str]) -> tuple[str, ...]:
    return tuple(word for fault in faults for word in ("--fault", fault))
