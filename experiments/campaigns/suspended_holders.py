"""Suspends a lease holder past its lease and continues it, and checks that the robot refuses its fencing token.

The robot is its own process behind the HTTP provider protocol, the holder another one, stopped with SIGSTOP.
"""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from harness.adapters.clock import LockstepClock
from harness.adapters.providers.http.process import RobotProcess, RobotSettings
from harness.adapters.providers.http.robot import HttpRobot
from harness.adapters.stores.memory import MemoryEventStore
from harness.bootstrap import DECIDERS
from harness.contracts.actors import Actor
from harness.contracts.commands import AcquireLease, FreeLease, LeaseCommand, QuarantineLease, ReleaseLease
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import HarnessError
from harness.contracts.ids import (
    Digest,
    InvocationId,
    MissionId,
    NodeId,
    ProviderId,
    ResourceId,
    invocation_id,
    lease_stream,
    request_id,
)
from harness.contracts.protocol import TERMINAL, InvocationIdentity, StartRequest
from harness.contracts.reasons import plain
from harness.contracts.values import Value
from harness.gate.commit import CommandEnvelope, Gate
from harness.settings import ROBOT_COMMAND

BASE = ResourceId("vbot-1/mobile_base")
HELD_S = 5.0
ANSWER_S = 120.0
ENGINEER = Actor(name="ada", role="operator")
STAND = {"displacement_m": 0.0}


class SuspensionReport(Value):
    """`refused`: rounds in which the continued holder met FencingRefused."""

    rounds: int
    refused: int
    offences: tuple[str, ...]


def suspensions(rounds: int) -> SuspensionReport:
    """Suspend the holder in every round until its lease expired and somebody else worked with the next token.

    A token that was not refused ends the rounds: the robot then obeys somebody who has no lease.
    """
    offences: list[str] = []
    refused = 0
    with TemporaryDirectory(prefix="suspended-") as folder, _robot(Path(folder)) as process:
        with _holder(process) as (holder, line):
            gate = _Gate(process.robot)
            for number in range(rounds):
                answer = _round(number, gate=gate, robot=process.robot, holder=holder, line=line)
                refused += answer == "FencingRefused"
                if answer != "FencingRefused":
                    offences.append(f"round {number}: the old token met {answer}")
                    break
        doubled = [start.request_id for start in process.robot.starts()]
        offences += ["a request started twice"] if len(doubled) != len(set(doubled)) else []
    return SuspensionReport(rounds=rounds, refused=refused, offences=tuple(offences))


class _Gate:
    """The lease of the base, as any supervisor sees it."""

    def __init__(self, robot: HttpRobot) -> None:
        self._clock = LockstepClock(robot.advance, at_s=robot.clock().at_s)
        self._gate = Gate(store=MemoryEventStore(), clock=self._clock, deciders=DECIDERS)

    @property
    def now_s(self) -> float:
        return self._clock.now().mission_s

    def wait(self, seconds: float) -> None:
        self._clock.wait_until(self.now_s + seconds)

    def ask(self, command: LeaseCommand) -> None:
        decision: Accepted[Any] | Refused = self._gate.commit([CommandEnvelope(lease_stream(BASE), command, None)])
        if isinstance(decision, Refused):
            raise RuntimeError(plain(decision.reason))

    def take(self, owner: InvocationId, mission_id: MissionId) -> int:
        token: int = self._gate.state(lease_stream(BASE)).token + 1
        self.ask(
            AcquireLease(
                resource=BASE, mission_id=mission_id, invocation_id=owner, token=token, expires_s=self.now_s + HELD_S
            )
        )
        return token


def _round(number: int, *, gate: _Gate, robot: HttpRobot, holder: SpawnProcess, line: Connection) -> str:
    """One suspension; the name of the error that the holder met when it continued."""
    slow, quick = _request(number, "slow"), _request(number, "quick")
    old = gate.take(slow[1], slow[0].mission_id)
    line.send("are you there")
    if not line.poll(ANSWER_S) or line.recv() != "here":
        raise RuntimeError("the holder does not answer")
    os.kill(_pid(holder), signal.SIGSTOP)
    gate.wait(HELD_S + 1.0)
    gate.ask(QuarantineLease(invocation_id=slow[1], reason="the holder is unaccounted for"))
    gate.ask(FreeLease(actor=ENGINEER, static=STAND, reason="the body stands"))
    token = gate.take(quick[1], quick[0].mission_id)
    provider = next(one for one in robot.providers() if one.card.provider_id == "route-follower")
    report = provider.start(_start(quick[0], token, gate.now_s))
    while report.status not in TERMINAL:
        provider.stop(report.handle)
        gate.wait(0.5)
        report = provider.report(report.handle)
    gate.ask(ReleaseLease(invocation_id=quick[1], reason="done"))
    line.send(_start(slow[0], old, gate.now_s))
    os.kill(_pid(holder), signal.SIGCONT)
    return str(line.recv()) if line.poll(ANSWER_S) else "nothing"


def _hold(url: str, token: str, line: Connection) -> None:
    """The holder's process: starts what it is asked to start and reports the result."""
    robot = HttpRobot(url, token)
    provider = next(one for one in robot.providers() if one.card.provider_id == "route-follower")
    while True:
        answer = line.recv()
        if answer is None:
            break
        if not isinstance(answer, StartRequest):
            line.send("here")
            continue
        try:
            line.send(provider.start(answer).status)
        except HarnessError as error:
            line.send(type(error).__name__)
    robot.close()


@contextmanager
def _holder(process: RobotProcess) -> Iterator[tuple[SpawnProcess, Connection]]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    holder = context.Process(target=_hold, args=(process.attachment.base_url, process.attachment.token, theirs))
    holder.start()
    try:
        yield holder, ours
    finally:
        os.kill(_pid(holder), signal.SIGCONT)
        ours.send(None)
        holder.join(ANSWER_S)


@contextmanager
def _robot(folder: Path) -> Iterator[RobotProcess]:
    process = RobotProcess(RobotSettings(command=ROBOT_COMMAND, folder=str(folder), speed=0.0, fidelity="kinematic"))
    try:
        yield process
    finally:
        process.robot.close()
        process.terminate()


def _pid(process: SpawnProcess) -> int:
    if process.pid is None:
        raise RuntimeError("the holder was never started")
    return process.pid


def _request(number: int, who: str) -> tuple[InvocationIdentity, InvocationId]:
    mission_id, node_id = MissionId(f"mis_{who}_{number}"), NodeId("go")
    request = request_id(mission_id, node_id, 1)
    identity = InvocationIdentity(
        mission_id=mission_id, node_id=node_id, attempt=1, request_id=request, provider_id=ProviderId("route-follower")
    )
    return identity, invocation_id(request)


def _start(identity: InvocationIdentity, token: int, now_s: float) -> StartRequest:
    return StartRequest(
        identity=identity,
        capability="navigate",
        parameters={
            "route": ((0.0, 0.0), (0.4, 1.0)),
            "target": (0.4, 1.0),
            "frame": "map",
            "tolerance_m": 0.4,
            "speed_cap_mps": 0.5,
        },
        k_ctx=1,
        configuration=Digest("0" * 64),
        deadline_s=now_s + 60.0,
        fencing={BASE.partition("/")[2]: token},
    )
