"""Starts a robot program as a child process, or attaches to one that outlived its parent."""

import os
import signal
import subprocess
import threading
from pathlib import Path

import msgspec
from msgspec.structs import replace

from harness.adapters.process_priority import give_way
from harness.adapters.providers.http.robot import HttpRobot
from harness.contracts.errors import HarnessError, ProviderUnreachable
from harness.contracts.reasons import because
from harness.contracts.simulation import Fidelity
from harness.contracts.values import Value, decode
from harness.provider_protocol.wire import ATTACHMENT, Attachment, Problem, error_of

READY_S = 60.0
END_S = 10.0


class RobotSettings(Value):
    """What robot to run: `speed` in mission seconds per second, 0 for lockstep.

    `command` starts the robot program; the other fields are given to it as options.
    `linger_s`: a robot whose supervisor is gone stands, and waits so long for the next one, which takes seconds to
    start; the leg of one that ends is begun anew.
    """

    command: tuple[str, ...]
    folder: str
    speed: float = 1.0
    seed: int = 0
    fidelity: Fidelity = "mujoco"
    robot_id: str = "vbot-1"
    port: int = 0
    epoch_s: float = 0.0
    linger_s: float = 20.0


class RobotProcess:
    """A robot process and a client to it. `adopted` means that it was already running: its invocation may resume.

    Raises ProviderUnreachable when the child does not come up, or the typed error that it names.
    """

    def __init__(self, settings: RobotSettings) -> None:
        self._settings = settings
        self._child: subprocess.Popen[bytes] | None = None
        found = _running(settings)
        self.adopted = found is not None
        self.attachment = found or self._spawn(settings)
        self.robot = HttpRobot(self.attachment.base_url, self.attachment.token)

    @property
    def pid(self) -> int:
        return self.attachment.pid

    def revive(self, *, from_s: float) -> bool:
        """Start the robot again if its process died; the same client goes on with the new one. False if it lives.

        Its clock is then at mission time `from_s` at least.
        """
        if _alive(self.pid) and (self._child is None or self._child.poll() is None):
            return False
        self.attachment = self._spawn(replace(self._settings, epoch_s=from_s))
        self.robot.reconnect(self.attachment.base_url, self.attachment.token)
        return True

    def terminate(self) -> None:
        """Shut it down in order: the world is saved."""
        self._end(signal.SIGTERM)

    def kill(self) -> None:
        """End it as a crash would: SIGKILL."""
        self._end(signal.SIGKILL)

    def _spawn(self, settings: RobotSettings) -> Attachment:
        folder = Path(settings.folder)
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "robot.log").open("ab") as log:
            own = 0  # a process group of its own: Ctrl-C at the terminal is for the harness, which stops the robot
            self._child = subprocess.Popen(_command(settings), stdout=subprocess.PIPE, stderr=log, process_group=own)
            give_way(self._child.pid)
        line = _first_line(self._child)
        try:
            return decode(line, Attachment)
        except msgspec.MsgspecError:
            self._end(signal.SIGKILL)
            raise _failure(line, folder) from None

    def _end(self, number: signal.Signals) -> None:
        if self._child is None:
            try:
                os.kill(self.pid, number)
            except ProcessLookupError:
                return
            return
        if self._child.poll() is None:
            self._child.send_signal(number)
            try:
                self._child.wait(END_S)
            except subprocess.TimeoutExpired:
                self._child.kill()
                self._child.wait()


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def _command(settings: RobotSettings) -> list[str]:
    options = {
        "--dir": settings.folder,
        "--port": settings.port,
        "--speed": settings.speed,
        "--seed": settings.seed,
        "--fidelity": settings.fidelity,
        "--robot-id": settings.robot_id,
        "--epoch": settings.epoch_s,
        "--linger-s": settings.linger_s,
    }
    pairs = [text for name, value in options.items() for text in (name, str(value))]
    return [*settings.command, *pairs]


def _first_line(child: subprocess.Popen[bytes]) -> bytes:
    """The ready line; the child is killed if it prints nothing for READY_S."""
    assert child.stdout is not None
    timer = threading.Timer(READY_S, child.kill)
    timer.start()
    try:
        return child.stdout.readline()
    finally:
        timer.cancel()
        child.stdout.close()


def _running(settings: RobotSettings) -> Attachment | None:
    """A robot that still serves this folder at this speed, if there is one."""
    file = Path(settings.folder) / ATTACHMENT
    try:
        found = decode(file.read_bytes(), Attachment)
    except (OSError, msgspec.MsgspecError):
        return None
    client = HttpRobot(found.base_url, found.token, timeout_s=2.0)
    try:
        alive = client.status().robot_id == settings.robot_id
    except HarnessError:
        return None
    finally:
        client.close()
    return found if alive and found.speed == settings.speed else None


def _failure(line: bytes, folder: Path) -> HarnessError:
    try:
        return error_of(decode(line, Problem))
    except msgspec.MsgspecError:
        return ProviderUnreachable(because("simulated_robot_not_up"), where=str(folder / "robot.log"))
