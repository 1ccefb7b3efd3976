"""Three workers with eight robots each on one PostgreSQL, in virtual time: one worker is killed half-way, one robot's
link is down for a minute. Nothing may be lost or doubled.

Each worker is a process with its robots; SIGKILL takes both, as a power failure would, and a new process goes on from
the log and from what the robots kept. Every mission is judged from outside, and so is the whole log at the end.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from experiments.campaigns.fleet_shift import ENOUGH, FleetShift, JudgedMission, LinkCut, judged_missions
from experiments.campaigns.ledgers import exclusive_leases
from experiments.campaigns.regen import ROOT
from experiments.campaigns.simulate import CampaignWorkersLost, seeds_of
from experiments.campaigns.tally import Tally
from experiments.campaigns.workers import doubled, lost
from harness.adapters.stores.postgres import PostgresEventStore
from harness.contracts.errors import HarnessError
from harness.contracts.ports import StoredEvent
from harness.contracts.values import Value
from tools.postgres import PostgresServer, running_server, standing_server

PAGE, RESULTS = ROOT / "docs" / "reliability.md", ROOT / "docs" / "results" / "fleet.json"
BEGIN, END = "<!-- fleet: written by `python -m experiments.campaigns fleet` -->", "<!-- end of fleet -->"
WORKERS, ROBOTS_EACH, MISSIONS_EACH = 3, 8, 100
DOWN_S = 60.0
LOOK_EVERY_S = 0.2
TELL_S = 20.0
EXAMPLES = 20


class FleetReport(Value):
    """The result. `begun_before`: missions that another process went on with than the one that began them.

    `unanswered`: calls to the robot whose link was down. `seconds`: wall time of all sittings together.
    """

    missions: int
    planned: int
    workers: int
    robots: int
    kills: int
    begun_before: int
    cut_for_s: float
    cut_missions: int
    unanswered: int
    acknowledged: int
    events: int
    dispatches: int
    starts: int
    commits: int
    ends: dict[str, int]
    lost: int
    doubled: int
    seconds: float
    sittings: int
    cores: int
    command: str
    offences: tuple[str, ...]


class Sittings(Value):
    """How long a campaign of several sittings took so far, and whether its worker was killed."""

    seconds: float = 0.0
    number: int = 0
    kills: int = 0


def fleet_missions(
    missions_each: int,
    *,
    seed: int,
    workers: int = WORKERS,
    robots_each: int = ROBOTS_EACH,
    minutes: float | None = None,
    folder: Path | None = None,
    command: str = "",
) -> FleetReport:
    """Run so many missions of each robot, or what `minutes` allow, then judge. With a `folder`, a further call with it
    goes on where this one ended."""
    with ExitStack() as stack:
        if folder is None:
            server = stack.enter_context(running_server())
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="fleet-")))
        else:
            server = stack.enter_context(standing_server(folder / "postgres"))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / ENOUGH).unlink(missing_ok=True)
        shifts = _shifts(folder, _url(folder, server), seed, missions_each, workers, robots_each)
        run = _Sitting(folder, shifts, missions=missions_each * robots_each * workers, minutes=minutes)
        sittings = run.work()
        return _report(shifts, sittings, command=command)


def _url(folder: Path, server: PostgresServer) -> str:
    """The campaign's database, the same at each sitting."""
    file = folder / "database"
    if not file.exists():
        url = server.database()
        PostgresEventStore(url).close()
        file.write_text(url, encoding="utf-8")
    return file.read_text(encoding="utf-8")


def _shifts(
    folder: Path, url: str, seed: int, missions_each: int, workers: int, robots_each: int
) -> tuple[FleetShift, ...]:
    names = [[f"vbot-{worker + 1}-{robot + 1}" for robot in range(robots_each)] for worker in range(workers)]
    fleet = [name for mine in names for name in mine]
    seeds = seeds_of(seed, missions_each * len(fleet))
    by_robot = {name: tuple(seeds[number :: len(fleet)]) for number, name in enumerate(fleet)}
    cut = LinkCut(robot_id=fleet[0], mission=missions_each // 3, for_s=DOWN_S)
    return tuple(
        FleetShift(
            url=url,
            folder=str(folder),
            number=number,
            seeds={name: by_robot[name] for name in mine},
            cut=cut if number == 0 else None,
        )
        for number, mine in enumerate(names)
    )


class _Sitting:
    """Runs the workers until all is judged or the time is over. The middle one is killed half-way, once."""

    def __init__(self, folder: Path, shifts: Sequence[FleetShift], *, missions: int, minutes: float | None) -> None:
        self._folder, self._shifts, self._missions = folder, shifts, missions
        self._longest_s = None if minutes is None else 60.0 * minutes
        self._file = folder / "sittings.json"
        before = msgspec.json.decode(self._file.read_bytes(), type=Sittings) if self._file.exists() else Sittings()
        self._before, self._kills = before, before.kills
        self._begun_s = self._told_s = time.monotonic()
        self._running: dict[int, subprocess.Popen[bytes]] = {}

    def work(self) -> Sittings:
        """Raises CampaignWorkersLost where a worker ends badly that nobody killed."""
        try:
            for shift in self._shifts:
                self._start(shift)
            while self._running:
                time.sleep(LOOK_EVERY_S)
                self._look()
        finally:
            for one in self._running.values():
                one.kill()
                one.wait()
            self._save()
        return self._sittings()

    def _look(self) -> None:
        for number, one in tuple(self._running.items()):
            if one.poll() is not None:
                del self._running[number]
                if one.returncode:
                    error = (self._shifts[number].own / "errors").read_text(encoding="utf-8")[-2000:]
                    raise CampaignWorkersLost(
                        f"Worker {number} ended with {one.returncode}",
                        where="fleet",
                        do=f"look at what it said: {error}",
                    )
        done = sum(one.judged_file.read_bytes().count(b"\n") for one in self._shifts if one.judged_file.exists())
        if not self._kills and done >= self._missions // 2 and self._running:
            middle = len(self._shifts) // 2
            self._kill(self._shifts[middle if middle in self._running else min(self._running)])
        if self._longest_s is not None and time.monotonic() - self._begun_s > self._longest_s:
            (self._folder / ENOUGH).touch()
        if time.monotonic() - self._told_s > TELL_S:
            self._told_s = time.monotonic()
            print(f"{done} of {self._missions} missions", file=sys.stderr, flush=True)
            self._save()

    def _kill(self, victim: FleetShift) -> None:
        """SIGKILL, in the middle of whatever it does, and another process in its place."""
        process = self._running.pop(victim.number)
        process.kill()
        process.wait()
        self._kills += 1
        self._start(victim)

    def _start(self, shift: FleetShift) -> None:
        shift.own.mkdir(parents=True, exist_ok=True)
        file = shift.own / "shift.json"
        file.write_bytes(msgspec.json.encode(shift))
        with (shift.own / "errors").open("ab") as errors:
            self._running[shift.number] = subprocess.Popen(
                [sys.executable, "-m", "experiments.campaigns.fleet_shift", str(file)],
                cwd=ROOT,
                stderr=errors,
                stdin=subprocess.DEVNULL,
            )

    def _sittings(self) -> Sittings:
        seconds = self._before.seconds + time.monotonic() - self._begun_s
        return Sittings(seconds=seconds, number=self._before.number + 1, kills=self._kills)

    def _save(self) -> None:
        self._file.write_bytes(msgspec.json.encode(self._sittings()))


def _report(shifts: Sequence[FleetShift], sittings: Sittings, *, command: str) -> FleetReport:
    found = [one for shift in shifts for one in judged_missions(shift.judged_file)]
    acknowledged = [pair for shift in shifts for pair in _acknowledged(shift.acknowledged_file)]
    store = PostgresEventStore(shifts[0].url)
    broken: list[str] = []
    try:
        store.verify()
    except HarnessError as error:
        broken.append(f"the log does not verify: {error}")
    log = store.read(limit=100_000_000)
    store.close()
    offences = [*broken, *_wrong(log, found, acknowledged)]
    tally = Tally()
    for one in found:
        tally.add(one.seed, one.findings, struck=one.struck, end=one.end)
    return FleetReport(
        missions=tally.missions,
        planned=sum(len(seeds) for shift in shifts for seeds in shift.seeds.values()),
        workers=len(shifts),
        robots=sum(len(shift.seeds) for shift in shifts),
        kills=sittings.kills,
        begun_before=sum(one.begun_before for one in found),
        cut_for_s=DOWN_S,
        cut_missions=sum(bool(one.cut) for one in found),
        unanswered=sum(one.cut for one in found),
        acknowledged=len(acknowledged),
        events=len(log),
        dispatches=tally.acts["dispatches"],
        starts=tally.acts["starts"],
        commits=tally.acts["commits"],
        ends=dict(sorted(tally.ends.items())),
        lost=sum(one.endswith("is lost") for one in offences),
        doubled=sum(one.endswith("times") for one in offences) + tally.found["duplicate_starts"],
        seconds=round(sittings.seconds, 1),
        sittings=sittings.number,
        cores=os.cpu_count() or 1,
        command=command,
        offences=tuple(offences[:EXAMPLES]),
    )


def _wrong(
    log: Sequence[StoredEvent], found: Sequence[JudgedMission], acknowledged: Sequence[tuple[int, str]]
) -> Iterator[str]:
    """Contradictions between the log, the robots and the workers, and what is in the log twice."""
    for one in found:
        yield from (f"{one.mission_id} of seed {one.seed}: {sentence}" for sentence in one.findings.offences)
    yield from lost(log, acknowledged)
    yield from doubled(log)
    created = {msgspec.json.decode(event.body)["mission_id"] for event in log if event.kind == "MissionCreated"}
    judged = [one.mission_id for one in found]
    if len(set(judged)) != len(judged):
        yield f"{len(judged) - len(set(judged))} missions were judged more than once"
    yield from (f"{one} was created and never judged" for one in sorted(created - set(judged)))
    yield from exclusive_leases(log)


def _acknowledged(file: Path) -> Iterator[tuple[int, str]]:
    for line in file.read_text(encoding="ascii").splitlines(keepends=True) if file.exists() else ():
        if line.endswith("\n"):
            position, digest = line.split()
            yield int(position), digest


def run(arguments: argparse.Namespace) -> None:
    """Exit 1 if anything was found that must not be."""
    command = f"python -m experiments.campaigns fleet --missions {arguments.missions} --seed {arguments.seed}"
    report = fleet_missions(
        arguments.missions, seed=arguments.seed, minutes=arguments.minutes, folder=arguments.folder, command=command
    )
    body = msgspec.json.format(msgspec.json.encode(report), indent=2)
    print(body.decode())
    if arguments.publish:
        RESULTS.write_bytes(body + b"\n")
        PAGE.write_text(with_figures(PAGE.read_text(encoding="utf-8"), report), encoding="utf-8")
    if report.offences:
        raise SystemExit(1)


def with_figures(page: str, report: FleetReport) -> str:
    """The page with these figures between its two marks. Raises ValueError without them."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE.name} has no place for figures: {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n{figures(report)}{END}{after}"


def figures(report: FleetReport) -> str:
    """The table in Markdown."""
    ends = ", ".join(f"{count:,} {end.replace('_', ' ')}" for end, count in report.ends.items())
    rows = {
        "missions": f"{report.missions:,} of {report.planned:,} by {report.workers} workers with {report.robots} "
        f"robots on one PostgreSQL: {ends}",
        "workers killed": f"{report.kills}; {report.begun_before} missions went on under the next process",
        "link of one robot down": f"{report.cut_for_s:.0f} s of its time: {report.unanswered} calls not answered in "
        f"{report.cut_missions} missions",
        "found": f"{report.lost} lost of {report.acknowledged:,} acknowledged appends, {report.doubled} doubled, "
        f"{len(report.offences)} offences",
        "acts": f"{report.dispatches:,} dispatches, {report.starts:,} physical starts, {report.commits:,} commits, "
        f"{report.events:,} events",
        "time": f"{report.seconds / 60:.0f} min of wall time in {report.sittings} sittings, {report.cores} cores",
        "command": f"`{report.command}`",
    }
    return "\n".join(["", "| | |", "|---|---|", *(f"| {name} | {text} |" for name, text in rows.items()), "", ""])
