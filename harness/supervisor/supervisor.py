"""Runs missions on robots: one loop per mission, one mission at a time per robot; people answer between two steps."""

import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event, RLock, Thread

from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import EndMission, StopMission
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.errors import HarnessError, ProviderFailed, StoreUnavailable, UnknownName
from harness.contracts.ids import HandoffId, MissionId, ResourceId, RobotId
from harness.contracts.person_commands import PersonCommand
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.supervisor.agent_loop import AgentLoop
from harness.supervisor.handoff_timeouts import overlooked
from harness.supervisor.leases import SUPERVISOR, FreeOrder, freed
from harness.supervisor.pinned_configurations import check_readable, readable, tell_unreadable
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.safe_return import Returning
from harness.supervisor.standstill import Rest

LOG = logging.getLogger("regen.supervisor")
IDLE_WAIT_S = 0.2
BUSY_WAIT_S = 0.01
OUTAGE_WAIT_S = 1.0
OUTAGE_TRIES = 60
"""How often a foreground run retries an unavailable log, OUTAGE_WAIT_S of the robot's time apart."""
ROBOT_TRIES = 10
"""How many steps of a foreground run may break on a robot's answers before the run gives up."""
HALT_WAIT_S = 0.02
"""How long a stop waits until the robot has answered it, wall seconds; it is in the log already."""
WAITING: frozenset[str] = frozenset({"awaiting_human", "paused", "awaiting_approval"})


@dataclass
class NextStep:
    """When a robot is stepped next: at an instant of its mission time, or, where nothing is due, of the machine's."""

    robot_id: RobotId
    due_s: float | None = None
    again_at_s: float = 0.0


def never() -> bool:
    """A run that nobody interrupts."""
    return False


class Supervisor:
    """The loops of all robot connections. A lock per robot keeps a person's answer and a step apart.

    After StoreUnavailable a caller may try again: open work is then read again from the log, as after a restart.
    """

    def __init__(self, *, runtime: Runtime, connections: Mapping[RobotId, RobotConnection]) -> None:
        self._runtime = runtime
        self._connections = connections
        self._locks = {robot_id: RLock() for robot_id in connections}
        self._loops: dict[RobotId, dict[MissionId, AgentLoop]] = {robot_id: {} for robot_id in connections}
        self._cut_off: set[RobotId] = set()
        self._current: dict[RobotId, MissionId | None] = {}
        self._returning = {
            robot_id: Returning(runtime=runtime, connection=connection) for robot_id, connection in connections.items()
        }
        self._halt = Event()
        self._threads: list[Thread] = []

    def unfinished(self, robot_id: RobotId) -> list[Mission]:
        """Missions of this robot that are neither over nor waiting for a person, oldest first."""
        return [mission for mission in self._open(robot_id) if mission.status not in WAITING]

    def close_interrupted_replays(self) -> None:
        """End replays that an earlier process left open: nothing moves in them, and nobody will continue them."""
        for mission in self._runtime.open_missions():
            if mission.replay:
                self._runtime.submit(
                    mission.mission_id, EndMission(status="failed", reason=because("replay_interrupted"))
                )

    def run(
        self,
        mission_id: MissionId,
        *,
        watch: Callable[[Mission], None] | None = None,
        interrupted: Callable[[], bool] = never,
    ) -> Mission:
        """Run in the foreground until the mission has ended, is interrupted between two steps or, at speed 0, waits
        for a person.

        A step that breaks on what the robot answers stops the mission. Raises StoreUnavailable if the log stays
        unavailable, and what the robot answers if the mission cannot even be stopped.
        """
        mission = self._runtime.mission(mission_id)
        clock, tries, broken = self._connections[mission.robot_id].clock, 0, 0
        while not self._halt.is_set() and not interrupted():
            try:
                wake_s = self.step(mission_id)
                mission = self._runtime.mission(mission_id)
            except StoreUnavailable as error:
                tries += 1
                if tries > OUTAGE_TRIES:
                    raise
                LOG.error("store_unavailable mission=%s %s", mission_id, error)
                clock.wait_until(clock.now().mission_s + OUTAGE_WAIT_S)
                continue
            except ProviderFailed as error:
                broken += 1
                if broken > ROBOT_TRIES:
                    raise
                self._broken(mission, error)
                clock.wait_until(clock.now().mission_s + OUTAGE_WAIT_S)
                continue
            tries = 0
            if watch is not None:
                watch(mission)
            if wake_s is None:
                return mission
            clock.wait_until(wake_s)
        return mission

    def step(self, mission_id: MissionId) -> float | None:
        """One step of one mission's loop, on what the log holds as it begins. Raises ConfigurationMissing where the
        mission's pinned version cannot be read."""
        with self._turn_of(self._robot_of(mission_id)), self._runtime.turn():
            return self._step(self._runtime.mission(mission_id))

    def _robot_of(self, mission_id: MissionId) -> RobotId:
        """Known without a look at the log where the mission was stepped before: it never changes."""
        known = next((robot_id for robot_id, loops in self._loops.items() if mission_id in loops), None)
        return known or self._runtime.mission(mission_id).robot_id

    def _step(self, mission: Mission) -> float | None:
        check_readable(self._runtime, mission)
        if self._returning[mission.robot_id].under_way:
            return self.step_retreat(mission.robot_id)
        wake_s = self._loop(mission).step()
        sent = self._returning[mission.robot_id].under_way
        return self._connections[mission.robot_id].clock.now().mission_s if sent else wake_s

    def bring_to_rest(self, mission_id: MissionId) -> Rest:
        """Stop the robot of a mission that nobody goes on with now, and measure that it stands; the mission stays open.

        `static` is false where 15 s of mission time did not show it.
        """
        mission = self._runtime.mission(mission_id)
        with self._turn_of(mission.robot_id):
            return self._loop(mission).bring_to_rest()

    def step_retreat(self, robot_id: RobotId) -> float:
        """One step of a robot's open return, before any mission of this robot goes on; its end is recorded at once."""
        with self._turn_of(robot_id):
            wake_s = self._returning[robot_id].step()
            if not self._returning[robot_id].under_way:
                self.finish_unanswered(robot_id)
            return wake_s

    def answer(self, handoff_id: HandoffId, command: PersonCommand) -> Decision[AnyEvent]:
        """Apply a person's answer between two steps of the robot's loop; what it authorises begins at once."""
        opened = self._runtime.handoff(handoff_id).opened
        if opened is None or opened.robot_id not in self._connections:
            return refused("no_robot", because("handoff_robot_away"))
        with self._turn_of(opened.robot_id):
            loop = self._loop(self._runtime.mission(opened.mission_id))
            decision = loop.handoff_service.answer(handoff_id, command)
            if isinstance(decision, Accepted):
                self._begin(loop, opened.robot_id)
            return decision

    def _begin(self, loop: AgentLoop, robot_id: RobotId) -> None:
        """The step after an answer. The answer stands if the step fails; the robot's own loop meets the failure
        again."""
        try:
            with self._turn_of(robot_id):
                loop.step()
        except HarnessError as error:
            LOG.warning("step_after_answer_failed mission=%s code=%s %s", loop.mission_id, error.code, error)

    def free(self, resource: ResourceId, *, actor: Actor, reason: str) -> Accepted[AnyEvent] | Refused:
        """A named person frees a quarantined resource; the robot is looked at between two steps of its loop.

        Raises UnknownName for a resource that was never leased.
        """
        lease = self._runtime.lease(resource)
        if not lease.version:
            raise UnknownName(because("never_leased", resource=resource))
        robot_id = RobotId(resource.partition("/")[0])
        if robot_id not in self._connections:
            return refused("no_robot", because("lease_robot_away"))
        with self._locks[robot_id]:
            return freed(self._runtime, self._connections[robot_id], FreeOrder(resource, actor, reason))

    def halt(self, robot_id: RobotId) -> None:
        """Tell this robot's providers to stop what they run, at once and beside its loop, where a stop is in the log.

        Returns after HALT_WAIT_S at the latest, although the robot may not have answered. The loop follows the stop to
        its acknowledgement and to standstill. An answer that does not come is its matter.
        """
        if robot_id in self._connections:
            halting = Thread(target=self._halt_now, args=(robot_id,), name=f"halt {robot_id}", daemon=True)
            halting.start()
            halting.join(HALT_WAIT_S)

    def _halt_now(self, robot_id: RobotId) -> None:
        try:
            self._returning[robot_id].halt()
            for mission_id, loop in tuple(self._loops[robot_id].items()):
                if self._runtime.mission(mission_id).status == "stopping":
                    loop.halt()
        except HarnessError as error:
            LOG.warning("halt_failed robot=%s code=%s %s", robot_id, error.code, error)

    def finish_unanswered(self, robot_id: RobotId) -> None:
        """Carry out what is still due where a question expired and the harness stopped before the robot acted."""
        for handoff in overlooked(self._runtime, robot_id):
            if handoff.opened is None:
                continue
            with self._locks[robot_id]:
                self._loop(self._runtime.mission(handoff.opened.mission_id)).handoff_timeouts.act(handoff)

    def serve(self) -> None:
        """Run in the background: every robot works through its missions, oldest first.

        One thread steps all robots of this process, since threads would only hand Python's one processor to each other;
        a robot of another process has a thread of its own, which waits for its answers.
        """
        tell_unreadable(self._runtime)
        for robot_id in self._connections:
            self.finish_unanswered(robot_id)
        together = tuple(robot_id for robot_id, one in self._connections.items() if one.in_process)
        apart = ((robot_id,) for robot_id, one in self._connections.items() if not one.in_process)
        for robots in (together, *apart) if together else apart:
            thread = Thread(target=self._work, args=(robots,), name=f"robot {' '.join(robots)}", daemon=True)
            thread.start()
            self._threads.append(thread)

    def close(self) -> None:
        """Let running steps finish and stop the threads. Missions continue from the log at the next start."""
        self._halt.set()
        for thread in self._threads:
            thread.join(timeout=10.0)

    def _work(self, robots: Sequence[RobotId]) -> None:
        """Step these robots: of those that are due the one that waited longest, else the next to wake.

        A robot without anything due is looked at again after a while, but a robot whose time passes only by waiting for
        it does not wait for that.
        """
        waiting = deque(NextStep(robot_id) for robot_id in robots)
        while not self._halt.is_set():
            following = next(filter(self._overdue, waiting), None) or min(waiting, key=self._rank)
            self._wait(following)
            waiting.remove(following)
            waiting.append(following)
            if not self._locks[following.robot_id].acquire(blocking=len(waiting) == 1):
                following.again_at_s, following.due_s = self._now(following).wall_s + BUSY_WAIT_S, None
                continue  # a person's answer is being carried out on it: the others go on
            try:
                following.due_s = self._turn(following.robot_id)
                following.again_at_s = self._now(following).wall_s + IDLE_WAIT_S
            except StoreUnavailable as error:
                LOG.error("store_unavailable robot=%s %s", following.robot_id, error)
                self._halt.wait(OUTAGE_WAIT_S)
            finally:
                self._locks[following.robot_id].release()

    def _overdue(self, following: NextStep) -> bool:
        return self._left_s(following) <= 0

    def _rank(self, following: NextStep) -> tuple[bool, float]:
        left_s = self._left_s(following)
        return following.due_s is None and left_s > 0, left_s

    def _left_s(self, following: NextStep) -> float:
        """How long until this robot is stepped: seconds of its own clock, or of the machine's where nothing is due."""
        if following.due_s is None:
            return following.again_at_s - self._now(following).wall_s
        return following.due_s - self._now(following).mission_s

    def _now(self, following: NextStep) -> Moment:
        return self._connections[following.robot_id].clock.now()

    def _wait(self, following: NextStep) -> None:
        if following.due_s is not None:
            self._connections[following.robot_id].clock.wait_until(following.due_s)
        elif (left_s := self._left_s(following)) > 0:
            self._halt.wait(left_s)

    def _turn(self, robot_id: RobotId) -> float | None:
        """One step of this robot's current mission; when the next one is due in mission time, None where nothing is.

        Raises StoreUnavailable: nothing can be decided then, and the robot's heartbeat watchdog stops it.
        """
        with self._turn_of(robot_id):
            with self._runtime.turn():
                if not self._returning[robot_id].under_way:
                    mission = self._next(robot_id)
                    return self._step_or_stop(mission) if mission is not None else None
            return self.step_retreat(robot_id)

    def _step_or_stop(self, mission: Mission) -> float | None:
        try:
            return self._step(mission)
        except StoreUnavailable:
            raise
        except HarnessError as error:
            self._broken(mission, error)
            return None

    def _next(self, robot_id: RobotId) -> Mission | None:
        """The oldest mission of this robot that has not ended; the one that was stepped last, as long as it is open."""
        known = self._current.get(robot_id)
        mission = self._runtime.mission(known) if known is not None else None
        if mission is None or mission.ended or not readable(self._runtime, mission):
            mission = next(iter(self._open(robot_id)), None)
            self._current[robot_id] = mission.mission_id if mission is not None else None
        return mission

    def _open(self, robot_id: RobotId) -> list[Mission]:
        """What this robot can continue, oldest first: no replay, and no pinned version that is unreadable here."""
        mine = reversed(self._runtime.open_missions(robot_id))
        return [mission for mission in mine if not mission.replay and readable(self._runtime, mission)]

    def _broken(self, mission: Mission, error: HarnessError) -> None:
        """A step failed for a reason the loop does not handle: stop the mission and say why; the next one runs."""
        LOG.error("step_failed mission=%s code=%s %s", mission.mission_id, error.code, error)
        self._loops[mission.robot_id].pop(mission.mission_id, None)
        if mission.status == "stopping" and mission.invocation is None:
            self._runtime.submit(mission.mission_id, EndMission(status="failed", reason=error.reason))
        else:
            self._runtime.submit(mission.mission_id, StopMission(actor=SUPERVISOR, reason=error.reason))

    def _loop(self, mission: Mission) -> AgentLoop:
        """The loop of a mission; loops of this robot's ended missions are dropped when another begins."""
        loops = self._loops[mission.robot_id]
        if mission.mission_id not in loops:
            for over in [one for one in loops if self._runtime.mission(one).ended]:
                del loops[over]
            connection = self._connections[mission.robot_id]
            loops[mission.mission_id] = AgentLoop(
                runtime=self._runtime, connection=connection, mission_id=mission.mission_id
            )
        return loops[mission.mission_id]

    @contextmanager
    def _turn_of(self, robot_id: RobotId) -> Iterator[None]:
        """This robot's lock. An outage drops its loops: none goes on with what it believed to be stored.

        A no-answer action that the outage interrupted is carried out first afterwards.
        """
        with self._locks[robot_id]:
            try:
                if robot_id in self._cut_off:
                    self.finish_unanswered(robot_id)
                    self._cut_off.discard(robot_id)
                yield
            except StoreUnavailable:
                self._cut_off.add(robot_id)
                self._loops[robot_id].clear()
                raise
