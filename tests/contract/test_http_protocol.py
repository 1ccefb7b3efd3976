"""The HTTP provider protocol and its process: who may speak, what is described, what survives a crash."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
import pytest

from harness.adapters.providers.http.process import RobotProcess, RobotSettings
from harness.adapters.providers.http.robot import HttpRobot
from harness.adapters.providers.http.supervised_process import SupervisedProcess
from harness.contracts.errors import (
    BlobDamaged,
    FencingRefused,
    ProviderFailed,
    ProviderUnreachable,
    StoreOwned,
    StoreUnavailable,
    UnknownName,
)
from harness.contracts.ids import Digest, MissionId
from harness.contracts.protocol import PhysicalStart
from harness.contracts.values import decode
from harness.provider_protocol.wire import ATTACHMENT, Attachment
from harness.settings import ROBOT_COMMAND
from tests.contract.test_providers import truths
from tests.saying import raises_saying
from tests.unit.simulation.builders import MISSION, Bench, along

Start = Callable[..., tuple[RobotProcess, Bench]]
PATIENCE_S = 120.0
SECOND = MissionId("mission-2")
AWAY_S = 40.0
"""Longer than a robot that began at nothing would have run until it is looked at."""


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts robot processes over one folder, and ends them all."""
    with ExitStack() as stack:
        yield lambda **settings: _start(stack, tmp_path / "vbot-1", **settings)


def _start(stack: ExitStack, folder: Path, *, speed: float = 0.0, linger_s: float = 0.2) -> tuple[RobotProcess, Bench]:
    process = RobotProcess(
        RobotSettings(command=ROBOT_COMMAND, folder=str(folder), speed=speed, fidelity="kinematic", linger_s=linger_s)
    )
    stack.callback(process.kill)
    stack.callback(process.robot.close)
    robot = process.robot
    file = folder / "truth" / f"{MISSION}.jsonl"
    return process, Bench(robot, robot.advance, robot.configure, lambda: truths(file))


def client(process: RobotProcess, token: str | None = None) -> httpx.Client:
    headers = {"Authorization": f"Bearer {process.attachment.token if token is None else token}"}
    return httpx.Client(base_url=process.attachment.base_url, headers=headers, trust_env=False)


def test_only_the_token_opens_the_protocol(start: Start) -> None:
    process, _ = start()
    with client(process, token="guess") as stranger:
        assert stranger.get("/healthz").status_code == 200
        for path in ("/robot", "/providers", "/observations", "/starts", "/clock", "/simulation/struck"):
            refused = stranger.get(path)
            assert (refused.status_code, refused.json()["code"]) == (401, "unauthorised")
        assert stranger.post("/simulation/advance", content=b'{"until_s":1}').status_code == 401


def test_the_openapi_document_describes_every_operation_with_resolvable_schemas(start: Start) -> None:
    process, _ = start()
    with client(process) as known:
        text = known.get("/openapi.json").text
        document = json.loads(text)
        for path, methods in document["paths"].items():
            if "{" not in path and "get" in methods:
                must = {one["name"]: "1" for one in methods["get"]["parameters"] if one.get("required")}
                assert known.get(path, params=must).status_code == 200, path
                assert not must or known.get(path).status_code == 422, path
    assert "/providers/{provider_id}/invocations" in document["paths"]
    named = set(re.findall(r'"#/components/schemas/(\w+)"', text))
    assert {"StartRequest", "InvocationReport", "CapabilityCard", "Observations", "Problem"} <= named
    assert named <= set(document["components"]["schemas"])


def test_problems_say_what_where_and_what_to_do_and_arrive_as_their_own_type(start: Start) -> None:
    process, made = start()
    made.configure(MISSION, 1, ())
    with client(process) as known:
        wrong = known.post("/providers/route-follower/invocations", content=b'{"identity":{}}')
        assert (wrong.status_code, wrong.json()["code"]) == (422, "invalid_body")
        assert "identity" in wrong.json()["what"]
        assert wrong.json()["reason"]["code"] == "request_body_invalid"
        assert known.post("/simulation/advance", content=b"not json").status_code == 422
        assert known.get("/observations?after=-1").status_code == 422
        assert known.post("/simulation/save", content=b"x" * (3 * 1024 * 1024)).status_code == 413
    with raises_saying(UnknownName, match="stale-pose"):
        made.configure(MISSION, 1, ["rust"])
    with pytest.raises(BlobDamaged):
        made.robot.blob(Digest("0" * 64))
    made.start("route-follower", along("A-B"))
    made.tokens["mobile_base"] = 1
    with pytest.raises(FencingRefused):
        made.start("route-follower", along("A-B"), attempt=2)
    with raises_saying(ProviderFailed, match="step of -5.0 s.*smaller steps"):
        made.advance_to(made.at_s - 5.0)


def test_a_silent_port_is_unreachable() -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        robot = HttpRobot(f"http://127.0.0.1:{listener.getsockname()[1]}", "token", timeout_s=0.5)
        with raises_saying(ProviderUnreachable, match="did not answer"):
            robot.status()
        robot.close()


def test_a_server_that_speaks_another_language_breaks_the_protocol() -> None:
    serving = [sys.executable, "-c", "import http.server as h; s=h.HTTPServer(('127.0.0.1',0),"
               "h.SimpleHTTPRequestHandler); print(s.server_port, flush=True); s.handle_request()"]  # fmt: skip
    with subprocess.Popen(serving, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd="/") as other:
        assert other.stdout is not None
        robot = HttpRobot(f"http://127.0.0.1:{int(other.stdout.readline())}", "token", timeout_s=60.0)
        with raises_saying(ProviderFailed, match="answered 404"):
            robot.status()
        robot.close()


def test_a_start_is_never_sent_twice_by_the_client(start: Start) -> None:
    _, made = start()
    made.configure(MISSION, 1, ["duplicate-request"])
    request = made.request("route-follower", along("A-B"))
    with pytest.raises(ProviderUnreachable):
        made.provider("route-follower").start(request)
    found = made.provider("route-follower").find(request.identity.request_id)
    assert found is not None
    assert made.watch(found).status == "succeeded"
    assert len(made.robot.starts()) == 1
    assert made.robot.struck() == {"duplicate-request": 1}  # type: ignore[attr-defined]


@pytest.mark.ledger("R89", symbol="simulator.journals:StartJournal.write")
def test_a_killed_robot_remembers_its_starts_and_starts_none_of_them_again(start: Start, tmp_path: Path) -> None:
    process, made = start()
    made.configure(MISSION, 1, ())
    request = made.request("route-follower", along("A-B"))
    made.watch(made.provider("route-follower").start(request), until_s=6.0)
    before, there = made.at_s, made.pose()
    newest = made.newest()
    process.kill()
    again, after = start()
    assert not again.adopted
    report = after.provider("route-follower").start(request)
    assert (report.status, report.failure) == ("failed", "robot_restarted")
    assert [one.request_id for one in after.robot.starts()] == [request.identity.request_id]
    lines = (tmp_path / "vbot-1" / "starts.jsonl").read_bytes().splitlines()
    assert [decode(line, PhysicalStart).request_id for line in lines] == [request.identity.request_id]
    assert after.at_s > before
    after.configure(MISSION, 1, ())
    after.wait(1.0)
    assert after.robot.observations(0).samples[0].seq > newest
    assert abs(after.pose().x_m - there.x_m) < 0.3
    assert after.pose().v_mps == 0.0
    assert after.watch(after.start("route-follower", along("A-B"), attempt=2)).status == "succeeded"


@pytest.mark.long
def test_a_robot_that_died_between_two_missions_is_started_again_for_the_next(tmp_path: Path) -> None:
    folder = tmp_path / "vbot-1"
    kept = SupervisedProcess(
        RobotSettings(command=ROBOT_COMMAND, folder=str(folder), speed=40.0, fidelity="kinematic", linger_s=60.0)
    )
    try:
        kept.configure(MISSION, 1, ())
        before_s = kept.clock.now().mission_s
        newest = 0
        while kept.clock.now().mission_s < before_s + AWAY_S:
            newest = max((one.seq for one in kept.robot.observations(newest).samples), default=newest)
        dead = decode((folder / ATTACHMENT).read_bytes(), Attachment).pid
        os.kill(dead, signal.SIGKILL)
        os.waitid(os.P_PID, dead, os.WEXITED | os.WNOWAIT)
        kept.configure(SECOND, 2, ())
        assert decode((folder / ATTACHMENT).read_bytes(), Attachment).pid != dead
        assert kept.robot.clock().at_s >= before_s + AWAY_S
        assert (folder / "truth" / f"{SECOND}.jsonl").exists()
    finally:
        kept.close()


def test_an_ended_robot_keeps_its_world_and_its_terminal_reports(start: Start) -> None:
    process, made = start()
    made.configure(MISSION, 1, ())
    report = made.run("route-follower", along("A-B"))
    there = made.pose()
    process.terminate()
    _, after = start()
    found = after.provider("route-follower").find(report.identity.request_id)
    assert found == report
    after.configure(MISSION, 1, ())
    after.wait(0.5)
    assert (after.pose().x_m, after.pose().y_m) == pytest.approx((there.x_m, there.y_m), abs=0.02)


def test_a_folder_belongs_to_one_robot_process(start: Start, tmp_path: Path) -> None:
    start(speed=0.0)
    with raises_saying(StoreOwned, match="Another robot process"):
        RobotProcess(
            RobotSettings(
                command=ROBOT_COMMAND, folder=str(tmp_path / "vbot-1"), speed=3.0, fidelity="kinematic", linger_s=0.0
            )
        )


def test_a_busy_port_is_a_typed_error(tmp_path: Path) -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        port = listener.getsockname()[1]
        with raises_saying(StoreUnavailable, match=f"Port {port}"):
            RobotProcess(RobotSettings(command=ROBOT_COMMAND, folder=str(tmp_path), port=port, fidelity="kinematic"))


def test_when_the_harness_is_killed_the_robot_stands_within_two_seconds_and_can_be_adopted(tmp_path: Path) -> None:
    folder = tmp_path / "vbot-1"
    with harness(folder, linger_s=600.0) as (killed, attachment, killed_at_s):
        killed.kill()
    process = RobotProcess(RobotSettings(command=ROBOT_COMMAND, folder=str(folder), speed=0.0, fidelity="kinematic"))
    try:
        assert process.adopted
        assert process.pid == attachment.pid
        report = _until_blocked(process)
        later = [t for t in truths(folder / "truth" / f"{MISSION}.jsonl") if t.at_s >= killed_at_s]
        assert max(abs(truth.v_mps) for truth in later) > 0.3
        assert all(abs(truth.v_mps) < 0.01 for truth in later if truth.at_s >= killed_at_s + 2.0)
        provider = process.robot.providers()[0]
        assert provider.resume(report).status == "running"
        provider.stop(report)
        assert len(process.robot.starts()) == 1
    finally:
        process.robot.close()
        process.kill()


def test_an_orphaned_robot_ends_by_itself_once_it_stands(tmp_path: Path) -> None:
    folder = tmp_path / "vbot-1"
    with harness(folder, linger_s=2.0) as (killed, attachment, _):
        assert attachment.speed == 0.0
        assert (folder / "robot.json").exists()
        killed.kill()
    deadline = time.monotonic() + PATIENCE_S
    while (folder / "robot.json").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not (folder / "robot.json").exists()
    assert abs(truths(folder / "truth" / f"{MISSION}.jsonl")[-1].v_mps) < 0.01


_HARNESS = f"""
import signal, sys
from harness.adapters.providers.http.process import RobotProcess, RobotSettings
from harness.contracts.values import encode
from harness.settings import ROBOT_COMMAND
from tests.unit.simulation.builders import Bench, along
settings = RobotSettings(
    command=ROBOT_COMMAND, folder=sys.argv[1], speed=0.0, fidelity="kinematic", linger_s=float(sys.argv[2])
)
process = RobotProcess(settings)
robot = process.robot
robot.configure("{MISSION}", 1, ())
made = Bench(robot, robot.advance, robot.configure, lambda: [])
made.watch(made.start("route-follower", along("A-B")), until_s=6.0)
print(encode(process.attachment).decode(), flush=True)
print(made.at_s, flush=True)
signal.pause()
"""
"""Takes a robot in lockstep six seconds along its way and waits to be killed."""


@contextmanager
def harness(folder: Path, *, linger_s: float) -> Iterator[tuple[subprocess.Popen[bytes], Attachment, float]]:
    """That program, the robot it has started, and the robot's time after the last keepalive; it must be killed."""
    words = [sys.executable, "-c", _HARNESS, str(folder), str(linger_s)]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as running:
        assert running.stdout is not None
        yield running, decode(running.stdout.readline(), Attachment), float(running.stdout.readline())


def _until_blocked(process: RobotProcess) -> str:
    """Poll without a keepalive until the dead man has worked; the handle of the held invocation."""
    provider = process.robot.providers()[0]
    (only,) = process.robot.starts()
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        report = provider.find(only.request_id)
        assert report is not None
        if report.status == "blocked":
            return report.handle
        time.sleep(0.02)
    raise AssertionError("the dead man did not work")
