"""`python -m simulator`: one simulated robot in a process of its own."""

import argparse
import fcntl
import os
import secrets
import socket
import sys
import threading
import time
from pathlib import Path
from typing import IO, get_args

import scipy.sparse.csgraph  # noqa: F401  before the robot answers: at its first drive it would answer nobody meanwhile
import uvicorn

from harness.contracts.errors import HarnessError, StoreOwned, StoreUnavailable
from harness.contracts.reasons import because
from harness.contracts.simulation import Fidelity
from harness.contracts.values import encode
from harness.provider_protocol.wire import ATTACHMENT, Attachment, problem
from simulator.robot import SimulatedRobot
from simulator.service import Pace, robot_service
from simulator.world import WorldSettings

PARENT_POLL_S = 0.1
LOCK_PATIENCE_S = 4.0


def main() -> int:
    """Serve until ordered to end or until the parent is gone; exit 1 with a typed problem on standard output."""
    options = _options()
    try:
        folder: Path = options.dir
        lock = _own(folder, patience_s=options.linger_s + LOCK_PATIENCE_S)
        settings = WorldSettings(fidelity=options.fidelity, seed=options.seed, epoch_s=options.epoch or time.time())
        robot = SimulatedRobot(settings, folder, robot_id=options.robot_id)
        listener = _listen(options.port)
    except HarnessError as error:
        print(encode(problem(error)).decode(), flush=True)
        return 1
    pace = Pace(robot, options.speed)
    pace.start()
    _serve(pace, listener, folder, linger_s=options.linger_s)
    pace.end()
    robot.save()
    (folder / ATTACHMENT).unlink(missing_ok=True)
    lock.close()
    return 0


def _serve(pace: Pace, listener: socket.socket, folder: Path, *, linger_s: float) -> None:
    token = secrets.token_urlsafe(24)
    attachment = Attachment(
        port=listener.getsockname()[1], token=token, pid=os.getpid(), speed=pace.speed, robot_id=pace.robot.robot_id
    )
    config = uvicorn.Config(
        robot_service(pace, token),
        log_level="warning",
        access_log=False,
        timeout_keep_alive=75,
        timeout_graceful_shutdown=2,
    )
    server = uvicorn.Server(config)
    threading.Thread(target=_watch_parent, args=(pace, server, linger_s), name="parent", daemon=True).start()
    descriptor = os.open(folder / ATTACHMENT, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(encode(attachment))
    print(encode(attachment).decode(), flush=True)
    server.run(sockets=[listener])


def _watch_parent(pace: Pace, server: uvicorn.Server, linger_s: float) -> None:
    """Without a parent: run free until the robot stands, wait for a supervisor to reattach, then end."""
    parent = os.getppid()
    while os.getppid() == parent:
        time.sleep(PARENT_POLL_S)
    pace.orphan()
    while not pace.retire(after_s=linger_s):
        time.sleep(PARENT_POLL_S)
    server.should_exit = True


def _own(folder: Path, *, patience_s: float) -> IO[bytes]:
    """Hold the folder for this process alone; a robot that is about to end is waited for."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "robot.lock").open("ab")
    except OSError as error:
        reason = because("robot_folder_unusable", error=error.strerror or str(error))
        raise StoreUnavailable(reason, where=str(folder)) from error
    until_s = time.monotonic() + patience_s
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if time.monotonic() > until_s:
                raise StoreOwned(because("robot_folder_in_use"), where=str(folder)) from error
            time.sleep(PARENT_POLL_S)
        else:
            return lock


def _listen(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)  # else asyncio keeps Nagle on
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
    except OSError as error:
        reason = because("robot_port_unusable", port=port, error=error.strerror or str(error))
        raise StoreUnavailable(reason, where="127.0.0.1") from error
    listener.listen(64)
    return listener


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m simulator", description=__doc__)
    parser.add_argument("--dir", type=Path, required=True, help="the robot's own folder: journals, world, truth")
    parser.add_argument("--port", type=int, default=0, help="0 takes any free port")
    parser.add_argument("--speed", type=float, default=1.0, help="mission seconds per second; 0 is lockstep")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fidelity", choices=get_args(Fidelity), default="mujoco")
    parser.add_argument("--robot-id", default="vbot-1")
    parser.add_argument("--epoch", type=float, default=0.0, help="first mission time; 0 is now")
    parser.add_argument("--linger-s", type=float, default=5.0, help="how long to stay after the parent is gone")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
