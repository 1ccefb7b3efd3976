"""A site of one's own with the example robot at an address, and the command line against it."""

import json
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from app.cli.main import app
from app.cli.output import complain
from app.i18n.reasons.rendering import explained
from harness.adapters.providers.http.robot import HttpRobot
from harness.contracts.errors import HarnessError
from harness.contracts.ids import RobotId
from harness.contracts.protocol import PhysicalStart
from harness.workspace.new_folder import write_folder

ROOT = Path(__file__).resolve().parents[2]
TOKEN = "a secret of this test"
ROBOT = RobotId("robot-1")


def regen(*words: str) -> tuple[int, Any, str]:
    """Exit code, the JSON answer, and what stood on standard error."""
    done = CliRunner(env={"ROBOT_TOKEN": TOKEN}).invoke(app, [*words, "--json"])
    if isinstance(done.exception, HarnessError):
        return complain(done.exception), None, explained(done.exception)
    return done.exit_code, json.loads(done.stdout) if done.stdout else None, done.stderr


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@contextmanager
def running(port: int, *options: str, lockstep: bool = True) -> Iterator[None]:
    """The example robot as a process; without lockstep its time is the machine's."""
    words = [sys.executable, "docs/examples/robot.py", "--port", str(port), "--token", TOKEN, "--map-version", "shop-1"]
    time_of = ["--lockstep"] if lockstep else []
    with subprocess.Popen([*words, *time_of, *options], cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline()
        try:
            yield
        finally:
            process.kill()


class Shop:
    """A site of one's own with the example robot."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.address = f"http://127.0.0.1:{self.port}"
        write_folder(folder, address=self.address)
        (folder / "conformance").mkdir()
        (folder / "conformance" / "drive.yaml").write_text((ROOT / "docs/examples/drive.yaml").read_text())

    def check(self, *options: str) -> tuple[int, Any, str]:
        return regen("provider", "check", "robot-1", "--site", str(self.folder), *options)

    def starts(self) -> Sequence[PhysicalStart]:
        """The robot's own journal."""
        with closing(HttpRobot(self.address, TOKEN)) as client:
            return client.starts()

    def go(self, *words: str) -> tuple[int, Any, str]:
        return regen("mission", "run", *words, "--site", str(self.folder), "--speed", "0")

    def admit(self) -> tuple[int, Any, str]:
        """The whole kit, and the robot admitted by it."""
        with running(self.port):
            return self.check("--allow-motion", "--stands-clear", ROBOT)
