"""Watches a robot whose own stack decides: reads that stack's goals and the robot's samples, and has ended ones judged.

It holds no provider and no lease, and knows no operation that commands. What it reads is committed by the gate under
the robot's own shadow stream.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import TypeVar

from msgspec.structs import replace

from harness.contracts.errors import HarnessError, ProviderFailed
from harness.contracts.ids import RobotId
from harness.contracts.observations import Odometry, Pose, Trajectory
from harness.contracts.ports import Clock, ObservedRobot
from harness.contracts.protocol import MOST_CHANGES, Observations, StackGoal
from harness.contracts.reasons import Reason, because
from harness.contracts.shadow import JudgeStackGoal, NoteStackGoal, NoteStackGoalLost, StackCondition, shadow_stream
from harness.contracts.values import encode
from harness.gate.commit import CommandEnvelope
from harness.gate.shadow import MOST_SAMPLES
from harness.projections.shadow import ShadowGoal, ShadowGoals
from harness.provider_protocol.stack_changes import all_changes
from harness.runtime import Runtime
from harness.verification.declared_success import FRESH_S, STANDS_FOR_S
from harness.workers import Background, Worker

S = TypeVar("S", Pose, Odometry)
EVERY_S = 0.5
RECENT_S = 60.0
MOST_RECENT = 20_000
BATCH, MOST_BATCHES = 5000, 24
VANISHED_S = 30.0
"""A stack that was silent for so long, seconds of this machine, ends the waiting for its goals."""
JUDGE_WITHIN_S = 10.0
"""A goal that is over is judged by what there is, so long after its last word was read, seconds of this machine."""
BACK_S = 1.0
"""A robot's clock that is so far behind itself went back: samples of before are of another time."""
_order = attrgetter("at_s")


@dataclass(frozen=True)
class _Ended:
    """A goal that the stack calls over, and when that was read here."""

    goal: StackGoal
    read_s: float


class ShadowWatch(Background):
    """One observed robot. Of the `clock` the machine's own time counts, for silence.

    `apart`: the samples come by another path than what the stack declares. `step` reads once and is what tests call;
    `watch` repeats it in the background.
    """

    def __init__(
        self,
        robot_id: RobotId,
        robot: ObservedRobot,
        *,
        runtime: Runtime,
        clock: Clock,
        apart: bool = False,
    ) -> None:
        self.robot_id, self._robot, self._runtime = robot_id, robot, runtime
        self._clock, self._apart = clock, apart
        self._run, self._after = "", 0
        self._samples: deque[Pose | Odometry] = deque(maxlen=MOST_RECENT)
        self._sampled, self._robot_s = 0, 0.0
        self._ended: dict[str, _Ended] = {}
        self._answered_s = clock.now().wall_s
        self.condition = StackCondition(robot_id=robot_id)
        self._worker = Worker(f"shadow {robot_id}", self.step, every_s=EVERY_S)

    def step(self) -> None:
        """Read goals, then samples; have judged what is over."""
        try:
            self._read()
        except HarnessError as error:
            self.condition = replace(self.condition, trouble=error.reason)
            silent_s = self._wall_s - self._answered_s
            if silent_s > VANISHED_S:
                self._judge(late=True)
                self._lose(self._shadow.under_way, because("stack_vanished", silent_s=silent_s))
            return
        self._judge(late=False)

    def _read(self) -> None:
        status = self._robot.status()
        if status.robot_id != self.robot_id:
            raise ProviderFailed(because("another_robot_answers", found=status.robot_id[:80], expected=self.robot_id))
        stack, at_s = self._read_goals()
        self._read_samples()
        self._answered_s = self._wall_s
        poses = [one for one in self._samples if isinstance(one, Pose)]
        self.condition = StackCondition(
            robot_id=self.robot_id,
            stack=stack,
            at_s=at_s,
            heard_s=self._wall_s,
            localised=status.localised,
            status=status,
            pose=max(poses, key=_order, default=None),
        )

    def _read_goals(self) -> tuple[str, float]:
        """Note new changes; the stack's name, and its time."""
        found = self._robot.stack_goals(self._after, MOST_CHANGES)
        first = found.run != self._run
        if first:
            self._begin(found.run, at_s=found.at_s)
            found = self._robot.stack_goals(0, MOST_CHANGES)
        elif found.at_s < self._robot_s - BACK_S:
            back = because("stack_clock_back", back_s=self._robot_s - found.at_s)
            self._forget(found.at_s)
            self._lose(self._shadow.under_way, back)
        found = all_changes(self._robot, found)
        if found.run != self._run:
            raise ProviderFailed(because("stack_restarts"))
        self._robot_s = max(self._robot_s, found.at_s)
        self._note(found.stack, found.changes, first=first)
        self._after = max([self._after, *(one.seq for one in found.changes)])
        return found.stack, found.at_s

    def _begin(self, run: str, *, at_s: float) -> None:
        """Another start of the stack: what an earlier one left open has no end that anybody will learn."""
        self._run, self._after = run, 0
        self._forget(at_s)
        self._lose([one for one in self._shadow.under_way if one.run != run], because("stack_restarted"))

    def _forget(self, at_s: float) -> None:
        """Samples and last words of before are of another time: nothing may be judged by them."""
        self._samples.clear()
        self._ended.clear()
        self._sampled, self._robot_s = 0, at_s

    def _note(self, stack: str, changes: Sequence[StackGoal], *, first: bool) -> None:
        """A goal that was over before anybody watched is history of that stack: it is left alone."""
        over = {one.goal_id for one in changes if one.ended} if first else frozenset()
        for one in changes:
            known = self._shadow.find(self._run, one.goal_id)
            if known is None and one.goal_id in over:
                continue
            if known is None or not one.ended:
                self._commit(NoteStackGoal(robot_id=self.robot_id, stack=stack, run=self._run, goal=one))
            if one.status == "unknown":
                lost = self._shadow.find(self._run, one.goal_id)
                self._lose([lost] if lost else [], because("stack_outcome_unknown"))
            elif one.ended and (known is None or known.declared is None):
                self._ended.setdefault(one.goal_id, _Ended(one, self._wall_s))
        if first:
            named = {one.goal_id for one in changes}
            forgotten = [one for one in self._shadow.under_way if one.goal.goal_id not in named]
            self._lose(forgotten, because("stack_goal_forgotten"))

    def _read_samples(self) -> None:
        for _ in range(MOST_BATCHES):
            batch = self._robot.observations(self._sampled, BATCH)
            self._take(batch)
            if len(batch.samples) < BATCH:
                break
        oldest_s = min([self._robot_s - RECENT_S, *(one.goal.at_s - FRESH_S for one in self._ended.values())])
        while self._samples and self._samples[0].at_s < oldest_s:
            self._samples.popleft()

    def _take(self, batch: Observations) -> None:
        """A robot that numbers its samples anew is read from the start."""
        if not batch.samples and batch.next_seq < self._sampled:
            self._sampled = 0
        fresh = [one for one in batch.samples if one.seq > self._sampled]
        self._sampled = max([self._sampled, *(one.seq for one in fresh)])
        self._samples.extend(one for one in fresh if isinstance(one, Pose | Odometry))

    def _judge(self, *, late: bool) -> None:
        """Have judged what is over, once the two seconds after it are covered, or cannot be any more."""
        newest_s = max((one.at_s for one in self._samples), default=float("-inf"))
        for goal_id, ended in list(self._ended.items()):
            waits = newest_s < ended.goal.at_s + STANDS_FOR_S
            if waits and not late and self._wall_s - ended.read_s < JUDGE_WITHIN_S:
                continue
            evidence = trajectory_around(ended.goal.at_s, self._samples)
            self._runtime.keep(encode(evidence))
            self._commit(
                JudgeStackGoal(
                    robot_id=self.robot_id, run=self._run, goal=ended.goal, evidence=evidence, apart=self._apart
                )
            )
            del self._ended[goal_id]

    def _lose(self, goals: Iterable[ShadowGoal], reason: Reason) -> None:
        for one in goals:
            self._commit(
                NoteStackGoalLost(robot_id=self.robot_id, run=one.run, goal_id=one.goal.goal_id, reason=reason)
            )

    def _commit(self, command: NoteStackGoal | JudgeStackGoal | NoteStackGoalLost) -> None:
        self._runtime.commit([CommandEnvelope(shadow_stream(self.robot_id), command, None)])

    @property
    def _wall_s(self) -> float:
        return self._clock.now().wall_s

    @property
    def _shadow(self) -> ShadowGoals:
        found: ShadowGoals = self._runtime.fold(shadow_stream(self.robot_id))
        return found


def trajectory_around(at_s: float, samples: Iterable[Pose | Odometry]) -> Trajectory:
    """The poses and the odometry from a second before to two seconds after, in order of their own time; of more than
    the gate takes, an even part with both ends.
    """
    around = sorted((one for one in samples if at_s - FRESH_S <= one.at_s <= at_s + STANDS_FOR_S), key=_order)
    poses = [one for one in around if isinstance(one, Pose)]
    odometry = [one for one in around if isinstance(one, Odometry)]
    return Trajectory(poses=_thinned(poses), odometry=_thinned(odometry))


def _thinned(samples: list[S]) -> tuple[S, ...]:
    every = -(-len(samples) // MOST_SAMPLES) or 1
    return tuple(samples[::every][: MOST_SAMPLES - 1] + samples[-1:]) if every > 1 else tuple(samples)
