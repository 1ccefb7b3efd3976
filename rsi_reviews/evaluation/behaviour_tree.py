"""Runs a mission by a behaviour tree as people commonly write it: navigate, then check arrival by condition nodes. It
reads fresh poses and binds them neither to a request nor to a version.
"""

from dataclasses import dataclass, field
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence
from py_trees.decorators import Retry

from harness.contracts.errors import ProviderFailed
from harness.contracts.protocol import TERMINAL
from harness.contracts.tasks import Node
from harness.verification.geometry import Fix, distance, window_displacement
from rsi_reviews.evaluation import driver
from rsi_reviews.evaluation.rules import REST_M, SAMPLES, effect_of

ATTEMPTS = 3
SETTLE_S = 1.6
FRESH_S = 1.0
LONGEST_S = 900.0
WHEELS = 40


@dataclass
class ClaimRecorder:
    """Records for the adjudicator what the tree itself does not keep: which requests a leg has sent."""

    node: Node
    robotics: driver.Robotics
    diary: driver.ArmRecord
    sent: list[str] = field(default_factory=list)

    def fields(self) -> dict[str, Any]:
        """What a claim or a rejection is about."""
        return {"node_id": self.node.node_id, "at_s": self.robotics.now_s, "requests": self.sent[-1:]}

    def reject(self, why: str, *, finished: bool) -> None:
        """A node of the tree failed."""
        self.diary.rejections.append({**self.fields(), "why": why, "finished": finished})

    def claim(self) -> None:
        """The leg's condition node succeeded."""
        self.diary.claims.append({**self.fields(), "act": "robot"})


class Navigate(Behaviour):
    """An action node: sends a goal each time it is entered, as an action client does, and follows it to its end."""

    def __init__(self, clerk: ClaimRecorder) -> None:
        super().__init__(f"navigate {clerk.node.node_id}")
        self._clerk, self._node, self._robot = clerk, clerk.node, clerk.robotics
        self._provider = clerk.robotics.providers["route-follower"]
        self._attempt = 0
        self._handle = ""
        self._since_s = 0.0

    def initialise(self) -> None:
        """Send a new goal."""
        self._clerk.diary.spent += self._attempt > 0
        self._handle, self._since_s = "", self._robot.now_s

    def update(self) -> Status:
        """Running until the provider says how it ended; a goal that nobody takes fails after PATIENCE_S."""
        if not self._handle:
            return self._sent()
        report = self._provider.report(self._handle)
        if report.status not in TERMINAL:
            self._provider.keepalive(self._handle)
            if self._robot.now_s - self._since_s > self._node.timeout_s:
                self._provider.stop(self._handle)
            return Status.RUNNING
        if report.status == "succeeded":
            return Status.SUCCESS
        self._clerk.reject(f"the action ended {report.status}", finished=False)
        return Status.FAILURE

    def _sent(self) -> Status:
        self._attempt += 1
        request = self._robot.request(
            self._node,
            attempt=self._attempt,
            provider=self._provider,
            parameters=driver.parameters_of(self._node, attempt=self._attempt),
        )
        self._clerk.sent.append(request.identity.request_id)
        try:
            self._handle = self._provider.start(request).handle
        except ProviderFailed:
            waited_s = self._robot.now_s - self._since_s
            return Status.RUNNING if waited_s < driver.PATIENCE_S else Status.FAILURE
        return Status.RUNNING


class WaitForStandstill(Behaviour):
    """Waits until the body has been observed for a while."""

    def __init__(self, robotics: driver.Robotics) -> None:
        super().__init__("settle")
        self._robot = robotics
        self._since_s = 0.0

    def initialise(self) -> None:
        """From now on."""
        self._since_s = self._robot.now_s

    def update(self) -> Status:
        """Success once SETTLE_S have passed."""
        return Status.SUCCESS if self._robot.now_s >= self._since_s + SETTLE_S - 1e-6 else Status.RUNNING


class AtTarget(Behaviour):
    """A condition node: the robot stands at the target now, by its newest poses and its wheel odometry."""

    def __init__(self, clerk: ClaimRecorder) -> None:
        super().__init__(f"arrived {clerk.node.node_id}?")
        self._clerk, self._robot = clerk, clerk.robotics

    def update(self) -> Status:
        """Three fresh poses within the tolerance, and at rest."""
        why = self._why()
        if why:
            self._clerk.reject(why, finished=True)
            return Status.FAILURE
        self._clerk.claim()
        return Status.SUCCESS

    def _why(self) -> str:
        effect = effect_of(self._clerk.node)
        newest = self._robot.poses[-SAMPLES:]
        if len(newest) < SAMPLES or self._robot.now_s - newest[-1].at_s > FRESH_S:
            return "no fresh pose"
        if any(distance((pose.x_m, pose.y_m), effect.target_m) > effect.tolerance_m for pose in newest):
            return "not within the tolerance"
        wheels = [Fix(one.at_s, one.x_m, one.y_m) for one in self._robot.odometry[-WHEELS:]]
        moved_m = window_displacement(wheels, until_s=wheels[-1].at_s) if wheels else None
        return "" if moved_m is not None and moved_m < REST_M else "not at rest"


def walk(robotics: driver.Robotics) -> driver.ArmRecord:
    """Tick the tree until it succeeds or fails."""
    diary = driver.ArmRecord()
    robotics.wait(driver.FIRST_S)
    root = Sequence(
        "mission", memory=True, children=[_leg(node, robotics, diary) for node in driver.legs(robotics.mission)]
    )
    until_s = robotics.now_s + LONGEST_S
    while root.status not in (Status.SUCCESS, Status.FAILURE) and robotics.now_s < until_s:
        root.tick_once()
        robotics.wait(driver.POLL_S)
    if root.status == Status.SUCCESS:
        diary.declared, diary.status = True, "succeeded"
    else:
        diary.give_up("the tree failed", asks=False)
    return diary


def _leg(node: Node, robotics: driver.Robotics, diary: driver.ArmRecord) -> Behaviour:
    clerk = ClaimRecorder(node, robotics, diary)
    parts: list[Behaviour] = [Navigate(clerk), WaitForStandstill(robotics), AtTarget(clerk)]
    return Retry(name=f"leg {node.node_id}", child=Sequence("go", memory=True, children=parts), num_failures=ATTEMPTS)
