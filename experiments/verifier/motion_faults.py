"""Faults of the sensors of motion, applied to samples that the simulated robot published. Pure; drawn from a seed."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random

from msgspec.structs import replace

from harness.contracts.observations import Odometry, Trajectory

Distort = Callable[[Trajectory, "JudgedSpan", Random], Trajectory]


@dataclass(frozen=True)
class JudgedSpan:
    """The execution that is judged: from dispatch to collection, mission seconds."""

    from_s: float
    until_s: float

    def late(self, chance: Random, share: float = 0.5) -> float:
        """An instant in its last part."""
        return self.until_s - chance.uniform(0.0, share * (self.until_s - self.from_s))


def nothing(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """Every sensor as the simulator models it."""
    return track


def noisier(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser three times as noisy as the simulator's: 2 cm."""
    sigma = 0.02
    moved = (replace(p, x_m=p.x_m + chance.gauss(0, sigma), y_m=p.y_m + chance.gauss(0, sigma)) for p in track.poses)
    return replace(track, poses=tuple(moved))


def pose_gaps(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser drops out up to four times, for up to three seconds."""
    gaps = [(begin, begin + chance.uniform(0.3, 3.0)) for begin in (window.late(chance, 1.0) for _ in range(4))]
    remaining = tuple(p for p in track.poses if all(not a <= p.at_s <= b for a, b in gaps))
    return replace(track, poses=remaining)


def odometry_gaps(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """Odometry and IMU drop out up to three times, for up to two seconds."""
    gaps = [(begin, begin + chance.uniform(0.3, 2.0)) for begin in (window.late(chance, 1.0) for _ in range(3))]
    remaining = tuple(o for o in track.odometry if all(not a <= o.at_s <= b for a, b in gaps))
    return replace(
        track, odometry=remaining, imu=tuple(o for o in track.imu if all(not a <= o.at_s <= b for a, b in gaps))
    )


def silent(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser sends nothing more before the end."""
    since_s = window.until_s - chance.uniform(0.4, 6.0)
    return replace(track, poses=tuple(p for p in track.poses if p.at_s < since_s))


def deaf(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """All sensors send nothing more before the end."""
    since_s = window.until_s - chance.uniform(0.4, 6.0)
    return Trajectory(
        poses=tuple(p for p in track.poses if p.at_s < since_s),
        odometry=tuple(p for p in track.odometry if p.at_s < since_s),
        imu=tuple(p for p in track.imu if p.at_s < since_s),
        scans=track.scans,
    )


def stale(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser repeats its last pose with its old stamp."""
    since_s = window.late(chance)
    held = [p for p in track.poses if p.at_s < since_s][-1:]
    late = (replace(held[0], seq=p.seq) for p in track.poses if p.at_s >= since_s) if held else ()
    return replace(track, poses=(*(p for p in track.poses if p.at_s < since_s), *late))


def frozen(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser repeats its last pose with fresh stamps."""
    since_s = window.late(chance)
    held = [p for p in track.poses if p.at_s < since_s][-1:]
    late = (replace(held[0], seq=p.seq, at_s=p.at_s) for p in track.poses if p.at_s >= since_s) if held else ()
    return replace(track, poses=(*(p for p in track.poses if p.at_s < since_s), *late))


def jumps(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser takes the body for elsewhere from within the last two seconds on."""
    return _shifted(track, since_s=window.until_s - chance.uniform(0.2, 2.0), chance=chance)


def jumps_earlier(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser takes the body for elsewhere from some instant of the execution on."""
    return _shifted(track, since_s=window.late(chance, 0.8), chance=chance)


def biased(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser is off by the same vector from before the dispatch on: its motion is right, its place is not."""
    return _shifted(track, since_s=-math.inf, chance=chance)


def slips(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """Feet or wheels slip for a while: odometry counts up to twice the way."""
    return _counted(track, chance.uniform(1.2, 2.0), window, chance)


def no_odometry(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """Odometry is missing; IMU and localiser go on."""
    return replace(track, odometry=())


def no_localiser(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser never sent anything."""
    return replace(track, poses=())


def other_map(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The poses are of another version of the map."""
    return replace(track, poses=tuple(replace(p, map_version="site-0") for p in track.poses))


def mirrored(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser's y axis is mirrored."""
    return replace(track, poses=tuple(replace(p, y_m=-p.y_m, yaw_rad=-p.yaw_rad) for p in track.poses))


def unsure(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser itself says that it is unsure, for the last part or throughout."""
    since_s = window.late(chance, 1.0)
    return replace(track, poses=tuple(replace(p, confidence=0.3) if p.at_s >= since_s else p for p in track.poses))


def clock_behind(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser's clock is behind that of the other sensors."""
    late_s = chance.uniform(0.3, 4.0)
    return replace(track, poses=tuple(replace(p, at_s=p.at_s - late_s) for p in track.poses))


def clock_ahead(track: Trajectory, window: JudgedSpan, chance: Random) -> Trajectory:
    """The localiser's clock is ahead of that of the other sensors."""
    early_s = chance.uniform(0.3, 4.0)
    return replace(track, poses=tuple(replace(p, at_s=p.at_s + early_s) for p in track.poses))


FAULTS: tuple[tuple[str, Distort], ...] = (
    ("none", nothing),
    ("localiser three times as noisy", noisier),
    ("localiser drops out", pose_gaps),
    ("odometry drops out", odometry_gaps),
    ("localiser goes silent", silent),
    ("all sensors go silent", deaf),
    ("localiser repeats an old pose, old stamp", stale),
    ("localiser frozen, fresh stamps", frozen),
    ("localiser jumps in the last 2 s", jumps),
    ("feet slip: odometry counts too much", slips),
    ("odometry missing", no_odometry),
    ("localiser missing", no_localiser),
    ("poses of another map", other_map),
    ("localiser says it is unsure", unsure),
    ("localiser's clock behind", clock_behind),
    ("localiser's clock ahead", clock_ahead),
)


def _shifted(track: Trajectory, *, since_s: float, chance: Random) -> Trajectory:
    angle, off_m = chance.uniform(-math.pi, math.pi), chance.uniform(0.15, 2.0)
    dx, dy = off_m * math.cos(angle), off_m * math.sin(angle)
    moved = (replace(p, x_m=p.x_m + dx, y_m=p.y_m + dy) if p.at_s >= since_s else p for p in track.poses)
    return replace(track, poses=tuple(moved))


def _counted(track: Trajectory, times: float, window: JudgedSpan, chance: Random) -> Trajectory:
    """Odometry whose steps count `times` as much during a part of the execution."""
    from_s = window.late(chance)
    until_s = from_s + chance.uniform(1.0, 12.0)
    return replace(track, odometry=tuple(_steps(track.odometry, times, from_s, until_s)))


def _steps(odometry: Sequence[Odometry], times: float, from_s: float, until_s: float) -> list[Odometry]:
    found: list[Odometry] = []
    x = y = 0.0
    for index, one in enumerate(odometry):
        if index:
            before = odometry[index - 1]
            share = times if from_s <= one.at_s <= until_s else 1.0
            x, y = x + share * (one.x_m - before.x_m), y + share * (one.y_m - before.y_m)
        else:
            x, y = one.x_m, one.y_m
        speed = times * one.v_mps if from_s <= one.at_s <= until_s else one.v_mps
        found.append(replace(one, x_m=x, y_m=y, v_mps=speed))
    return found
