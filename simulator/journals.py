"""Persists what the robot remembers across restarts: physical starts, and its world at the last save."""

import os
from pathlib import Path

import msgspec

from harness.contracts.errors import LogDamaged, StoreUnavailable
from harness.contracts.protocol import PhysicalStart
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

FORGOTTEN_SEQUENCE = 2000
BOOT_S = 2.0


class SavedWorld(Value):
    """Clock, body, odometer and counters; metres, radians, mission seconds.

    `stance`: position, attitude and joints of a walking body. `believed`: the pose that its controller believed in.
    """

    at_s: float
    seq: int
    pose: tuple[float, float, float]
    odometer: tuple[float, float, float]
    charge: float
    reached_m: dict[str, float]
    stance: tuple[float, ...] = ()
    believed: tuple[float, float, float] | None = None


class StartJournal:
    """One line per physical start, fsynced before the start happens; in memory when `path` is None."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._starts: list[PhysicalStart] = []
        if path is not None and path.exists():
            body = path.read_bytes()
            whole = body[: body.rfind(b"\n") + 1]
            if len(whole) < len(body):
                os.truncate(path, len(whole))
            self._starts = [_start(path, number, line) for number, line in enumerate(whole.splitlines(), start=1)]

    def write(self, start: PhysicalStart) -> None:
        """Durable on return. Raises StoreUnavailable, and then nothing may move."""
        if self._path is not None:
            try:
                with self._path.open("ab") as file:
                    file.write(encode(start) + b"\n")
                    file.flush()
                    os.fsync(file.fileno())
            except OSError as error:
                reason = because("start_journal_unwritable", error=error.strerror or str(error))
                raise StoreUnavailable(reason, where=str(self._path)) from error
        self._starts.append(start)

    def all(self) -> tuple[PhysicalStart, ...]:
        return tuple(self._starts)


def _start(path: Path, number: int, line: bytes) -> PhysicalStart:
    try:
        return decode(line, PhysicalStart)
    except msgspec.MsgspecError as error:
        reason = because("start_journal_unreadable", error=str(error))
        raise LogDamaged(reason, where=f"{path}:{number}") from error


def save_world(path: Path, world: SavedWorld, *, durable: bool) -> None:
    """Replace the file atomically; `durable` also waits for the disk."""
    fresh = path.with_suffix(".new")
    with fresh.open("wb") as file:
        file.write(encode(world))
        if durable:
            file.flush()
            os.fsync(file.fileno())
    os.replace(fresh, path)


def load_world(path: Path) -> SavedWorld | None:
    """The world as it was saved, its clock and sequence moved past everything that may have been reported since."""
    if not path.exists():
        return None
    try:
        world = decode(path.read_bytes(), SavedWorld)
    except msgspec.MsgspecError as error:
        raise LogDamaged(because("world_unreadable", error=str(error)), where=str(path)) from error
    return msgspec.structs.replace(world, at_s=world.at_s + BOOT_S, seq=world.seq + FORGOTTEN_SEQUENCE)
