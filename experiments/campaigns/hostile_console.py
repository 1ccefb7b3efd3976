"""Meets lying robots under `regen up`: a console in a process of its own, missions started over its API, each on a
robot of its own that lies in one way; what came of them is read from the log, the journals and the simulated truth.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx

from experiments.campaigns.hostile_robot import OVERLAPPING
from experiments.campaigns.regen import ROOT
from harness.adapters.stores.owner import Owner
from harness.bootstrap import read_harness
from harness.conformance.hostile.kit import LieReport, counted
from harness.conformance.hostile.lies import Mode
from harness.conformance.hostile.missions import MissionUnderLie, after_unknown
from harness.conformance.hostile.truth import read_truth, untrue
from harness.contracts.events import NodeCommitted
from harness.contracts.ids import MissionId, ResourceId
from harness.contracts.protocol import PhysicalStart
from harness.contracts.reasons import plain
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.settings import HarnessSettings

SPEED = ("--speed", "4", "--fidelity", "kinematic")
UP_S, ROBOT_ENDS_S = 240.0, 60.0
LONGEST_S = 600.0
"""A mission that is neither over nor with a person by then, wall seconds, hangs; one exchange may take ten."""
POLL_S = 0.2
OVER = ("succeeded", "partly_verified", "failed", "cancelled", "safe_stopped", "handed_off", "awaiting_human", "paused")


@dataclass(frozen=True)
class RunningConsole:
    """A console that owns a data folder."""

    data: Path
    process: subprocess.Popen[bytes]
    client: httpx.Client

    def peak_mib(self) -> int:
        """The most memory that its process held, MiB."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii").splitlines()
        return int(next(line.split()[1] for line in lines if line.startswith("VmHWM:"))) >> 10


def met_under_console(
    modes: Sequence[Mode], *, at_once: int, seed: int, watch: Callable[[MissionUnderLie], None]
) -> LieReport:
    """Every mode once, `at_once` of them on one console, each on its own robot. The peak is that of the consoles."""
    found: list[MissionUnderLie] = []
    peaks = [0]
    for begin in range(0, len(modes), at_once):
        several = modes[begin : begin + at_once]
        with TemporaryDirectory(prefix="hostile-") as folder:
            met, peak = _met(several, Path(folder) / "data", seed=seed)
        found += met
        peaks.append(peak)
        for one in met:
            watch(one)
    return counted(found, peak_mib=max(peaks))


def _met(modes: Sequence[Mode], data: Path, *, seed: int) -> tuple[list[MissionUnderLie], int]:
    data.mkdir()
    robots = {f"vbot-{number}": mode for number, mode in enumerate(modes, start=1)}
    with _console(data, robots) as console:
        missions = {name: _start_mission(console, name, mode, seed=seed) for name, mode in robots.items()}
        ended = {name: _ended(console, missions[name]) for name in robots}
        answers = console.client.get("/api/v1/missions").is_success and console.process.poll() is None
        peak = console.peak_mib() if answers else 0
    errors = (data.parent / f"{data.name}.err").read_text(errors="replace")
    found = [
        _counted(data, mode, name, missions[name], hang=not ended[name] or not answers, errors=errors)
        for name, mode in robots.items()
    ]
    return found, peak


def _start_mission(console: RunningConsole, robot: str, mode: Mode, *, seed: int) -> str:
    """The mission of the lie; where an honest one goes before, that is waited for."""
    mission_id = ""
    for number in range(1 + mode.second):
        body = {"robot_id": robot, "template": mode.template, "seed": seed + number}
        answer = console.client.post("/api/v1/missions", json=body)
        answer.raise_for_status()
        mission_id = str(answer.json()["mission_id"])
        if number < mode.second:
            _ended(console, mission_id)
    return mission_id


def _ended(console: RunningConsole, mission_id: str) -> bool:
    """Whether the mission came to an end, or to a question."""
    end_s = time.monotonic() + LONGEST_S
    while time.monotonic() < end_s and console.process.poll() is None:
        if console.client.get(f"/api/v1/missions/{mission_id}").json()["status"] in OVER:
            return True
        time.sleep(POLL_S)
    return False


def _counted(data: Path, mode: Mode, robot: str, mission_id: str, *, hang: bool, errors: str) -> MissionUnderLie:
    folder = data / "robots" / robot
    journal = folder / "starts.jsonl"
    lines = journal.read_bytes().splitlines() if journal.exists() else []
    starts = [one for one in (decode(line, PhysicalStart) for line in lines) if one.mission_id == mission_id]
    mine = [one for one in starts if one.moves]
    with read_harness(HarnessSettings(data_folder=data)) as runtime:
        mission = runtime.mission(MissionId(mission_id))
        events = [DECIDER.codec.decode(event) for event in runtime.events(MissionId(mission_id))]
        streams = [one for one in runtime.streams("lease/") if one.startswith(f"lease/{robot}/")]
        leases = [runtime.lease(ResourceId(stream.partition("/")[2])) for stream in streams]
    why = "; ".join(untrue(mission.contract, events, read_truth(folder, mission_id))) if mission.contract else ""
    completed = mission.status == "succeeded"
    false = (completed and not mode.may_succeed) or bool(why)
    mark = "Traceback (most recent call last)"
    return MissionUnderLie(
        mode=mode.name,
        group=mode.group,
        text=mode.text,
        ended="hang" if hang else mission.status,
        why=plain(mission.reason)[:300],
        committed=tuple(one.node_id for one in events if isinstance(one, NodeCommitted)),
        completed=completed,
        false_completion=false and not mode.undetectable,
        epistemic=false and mode.undetectable,
        untrue=why,
        against_truth=True,
        motions=len(mine),
        second_motions=len(mine) - len({one.request_id for one in mine}) + _overlapping(folder) + after_unknown(events),
        hang=hang,
        traceback=errors[errors.index(mark) :][:2000] if mark in errors else "",
        held=tuple(str(one.resource) for one in leases if one.status == "held"),
        wall_s=0.0,
        peak_mib=0,
    )


def _overlapping(folder: Path) -> int:
    """What the robot's program wrote as it ended, which may be after its console. Raises RuntimeError without it."""
    end_s = time.monotonic() + ROBOT_ENDS_S
    while time.monotonic() < end_s:
        if (folder / OVERLAPPING).exists():
            return int((folder / OVERLAPPING).read_text())
        time.sleep(POLL_S)
    raise RuntimeError(f"the robot of {folder} did not end")


@contextmanager
def _console(data: Path, robots: Mapping[str, Mode]) -> Iterator[RunningConsole]:
    """`regen up` on this folder, with these robots; it is ended in order, and its robots with it."""
    lies = ",".join(f"{name}={mode.name}" for name, mode in robots.items())
    robot = json.dumps([sys.executable, "-m", "experiments.campaigns.hostile_robot", lies])
    own = {name: value for name, value in os.environ.items() if not name.startswith("REGEN_")}
    words = ["up", "--data", str(data), "--port", "0", *SPEED, "--robots", ",".join(robots)]
    with (data.parent / f"{data.name}.err").open("ab") as errors:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.cli.main", *words],
            cwd=ROOT,
            env={**own, "PYTHONPATH": str(ROOT), "REGEN_ROBOT_COMMAND": robot},
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
    try:
        owner = _owner(data, process)
        headers = {"Authorization": f"Bearer {owner.token}"}
        with httpx.Client(base_url=owner.url, headers=headers, timeout=60.0, trust_env=False) as client:
            yield RunningConsole(data, process, client)
    finally:
        process.terminate()
        try:
            process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _owner(data: Path, process: subprocess.Popen[bytes]) -> Owner:
    """The console's address and token, once it answers. Raises RuntimeError where it does not come up."""
    end_s = time.monotonic() + UP_S
    while time.monotonic() < end_s and process.poll() is None:
        file = data / "owner.lock"
        found = decode(file.read_bytes(), Owner) if file.exists() and file.stat().st_size else None
        if found is not None and found.url and _answers(found):
            return found
        time.sleep(POLL_S)
    raise RuntimeError(f"no console came up: {(data.parent / f'{data.name}.err').read_text(errors='replace')[-500:]}")


def _answers(owner: Owner) -> bool:
    try:
        headers = {"Authorization": f"Bearer {owner.token}"}
        return httpx.get(f"{owner.url}/api/v1/missions", headers=headers, timeout=5.0, trust_env=False).is_success
    except httpx.HTTPError:
        return False
