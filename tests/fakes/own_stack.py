"""A robot whose own stack decides, served over HTTP in this process: its time passes only on request.

It counts everything that is asked of it, so that a test can say what a harness in shadow mode sent.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tests.fakes.http_servers import JsonHandler, served

TOKEN = "a secret of this test"
BEGUN_S = 1_700_000_000.0
STEP_S = 0.1


class OwnStack:
    """One robot. `away`: it does not answer. `odometry`: its wheels are read too. `tells`: it serves its goals."""

    def __init__(self, name: str = "robot-1") -> None:
        self.name, self.now_s, self.run = name, BEGUN_S, "run-1"
        self.x_m = self.y_m = 0.0
        self.away, self.odometry, self.tells, self.frame = False, True, True, "map"
        self.changes: list[dict[str, Any]] = []
        self.samples: list[dict[str, Any]] = []
        self.asked: list[str] = []

    def given(self, goal_id: str, x_m: float, y_m: float, **changed: Any) -> None:
        """Its stack was given a goal."""
        self.says(goal_id, "active", target_m=[x_m, y_m], frame=self.frame, map_version="shop-1", **changed)

    def says(self, goal_id: str, status: str, **changed: Any) -> None:
        """Its stack says something of a goal."""
        change = {"seq": len(self.changes) + 1, "goal_id": goal_id, "at_s": self.now_s, "status": status}
        self.changes.append(change | changed)

    def stands(self, seconds: float) -> None:
        self.goes(self.x_m, self.y_m, seconds)

    def goes(self, x_m: float, y_m: float, seconds: float) -> None:
        """Move in a straight line for so long, and sense ten times a second."""
        steps = max(1, round(seconds / STEP_S))
        dx_m, dy_m = (x_m - self.x_m) / steps, (y_m - self.y_m) / steps
        for _ in range(steps):
            self.now_s += STEP_S
            self.x_m, self.y_m = self.x_m + dx_m, self.y_m + dy_m
            self._sense(math.hypot(dx_m, dy_m) / STEP_S)

    def restarts(self, *, now_s: float) -> None:
        """Stack and robot are started again, with this on their clock; numbers begin anew."""
        self.run, self.now_s = f"run-{int(self.run.partition('-')[2]) + 1}", now_s
        self.changes.clear()
        self.samples.clear()

    def answer(self, path: str, query: dict[str, int]) -> Any:
        after, limit = query.get("after", 0), query.get("limit", 5000)
        match path:
            case "/robot":
                return {
                    "robot_id": self.name, "at_s": self.now_s, "posture": "standing", "armed": False,
                    "hardware_stop": False, "charge": 0.8, "localised": True, "map_version": "shop-1",
                    "pose_age_s": 0.0,
                }  # fmt: skip
            case "/observations":
                found = [one for one in self.samples if one["seq"] > after][:limit]
                last = found[-1]["seq"] if found else len(self.samples)
                return {"samples": found, "next_seq": last, "at_s": self.now_s}
            case "/stack/goals" if self.tells:
                found = [one for one in self.changes if one["seq"] > after][:limit]
                last = found[-1]["seq"] if found else len(self.changes)
                return {
                    "stack": "nav2", "run": self.run, "changes": found, "next_seq": last, "at_s": self.now_s
                }  # fmt: skip
            case _:
                return None

    def _sense(self, v_mps: float) -> None:
        place = {"x_m": self.x_m, "y_m": self.y_m, "yaw_rad": 0.0}
        self._keep("pose", "localiser", frame="map", map_version="shop-1", confidence=1.0, **place)
        if self.odometry:
            self._keep("odometry", "odometry", frame="odom", v_mps=v_mps, w_radps=0.0, **place)

    def _keep(self, kind: str, source: str, **values: Any) -> None:
        seq = len(self.samples) + 1
        self.samples.append({"kind": kind, "seq": seq, "at_s": self.now_s, "source": source, **values})


@contextmanager
def serving(stack: OwnStack) -> Iterator[str]:
    """Its address, until the block ends."""

    class Handler(JsonHandler):
        def serve(self) -> None:
            path, _, parameters = self.path.partition("?")
            stack.asked.append(f"{self.command} {path}")
            if stack.away:
                self.hang_up()
                return
            query = {
                name: int(value) for name, _, value in (one.partition("=") for one in parameters.split("&") if one)
            }
            found = stack.answer(path, query) if self.command == "GET" else None
            unknown = {"code": "unknown_name", "what": "There is nothing of that name"}
            self.answer(200 if found is not None else 404, found or unknown)

    with served(Handler) as address:
        yield address
