"""A simulated robot that lies, as a program of its own: `hostile_robot ROBOT=LIE,... OPTIONS`, where `regen up` starts
the simulator. The simulator runs as its child, and every request goes through the lie; the truth is the child's.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Event

from msgspec.structs import replace

from harness.conformance.hostile.kit import chosen, share_memory
from harness.conformance.hostile.lies import Mode
from harness.conformance.hostile.missions import ForwardedRequests
from harness.conformance.hostile.proxy import Answer, Ask, LyingProxy, listening
from harness.contracts.values import decode, encode
from harness.provider_protocol.wire import ATTACHMENT, Attachment

PARENT_POLL_S = 0.1
OVERLAPPING = "overlapping"
"""The file in the robot's folder that holds how many motions were to begin while another one had the body."""


class HostileRobot(LyingProxy):
    """A proxy that is honest until the mission of its lie begins: the first one, or the second after an honest one."""

    def __init__(self, upstream: ForwardedRequests, mode: Mode) -> None:
        cards = upstream(Ask("GET", "/providers", {}, b"")).json()
        moving = frozenset(str(card["provider_id"]) for card in cards if card["moves"])
        super().__init__(upstream, mode.lie, moving=moving)
        self._honest = int(mode.second)

    def answer(self, ask: Ask) -> Answer:
        answer = super().answer(ask)
        if ask.path == "/simulation/configure" and answer.ok:
            self.armed = self._honest == 0
            self._honest -= 1
        return answer


def main() -> int:
    """Serve until ordered to end, or until the parent or the child is gone."""
    lies = dict(one.split("=", 1) for one in sys.argv[1].split(","))
    options = sys.argv[2:]
    named = dict(zip(options[::2], options[1::2], strict=True))
    (mode,) = chosen([lies[named["--robot-id"]]])
    words = [word for name, value in (named | {"--port": "0"}).items() for word in (name, value)]
    child = subprocess.Popen([sys.executable, "-m", "simulator", *words], stdout=subprocess.PIPE)
    try:
        return _serve(mode, child, Path(named["--dir"]))
    finally:
        child.terminate()
        child.wait()


def _serve(mode: Mode, child: subprocess.Popen[bytes], folder: Path) -> int:
    assert child.stdout is not None
    share_memory()
    with child.stdout as output:
        found = decode(output.readline(), Attachment)
    over = Event()
    signal.signal(signal.SIGTERM, lambda number, frame: over.set())
    robot = HostileRobot(ForwardedRequests(found.base_url, found.token), mode)
    with listening(robot) as url:
        body = encode(replace(found, port=int(url.rpartition(":")[2]), pid=os.getpid()))
        (folder / ATTACHMENT).write_bytes(body)
        print(body.decode(), flush=True)
        parent = os.getppid()
        while not over.is_set() and child.poll() is None and os.getppid() == parent:
            time.sleep(PARENT_POLL_S)
    written = folder / f"{OVERLAPPING}.new"
    written.write_text(str(robot.seen.overlapping))
    written.rename(folder / OVERLAPPING)
    return 0


if __name__ == "__main__":
    sys.exit(main())
