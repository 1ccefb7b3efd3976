"""Serves the simulated robot over HTTP: the provider protocol, its clock, and the simulation's own commands."""

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
from starlette.applications import Starlette

from harness.contracts.errors import ProviderFailed, ProviderUnreachable
from harness.contracts.measurements import Sound
from harness.contracts.protocol import Picture
from harness.contracts.reasons import because
from harness.provider_protocol import wire
from harness.provider_protocol.operations import Names, Operation, provider_operations
from harness.provider_protocol.operator_operations import camera_operations, hand_operations
from harness.provider_protocol.service import provider_service
from simulator.bodies import TICK_S
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.teleoperation import SimulatedTeleoperation

FREE_RUN_AFTER_S = 2.0
SLIP_S = 0.25
PICTURE_S = 0.5
LONGEST_ADVANCE_S = 120.0
REAL_TIME = 1.0
LEAD_S = 0.75
"""How far a robot runs ahead of who supervises it at more than real time, in mission seconds: less than its heartbeat
watchdog and a pose's freshness allow."""
SLOWED = 0.1
"""Mission seconds per second while the supervisor is that far behind: never 0, so that the watchdog strikes."""
ALONE_AFTER_S = 1.0
GIVE_WAY_S = 0.05


class Pace:
    """Lets a robot's time pass, and lets one caller at a time see it.

    At speed 0 only `advance` moves time; but when no request came for FREE_RUN_AFTER_S of wall time and something
    moves, time runs by itself, so that the heartbeat watchdog works when the harness is gone.

    A speed above real time is a wish. Time is what the physics reached, so a slow machine slows it; and it drops to
    SLOWED while nobody has looked at the robot for LEAD_S, so that a slow supervisor is not left behind. A robot whose
    parent is gone runs on at its speed until it stands.
    """

    def __init__(self, robot: SimulatedRobot, speed: float) -> None:
        self.robot, self.speed = robot, speed
        self._lock = threading.Lock()
        self._asked_s = time.monotonic()
        self._asking = 0
        self._counting = threading.Lock()
        self._ended = threading.Event()
        self._orphaned_s: float | None = None
        self._retired = False
        self._thread = threading.Thread(target=self._run, name="pace", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def end(self) -> None:
        """Stop time; returns when it stands."""
        self._ended.set()
        self._thread.join()

    def orphan(self) -> None:
        """No more requests will come: do not wait before running free."""
        self._orphaned_s = time.monotonic()

    @property
    def silent_s(self) -> float:
        """Wall seconds since the last request."""
        return time.monotonic() - self._asked_s

    def retire(self, *, after_s: float) -> bool:
        """Stop taking requests if the robot stands and no request came for `after_s`; whether that is so."""
        with self._lock:
            self._retired = not self.robot.moving and self.silent_s >= after_s
            return self._retired

    @contextmanager
    def turn(self) -> Iterator[None]:
        """One request at a time. Raises ProviderUnreachable once retired: nothing may adopt a robot that ends."""
        self._count(1)
        try:
            with self._lock:
                if self._retired:
                    raise ProviderUnreachable(because("robot_ending"), where=self.robot.robot_id)
                self._asked_s = time.monotonic()
                yield
                self._asked_s = time.monotonic()
        finally:
            self._count(-1)

    def standing(self) -> bool:
        """Whether nothing moves and nothing is about to move."""
        with self._lock:
            return not self.robot.moving

    def speed_now(self) -> float:
        """Mission seconds per second that are wanted now: 0 while time stands."""
        if not self.speed:
            return REAL_TIME if self._runs_free() else 0.0
        late = self.speed > REAL_TIME and self.robot.unattended_s > LEAD_S and not self._runs_on()
        return SLOWED if late else self.speed

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._ended.is_set():
            speed = self.speed_now()
            if speed == 0.0:
                self._ended.wait(0.05)
                due_s = time.monotonic()
                continue
            self._give_way()
            with self._lock:
                self.robot.advance_to(self.robot.at_s + TICK_S)
            due_s = max(due_s + TICK_S / speed, time.monotonic() - SLIP_S / speed)
            self._ended.wait(max(due_s - time.monotonic(), 0.0))

    def _give_way(self) -> None:
        """Requests go before the next tick: where the physics cannot keep pace, it would hold the lock all the time."""
        until_s = time.monotonic() + GIVE_WAY_S
        while self._asking and time.monotonic() < until_s:
            self._ended.wait(0.0005)

    def _count(self, change: int) -> None:
        with self._counting:
            self._asking += change

    def _runs_free(self) -> bool:
        silent = self._orphaned_s is not None or self.silent_s > FREE_RUN_AFTER_S
        return silent and not self.standing()

    def _runs_on(self) -> bool:
        """Whether the parent is gone, nobody has adopted the robot since, and it has not come to stand yet; the last
        requests of the parent may still arrive. One that stands waits for its next supervisor slowly, so that the start
        of a console costs the stage under way little of its time."""
        alone = self._orphaned_s is not None and self._asked_s < self._orphaned_s + ALONE_AFTER_S
        return alone and not self.standing()


class PacedCamera:
    """Implements `contracts.ports.LiveCamera`: one picture every PICTURE_S of wall time, however many people look."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._lock = threading.Lock()
        self._newest: Picture | None = None
        self._taken_s = -PICTURE_S

    def picture(self) -> Picture:
        """The newest one, taken again if it is older than PICTURE_S."""
        with self._lock:
            if self._newest is None or time.monotonic() - self._taken_s > PICTURE_S:
                self._newest, self._taken_s = self._robot.picture(), time.monotonic()
            return self._newest


def simulation_operations(pace: Pace) -> tuple[Operation, ...]:
    """What only a simulated robot serves."""
    robot = pace.robot

    def clock(names: Names, body: None) -> wire.ClockReading:
        return wire.ClockReading(at_s=robot.at_s, speed=pace.speed, monotonic_s=time.monotonic())

    def advance(names: Names, body: wire.Advance) -> wire.Done:
        if pace.speed:
            raise ProviderFailed(because("runs_by_itself"), where="/simulation/advance")
        step_s = body.until_s - robot.at_s
        if not 0 <= step_s <= LONGEST_ADVANCE_S:
            reason = because("step_out_of_bounds", step_s=step_s, limit_s=LONGEST_ADVANCE_S)
            raise ProviderFailed(reason, where="/simulation/advance")
        return wire.Done(at_s=robot.advance_to(body.until_s))

    def configure(names: Names, body: wire.MissionSettings) -> wire.Done:
        robot.configure(body.mission_id, body.seed, parse_faults(body.faults))
        return wire.Done(at_s=robot.at_s)

    def save(names: Names, body: None) -> wire.Done:
        robot.save()
        return wire.Done(at_s=robot.at_s)

    def press(names: Names, body: wire.HardwareStop) -> wire.Done:
        robot.press_hardware_stop(engaged=body.engaged)
        return wire.Done(at_s=robot.at_s)

    def clear(names: Names, body: None) -> wire.Done:
        robot.clear_way()
        return wire.Done(at_s=robot.at_s)

    def play(names: Names, body: Sound) -> wire.Done:
        robot.room.play(body)
        return wire.Done(at_s=robot.at_s)

    def recording(names: Names, body: None) -> bytes:
        return robot.room.recording(_seconds(names, "from_s"), _seconds(names, "until_s"))

    def struck(names: Names, body: None) -> dict[str, int]:
        return robot.struck()

    return (
        Operation("GET", "/clock", "Mission time", wire.ClockReading, clock),
        Operation(
            "POST", "/simulation/advance", "Lockstep: run to a mission time", wire.Done, advance, body=wire.Advance
        ),
        Operation("POST", "/simulation/configure", "Begin a mission", wire.Done, configure, body=wire.MissionSettings),
        Operation("POST", "/simulation/save", "Write the world durably", wire.Done, save),
        Operation(
            "POST", "/simulation/hardware-stop", "Press the red button", wire.Done, press, body=wire.HardwareStop
        ),
        Operation("POST", "/simulation/clear-way", "Somebody moves what stands in the way", wire.Done, clear),
        Operation("POST", "/simulation/room/sound", "A loudspeaker plays in the room", wire.Done, play, body=Sound),
        Operation(
            "GET",
            "/simulation/room/recording",
            "What the room's microphone heard",
            bytes,
            recording,
            instants=("from_s", "until_s"),
        ),
        Operation("GET", "/simulation/struck", "Faults that struck", dict[str, int], struck),
    )


def _seconds(names: Names, name: str) -> float:
    """An instant in a query. Raises ValidationError for what is no finite number."""
    try:
        seconds = float(names.get(name, ""))
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise msgspec.ValidationError(f"Expected mission seconds - at `${name}`")
    return seconds


def robot_service(pace: Pace, token: str) -> Starlette:
    """The whole service of one simulated robot."""
    operations = (
        *provider_operations(pace.robot),
        *camera_operations(PacedCamera(pace.robot)),
        *hand_operations(SimulatedTeleoperation(pace.robot)),
        *simulation_operations(pace),
    )
    return provider_service(operations, token=token, turn=pace.turn, title=f"Simulated robot {pace.robot.robot_id}")
