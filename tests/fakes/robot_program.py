"""A simulated robot, as a program of its own, whose answers over HTTP are changed in one way: `robot_program MODE ...`.

silent: it proposes nothing. elsewhere: its arrivals are proposed for another target. more: it proposes a fact that no
stage has. older: it speaks protocol 1.0, and refuses a request with a field that this protocol does not know.
carried:STAGE: seconds after each success of that stage, somebody carries the robot away and sets it down elsewhere.
wheels: its navigators steer by sensors that nobody else reads.
"""

import json
import math
import sys
from collections.abc import Callable
from typing import Any

from starlette.applications import Starlette
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import Response

from simulator import __main__ as program
from simulator.service import Pace, robot_service

Report = dict[str, Any]


def silent(report: Report) -> Report:
    return report | {"proposed_facts": []}


def elsewhere(report: Report) -> Report:
    moved = [one | {"arguments": one["arguments"] | {"target_m": [9.0, 9.0]}} for one in report["proposed_facts"]]
    return report | {"proposed_facts": moved}


def more(report: Report) -> Report:
    done = report["status"] == "succeeded"
    coffee = [{"name": "coffee_made", "arguments": {"cups": 2.0}}] if done else []
    return report | {"proposed_facts": report["proposed_facts"] + coffee}


def older(report: Report) -> Report:
    return {name: value for name, value in report.items() if name != "proposed_facts"}


def wheels(card: Report) -> Report:
    return card | {"sources": ["wheels"]} if card.get("capability") == "navigate" else card


class Carrier:
    """Somebody who carries the robot away, each time that it has done a stage: `after_s` of its time later."""

    def __init__(self, pace: Pace, stage: str, *, after_s: float = 3.0) -> None:
        self._pace, self._stage, self._after_s = pace, stage, after_s
        self._done: set[str] = set()
        self._due_s = math.inf

    def watch(self, answer: Any) -> None:
        """Note a success of the stage, and carry the robot away once its time has come."""
        if isinstance(answer, dict) and answer.get("status") == "succeeded" and "identity" in answer:
            of = answer["identity"]["node_id"].rpartition(".")[2]
            if of == self._stage and answer["handle"] not in self._done:
                self._done.add(answer["handle"])
                self._due_s = self._pace.robot.at_s + self._after_s
        with self._pace.turn():
            if self._pace.robot.at_s >= self._due_s and not self._pace.robot.moving:
                self._pace.robot.world.carry(ELSEWHERE)
                self._due_s = math.inf


ELSEWHERE = (1.0, 2.5, 0.0)
"""Where the robot is set down: beside its routes, in no place of the site."""
MODES: dict[str, Callable[[Report], Report]] = {
    "silent": silent, "elsewhere": elsewhere, "more": more, "older": older,
}  # fmt: skip


def changed(answer: Any, mode: str) -> Any:
    if mode == "wheels" and isinstance(answer, list) and answer and "provider_id" in answer[0]:
        return [wheels(card) for card in answer]
    if mode not in MODES:
        return answer
    if isinstance(answer, dict) and "handle" in answer and "identity" in answer:
        return MODES[mode](answer)
    if mode == "older" and isinstance(answer, list) and answer and "provider_id" in answer[0]:
        return [{name: value for name, value in card.items() if name != "protocol"} for card in answer]
    return answer


def service(mode: str) -> Callable[[Pace, str], Starlette]:
    def made(pace: Pace, token: str) -> Starlette:
        app = robot_service(pace, token)
        carrier = Carrier(pace, mode.partition(":")[2]) if mode.startswith("carried:") else None

        async def change(request: Request, call_next: Any) -> Response:
            if mode == "older" and b'"intended"' in await request.body():
                return Response(b'{"code": "invalid_body", "what": "unknown field intended"}', 422)
            answered = await call_next(request)
            body = b"".join([part async for part in answered.body_iterator])
            if answered.headers.get("content-type") == "application/json":
                answer = json.loads(body)
                if carrier is not None:
                    carrier.watch(answer)
                body = json.dumps(changed(answer, mode)).encode()
            return Response(body, answered.status_code, media_type=answered.headers.get("content-type"))

        app.add_middleware(BaseHTTPMiddleware, dispatch=change)
        return app

    return made


if __name__ == "__main__":
    program.robot_service = service(sys.argv.pop(1))
    sys.exit(program.main())
