"""Stands between a harness and a robot at an address, and changes what passes once the robot was started."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPException
from typing import Any
from urllib.parse import urlsplit

from tests.fakes.http_servers import JsonHandler, served

Change = Callable[[str, Any], Any]
"""What becomes of an answer on a path; None: no answer comes."""


def unchanged(path: str, answer: Any) -> Any:
    return answer


def of_another_robot(path: str, answer: Any) -> Any:
    """Its condition is signed by another robot."""
    return answer | {"robot_id": "robot-9"} if path == "/robot" else answer


def gone(path: str, answer: Any) -> Any:
    """Nothing answers any more."""
    return None


def behind(seconds: float) -> Change:
    """Its clock fell back: every instant that it names is so much earlier."""

    def shifted(answer: Any) -> Any:
        if isinstance(answer, list):
            return [shifted(one) for one in answer]
        if isinstance(answer, dict):
            return {name: one - seconds if name == "at_s" else shifted(one) for name, one in answer.items()}
        return answer

    return lambda path, answer: shifted(answer)


def creeping(pace: float) -> Change:
    """Its clock goes on at this pace from its next reading on; the body and its samples go on as before."""
    began: list[float] = []

    def crept(path: str, answer: Any) -> Any:
        if path != "/clock":
            return answer
        began.append(answer["at_s"])
        return answer | {"at_s": began[0] + pace * (answer["at_s"] - began[0])}

    return crept


def leaping(seconds: float, *, readings: int) -> Change:
    """So many readings of its clock are so far ahead."""
    left = iter(range(readings))

    def leapt(path: str, answer: Any) -> Any:
        if path != "/clock" or next(left, None) is None:
            return answer
        return answer | {"at_s": answer["at_s"] + seconds}

    return leapt


class ChangedRobot:
    """`change` counts from the first start on, where `after_reads` further readings have passed. `starts_twice`: each
    start reaches the robot two times, as over a network that redelivers."""

    def __init__(self, target: str, change: Change, *, after_reads: int = 5, starts_twice: bool = False) -> None:
        self.target, self.change, self.after_reads, self.starts_twice = target, change, after_reads, starts_twice
        self.started, self.reads, self.struck = False, 0, 0

    def passed(self, path: str, answer: Any) -> Any:
        self.reads += self.started
        if not self.started or self.reads <= self.after_reads:
            return answer
        changed = self.change(path, answer)
        self.struck += changed != answer
        return changed

    def begin(self, change: Change) -> None:
        """Count from the next start on."""
        self.change, self.started, self.reads, self.struck = change, False, 0, 0


@contextmanager
def between(robot: ChangedRobot) -> Iterator[str]:
    """Its address, until the block ends."""

    class Handler(JsonHandler):
        def serve(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
            starting = self.command == "POST" and self.path.endswith("/invocations")
            try:
                for _ in range(1 + (starting and robot.starts_twice)):
                    status, answer = self._asked(body)
            except (OSError, HTTPException):
                self.hang_up()
                return
            robot.started = robot.started or starting
            changed = robot.passed(self.path.partition("?")[0], answer)
            if changed is None:
                self.hang_up()
            else:
                self.answer(status, changed)

        def _asked(self, body: bytes) -> tuple[int, Any]:
            connection = HTTPConnection(urlsplit(robot.target).netloc, timeout=10.0)
            try:
                headers = {"Authorization": self.headers["Authorization"], "Content-Type": "application/json"}
                connection.request(self.command, self.path, body, headers)
                answer = connection.getresponse()
                return answer.status, json.loads(answer.read())
            finally:
                connection.close()

    with served(Handler) as address:
        yield address
