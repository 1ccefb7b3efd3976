"""Takes from a running mission what a machine may take: disk, files, memory, its store, its clock, its link, for some
seconds at a random instant; starts again what ended, answers no question, and counts what came of it.
"""

import os
import resource
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from experiments.campaigns.chance import between
from experiments.campaigns.kills import offences_in, stored_log
from experiments.campaigns.link import Link
from experiments.campaigns.live_mission import (
    LASTS_S,
    PATIENCE_S,
    LogReader,
    attachment,
    doubled_starts,
    end_host,
    false_completions,
    started,
    truth_of,
    until,
)
from experiments.campaigns.regen import ROOT
from harness.contracts.values import Value
from harness.provider_protocol.wire import Attachment

DISK_BYTES = 256 * 2**20
SPARE_BYTES = 8 * 2**20
FEW_FILES = 64
JUMP_S = 3600
MOST_LIVES = 4
"""How often a host is started again; a service manager would go on, and a mission that ends none is an offence."""
FAKETIME = tuple(
    Path(one)
    for one in (
        os.environ.get("FAKETIME_LIB", "/nowhere"),
        "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1",
        "/usr/lib/aarch64-linux-gnu/faketime/libfaketime.so.1",
    )
)


@dataclass
class FaultScene:
    """A mission under way: its folder, the host's process, and what the fault set up before it began."""

    data: Path
    host: subprocess.Popen[bytes]
    link: Link | None = None


Strike = Callable[[FaultScene], Iterator[None]]
"""Brings the fault about until it is asked for its next value, then takes it away."""


class HardFault(Value):
    """One fault of the machine at one instant, and for how many wall seconds."""

    name: str
    at_s: float
    lasts_s: float


class HardFaultOutcome(Value):
    """What came of it. `lives`: how often a host was started; `said`: what one that ended had said last."""

    fault: HardFault
    struck: bool
    end: str
    asked: str = ""
    lives: int = 1
    said: str = ""
    false_completions: tuple[str, ...] = ()
    lost_events: int = 0
    duplicate_starts: int = 0
    wrong: tuple[str, ...] = ()


class HardFaultReport(Value):
    """Counts by fault. `succeeded`: without any person's answer."""

    missions: int
    struck: dict[str, int]
    succeeded: dict[str, int]
    ends: dict[str, int]
    questions: dict[str, int]
    skipped: tuple[str, ...]
    false_completions: int
    lost_events: int
    duplicate_starts: int
    offences: tuple[str, ...]


def hard_faults(each: int, *, seed: int = 1) -> HardFaultReport:
    """Every fault that can be brought about here, `each` times."""
    able = [name for name in STRIKES if possible(name)]
    done = []
    for number in range(each):
        for name in able:
            one = HardFault(
                name=name,
                at_s=between(seed, 0.0, LASTS_S, name, "at", number),
                lasts_s=between(seed, 2.0, 20.0, name, "for", number),
            )
            done.append(struck_by(one))
            print(f"{name} at {one.at_s:.1f} s: {done[-1].end} {done[-1].asked}", file=sys.stderr, flush=True)
    return reported(done, skipped=tuple(name for name in STRIKES if name not in able))


def reported(done: Sequence[HardFaultOutcome], *, skipped: tuple[str, ...]) -> HardFaultReport:
    """The counts of these missions."""
    struck = [one for one in done if one.struck]
    offences = [f"{one.fault.name} at {one.fault.at_s:.1f} s: {sentence}" for one in done for sentence in one.wrong]
    offences += [f"{one.fault.name}: false: {why}" for one in done for why in one.false_completions]
    offences += [f"{one.fault.name}: {one.lost_events} events lost" for one in done if one.lost_events]
    return HardFaultReport(
        missions=len(done),
        struck=dict(Counter(one.fault.name for one in struck)),
        succeeded=dict(Counter(one.fault.name for one in struck if one.end == "succeeded" and not one.asked)),
        ends=dict(Counter(one.end for one in done)),
        questions=dict(Counter(f"{one.fault.name}: {one.asked}" for one in done if one.asked)),
        skipped=skipped,
        false_completions=sum(len(one.false_completions) for one in done),
        lost_events=sum(one.lost_events for one in done),
        duplicate_starts=sum(one.duplicate_starts for one in done),
        offences=tuple(offences),
    )


def struck_by(fault: HardFault) -> HardFaultOutcome:
    """One mission under one fault, in its own folder; hosts that ended are started again until it settles."""
    with ExitStack() as stack:
        root = Path(stack.enter_context(TemporaryDirectory(prefix="hard-")))
        data = root / "data"
        data.mkdir()
        changes = stack.enter_context(PREPARED.get(fault.name, _nothing)(data))
        link = stack.enter_context(_linked(data)) if fault.name == "link drops" else None
        reader = LogReader(data)
        scene = FaultScene(data=data, host=started("worker", data, first=True, changes=changes), link=link)
        stack.callback(lambda: end_host(scene.host))
        struck = _under(fault, scene, reader)
        lives = 1
        while not reader.is_over() and lives < MOST_LIVES:
            until(lambda: reader.is_over() or scene.host.poll() is not None, reader, seconds=PATIENCE_S)
            reader.look()
            if reader.is_over() or scene.host.poll() is None:
                break
            lives += 1
            scene.host = started("worker", data, first=False, mission_id=reader.mission_id, changes=changes)
        until(lambda: reader.is_over() or scene.host.poll() is not None, reader, seconds=PATIENCE_S)
        end_host(scene.host)
        reader.look()
        return _judged(fault, data, reader, struck=struck, lives=lives)


def _judged(fault: HardFault, data: Path, reader: LogReader, *, struck: bool, lives: int) -> HardFaultOutcome:
    log = stored_log(data)
    errors = (data.parent / f"{data.name}.err").read_text(errors="replace")
    wrong = [] if reader.is_over() else [f"the mission has no end: {reader.status}"]
    wrong += ["a traceback was shown"] if "Traceback (most recent call last)" in errors else []
    wrong += offences_in(data, reader.mission_id) if reader.mission_id else ["no mission was created"]
    return HardFaultOutcome(
        fault=fault,
        struck=struck,
        end=reader.status,
        asked=reader.asked,
        lives=lives,
        said=errors.strip()[-300:],
        false_completions=tuple(false_completions(data, log)),
        lost_events=reader.lost(log),
        duplicate_starts=doubled_starts(data),
        wrong=tuple(wrong),
    )


def _under(fault: HardFault, scene: FaultScene, reader: LogReader) -> bool:
    """Wait for the instant, bring the fault about, wait, take it away; False if the mission was over before."""

    def due() -> bool:
        truth = truth_of(scene.data)
        return bool(truth) and truth[-1].at_s - truth[0].at_s >= fault.at_s

    until(lambda: due() or reader.is_over() or scene.host.poll() is not None, reader, seconds=PATIENCE_S)
    if reader.is_over() or scene.host.poll() is not None:
        return False
    strike = STRIKES[fault.name](scene)
    try:
        next(strike)
    except (OSError, ProcessLookupError, subprocess.SubprocessError):
        return False
    end_s = time.monotonic() + fault.lasts_s
    until(lambda: scene.host.poll() is not None or time.monotonic() > end_s, _Blind(), seconds=PATIENCE_S)
    with suppress(StopIteration, OSError, ProcessLookupError):
        next(strike)
    return True


class _Blind(LogReader):
    """Reads nothing while a fault strikes: a reader would meet it too."""

    def __init__(self) -> None:
        super().__init__(Path("/nowhere"))

    def look(self) -> None:
        """Nothing."""


def _full_disk(scene: FaultScene) -> Iterator[None]:
    ballast = scene.data / "ballast"
    with ballast.open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(bytes(65536))
    yield
    ballast.unlink()


def _read_only_disk(scene: FaultScene) -> Iterator[None]:
    """The file system gives up, as after an I/O error, and goes read-only under open files. Whoever repairs it has to
    end host and robot first: they hold it open."""
    subprocess.run(["mount", "-o", "remount,abort", str(scene.data)], check=True, capture_output=True)
    yield
    robot = msgspec.json.decode(attachment(scene.data).read_bytes(), type=Attachment).pid
    end_host(scene.host)
    with suppress(ProcessLookupError):
        os.kill(robot, signal.SIGKILL)
    command = ["umount", str(scene.data)]
    until(lambda: subprocess.run(command, check=False, capture_output=True).returncode == 0, _Blind(), seconds=30.0)
    subprocess.run(["e2fsck", "-fy", str(_image(scene.data))], check=False, capture_output=True)
    _mount_image(scene.data)


def _unwritable(scene: FaultScene) -> Iterator[None]:
    """No file of the host can be written any more, those that are open included: as on a disk that went read-only."""
    yield from _limited(scene, resource.RLIMIT_FSIZE, 0)


def _few_files(scene: FaultScene) -> Iterator[None]:
    yield from _limited(scene, resource.RLIMIT_NOFILE, FEW_FILES)


def _little_memory(scene: FaultScene) -> Iterator[None]:
    status = Path(f"/proc/{scene.host.pid}/statm").read_text().split()
    used = int(status[0]) * resource.getpagesize()
    yield from _limited(scene, resource.RLIMIT_AS, used + SPARE_BYTES)


def _limited(scene: FaultScene, what: int, most: int) -> Iterator[None]:
    before = resource.prlimit(scene.host.pid, what)
    resource.prlimit(scene.host.pid, what, (most, before[1]))
    yield
    resource.prlimit(scene.host.pid, what, before)


def _locked(scene: FaultScene) -> Iterator[None]:
    connection = sqlite3.connect(scene.data / "events.db", timeout=30.0, isolation_level=None)
    connection.execute("BEGIN EXCLUSIVE")
    yield
    connection.execute("ROLLBACK")
    connection.close()


def _frozen(scene: FaultScene) -> Iterator[None]:
    pid = msgspec.json.decode(attachment(scene.data).read_bytes(), type=Attachment).pid
    os.kill(pid, signal.SIGSTOP)
    yield
    os.kill(pid, signal.SIGCONT)


def _suspended(scene: FaultScene) -> Iterator[None]:
    os.kill(scene.host.pid, signal.SIGSTOP)
    yield
    os.kill(scene.host.pid, signal.SIGCONT)


def _cut(scene: FaultScene) -> Iterator[None]:
    assert scene.link is not None
    scene.link.cut()
    yield
    scene.link.mend()


def _jump(seconds: int) -> Strike:
    def strike(scene: FaultScene) -> Iterator[None]:
        clock = scene.data.parent / "clock"
        clock.write_text(f"{seconds:+d}s\n")
        yield
        clock.write_text("+0s\n")

    return strike


STRIKES: Mapping[str, Strike] = {
    "disk full": _full_disk,
    "disk read-only": _read_only_disk,
    "nothing writable": _unwritable,
    "64 file descriptors": _few_files,
    "memory limit": _little_memory,
    "locked store": _locked,
    "robot frozen": _frozen,
    "host suspended": _suspended,
    "link drops": _cut,
    "clock an hour ahead": _jump(JUMP_S),
    "clock an hour back": _jump(-JUMP_S),
}


@contextmanager
def _nothing(data: Path) -> Iterator[dict[str, str]]:
    yield {}


@contextmanager
def _small_disk(data: Path) -> Iterator[dict[str, str]]:
    """A file system of its own in memory, so that it can be filled up."""
    size = f"size={DISK_BYTES}"
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "none", str(data)], check=True, capture_output=True)
    try:
        yield {}
    finally:
        subprocess.run(["umount", "--lazy", str(data)], check=False, capture_output=True)


@contextmanager
def _own_disk(data: Path) -> Iterator[dict[str, str]]:
    """A file system of its own on an image beside the folder."""
    with _image(data).open("wb") as file:
        file.truncate(DISK_BYTES)
    subprocess.run(["mkfs.ext4", "-q", "-F", str(_image(data))], check=True, capture_output=True)
    _mount_image(data)
    try:
        yield {}
    finally:
        subprocess.run(["umount", "--lazy", str(data)], check=False, capture_output=True)


def _image(data: Path) -> Path:
    return data.parent / f"{data.name}.ext4"


def _mount_image(data: Path) -> None:
    options = "loop,errors=remount-ro"
    subprocess.run(["mount", "-o", options, str(_image(data)), str(data)], check=True, capture_output=True)


@contextmanager
def _fake_clock(data: Path) -> Iterator[dict[str, str]]:
    """The host's wall clock follows a file; its monotonic clock stays what it is, as when a person sets the time."""
    clock = data.parent / "clock"
    clock.write_text("+0s\n")
    yield {
        "LD_PRELOAD": str(_library()),
        "FAKETIME_TIMESTAMP_FILE": str(clock),
        "FAKETIME_NO_CACHE": "1",
        "DONT_FAKE_MONOTONIC": "1",
    }


PREPARED = {
    "disk full": _small_disk,
    "disk read-only": _own_disk,
    "clock an hour ahead": _fake_clock,
    "clock an hour back": _fake_clock,
}


@contextmanager
def _linked(data: Path) -> Iterator[Link]:
    """A robot that runs already, and is reached over a link that can be cut: the host adopts it there."""
    folder = data / "robots" / "vbot-1"
    words = ["--dir", str(folder), "--port", "0", "--speed", "4.0", "--fidelity", "kinematic", "--linger-s", "5"]
    robot = subprocess.Popen([sys.executable, "-m", "simulator", *words], cwd=ROOT, stdout=subprocess.PIPE)
    assert robot.stdout is not None
    with robot.stdout as output:
        found = msgspec.json.decode(output.readline(), type=Attachment)
    link = Link(found.port)
    there = msgspec.json.encode(msgspec.structs.replace(found, port=link.port))
    attachment(data).write_bytes(there)
    try:
        yield link
    finally:
        link.close()
        robot.terminate()
        robot.wait()


def possible(name: str) -> bool:
    """Whether this machine lets the fault be brought about."""
    if name.startswith("clock"):
        return _library() is not None
    if name in ("disk full", "disk read-only"):
        with TemporaryDirectory(prefix="mount-") as folder:
            data = Path(folder) / "data"
            data.mkdir()
            with suppress(OSError, subprocess.SubprocessError), PREPARED[name](data):
                return True
            return False
    return True


def _library() -> Path | None:
    return next((one for one in FAKETIME if one.exists()), None)
