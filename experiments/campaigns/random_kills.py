"""Kills the console, a worker or the robot by SIGKILL at a random instant of a mission over HTTP, starts again what a
service manager would, answers no question, and counts what came of it.

The console is `regen up`, a worker is a `regen mission run` without pages, the robot is their child behind the HTTP
provider protocol. A reader follows the log while they work: what it has read must still stand there in the end.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, get_args

from experiments.campaigns.chance import between
from experiments.campaigns.kills import offences_in, stored_log
from experiments.campaigns.live_mission import (
    LASTS_S,
    PATIENCE_S,
    POLL_S,
    HostKind,
    LogReader,
    attachment,
    doubled_starts,
    end_host,
    false_completions,
    started,
    truth_of,
    until,
)
from harness.contracts.values import Value
from rsi_reviews.bounds import upper_bound

Target = Literal["console", "worker", "robot"]
TARGETS: tuple[Target, ...] = get_args(Target)
LEAST_SHARE = 0.6


class InstantKill(Value):
    """One kill: of whom, how many mission seconds after the robot began the mission, and who supervises."""

    number: int
    target: Target
    host: HostKind
    at_s: float


class InstantOutcome(Value):
    """What came of one mission. `struck`: the process died by SIGKILL before the mission's end; `asked`: about what."""

    kill: InstantKill
    struck: bool
    end: str
    asked: str = ""
    false_completions: tuple[str, ...] = ()
    lost_events: int = 0
    duplicate_starts: int = 0
    wrong: tuple[str, ...] = ()


class TargetCount(Value):
    """Missions of one target. `succeeded`: without any person's answer; `ends`, `questions`: what became of all."""

    struck: int
    succeeded: int
    ends: dict[str, int]
    questions: dict[str, int]


class RandomKillReport(Value):
    """All kills. `upper_bounds`: the largest share of missions that each zero does not refute (95 %)."""

    instants: int
    missed: int
    targets: dict[str, TargetCount]
    false_completions: int
    lost_events: int
    read_events: int
    duplicate_starts: int
    upper_bound: float
    offences: tuple[str, ...]


def random_kills(
    instants: int,
    *,
    first: int = 0,
    seed: int = 1,
    minutes: float | None = None,
    missions_at_once: int = 1,
    keep: Path | None = None,
) -> RandomKillReport:
    """That many kills from the one with the number `first` on, the targets in turn, or as many as were begun within
    `minutes`.

    The folders of missions that did not succeed are copied to `keep`.
    """
    until_s = time.monotonic() + 60.0 * minutes if minutes is not None else float("inf")

    def one(number: int) -> tuple[InstantOutcome, int] | None:
        if time.monotonic() > until_s:
            return None
        kill = instant(number, seed)
        try:
            outcome, read = killed_at(kill, keep=keep)
        except Exception as error:  # noqa: BLE001 - one mission that cannot be judged must not hide the others
            outcome, read = InstantOutcome(kill=kill, struck=False, end="not judged", wrong=(repr(error)[:300],)), 0
        struck = "" if outcome.struck else ", not struck"
        line = f"{number}: {outcome.kill.target} at {outcome.kill.at_s:.1f} s, {outcome.end} {outcome.asked}{struck}"
        print(line, file=sys.stderr, flush=True)
        return outcome, read

    with ThreadPoolExecutor(missions_at_once) as pool:
        done = [found for found in pool.map(one, range(first, first + instants)) if found is not None]
    return reported([outcome for outcome, _ in done], read_events=sum(read for _, read in done))


def instant(number: int, seed: int) -> InstantKill:
    """The kill of that number: targets in turn, hosts of a killed robot in turn, the instant by the seed."""
    target = TARGETS[number % len(TARGETS)]
    host = target if target != "robot" else ("console", "worker")[number // len(TARGETS) % 2]
    return InstantKill(number=number, target=target, host=host, at_s=between(seed, 0.0, LASTS_S, "instant", number))


def reported(done: Sequence[InstantOutcome], *, read_events: int) -> RandomKillReport:
    """The counts per target; an offence is what must never be, and a target that a person had to help too often."""
    targets: dict[str, TargetCount] = {}
    for target in TARGETS:
        mine = [one for one in done if one.kill.target == target and one.struck]
        targets[target] = TargetCount(
            struck=len(mine),
            succeeded=sum(one.end == "succeeded" and not one.asked for one in mine),
            ends=dict(Counter(one.end for one in mine)),
            questions=dict(Counter(one.asked for one in mine if one.asked)),
        )
    struck = [one for one in done if one.struck]
    offences = [f"{_title(one.kill)}: {sentence}" for one in done for sentence in one.wrong]
    offences += [f"{_title(one.kill)}: false: {why}" for one in done for why in one.false_completions]
    offences += [f"{_title(one.kill)}: {one.lost_events} events lost" for one in done if one.lost_events]
    offences += _helped_too_often(targets)
    return RandomKillReport(
        instants=len(done),
        missed=len(done) - len(struck),
        targets=targets,
        false_completions=sum(len(one.false_completions) for one in done),
        lost_events=sum(one.lost_events for one in done),
        read_events=read_events,
        duplicate_starts=sum(one.duplicate_starts for one in done),
        upper_bound=upper_bound(0, len(struck)) if struck else 1.0,
        offences=tuple(offences),
    )


def _helped_too_often(targets: Mapping[str, TargetCount]) -> list[str]:
    return [
        f"of {count.struck} missions after a kill of the {name}, {count.succeeded} succeeded without a person"
        for name, count in targets.items()
        if count.succeeded < LEAST_SHARE * count.struck
    ]


def joined(before: RandomKillReport, more: RandomKillReport) -> RandomKillReport:
    """The counts of two runs over different instants."""
    targets = {
        name: TargetCount(
            struck=one.struck + other.struck,
            succeeded=one.succeeded + other.succeeded,
            ends=dict(Counter(one.ends) + Counter(other.ends)),
            questions=dict(Counter(one.questions) + Counter(other.questions)),
        )
        for name, one in before.targets.items()
        for other in (more.targets[name],)
    }
    struck = sum(one.struck for one in targets.values())
    single = [
        offence for run in (before, more) for offence in run.offences if offence not in _helped_too_often(run.targets)
    ]
    return RandomKillReport(
        instants=before.instants + more.instants,
        missed=before.missed + more.missed,
        targets=targets,
        false_completions=before.false_completions + more.false_completions,
        lost_events=before.lost_events + more.lost_events,
        read_events=before.read_events + more.read_events,
        duplicate_starts=before.duplicate_starts + more.duplicate_starts,
        upper_bound=upper_bound(0, struck) if struck else 1.0,
        offences=(*single, *_helped_too_often(targets)),
    )


def _title(kill: InstantKill) -> str:
    return f"{kill.number}, {kill.target} at {kill.at_s:.1f} s"


def killed_at(kill: InstantKill, *, keep: Path | None = None) -> tuple[InstantOutcome, int]:
    """One mission in its own folder, killed once; and how many events a reader had seen before the end."""
    with TemporaryDirectory(prefix="instant-") as folder:
        data = Path(folder) / "data"
        data.mkdir()
        reader = LogReader(data)
        host = started(kill.host, data, first=True)
        try:
            struck = _strike(kill, data, host, reader)
            if struck and kill.target != "robot":
                host = started(kill.host, data, first=False, mission_id=reader.mission_id)
            ended = until(lambda: reader.is_over() or host.poll() is not None, reader, seconds=PATIENCE_S)
            ended = (ended and until(reader.is_over, reader, seconds=POLL_S)) or reader.is_over()
        finally:
            end_host(host)
        log = stored_log(data)
        wrong = [] if ended else [f"the mission has no end after {PATIENCE_S:.0f} s: {reader.status}"]
        wrong += offences_in(data, reader.mission_id) if reader.mission_id else ["no mission was created"]
        outcome = InstantOutcome(
            kill=kill,
            struck=struck,
            end=reader.status,
            asked=reader.asked,
            false_completions=tuple(false_completions(data, log)),
            lost_events=reader.lost(log),
            duplicate_starts=doubled_starts(data),
            wrong=tuple(wrong),
        )
        if keep is not None and (outcome.end != "succeeded" or outcome.wrong):
            shutil.copytree(folder, keep / str(kill.number), dirs_exist_ok=True)
        return outcome, len(reader.seen)


def _strike(kill: InstantKill, data: Path, host: subprocess.Popen[bytes], reader: LogReader) -> bool:
    """Wait for the instant, by the robot's own time, and kill; False if the mission was over before."""

    def due() -> bool:
        truth = truth_of(data)
        return bool(truth) and truth[-1].at_s - truth[0].at_s >= kill.at_s

    until(lambda: due() or reader.is_over() or host.poll() is not None, reader, seconds=PATIENCE_S)
    if reader.is_over() or host.poll() is not None or not due():
        return False
    pid = host.pid if kill.target != "robot" else int(json.loads(attachment(data).read_text())["pid"])
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return False
    if kill.target != "robot":
        host.wait()
    reader.look()
    return True
