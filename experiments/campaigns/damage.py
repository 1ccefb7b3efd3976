"""Tests damage to a data folder: a full disk, a folder that cannot be written, damaged blobs and logs.

In every case a `regen` process must fail with a clear message, the log must be sound up to its last commit, and `regen
doctor` must name the damage.
"""

import ctypes
import os
import resource
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.campaigns.regen import KINEMATIC, regen
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.values import Value

SMALL_DISK_BYTES = 300_000
READ_ONLY = "read-only folder"
PR_CAPBSET_DROP = 24
OVERRIDES = (1, 2, 3)
"""CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, CAP_FOWNER."""
_LIBC = ctypes.CDLL(None)


class DamageReport(Value):
    """Cases that were tried, and what went wrong. `skipped`: cases that cannot be produced on this machine."""

    cases: int
    skipped: tuple[str, ...]
    offences: tuple[str, ...]


def damages() -> DamageReport:
    """Every case, each on its own folder, a copy of the folder of one whole mission."""
    offences: list[str] = []
    with TemporaryDirectory(prefix="damage-") as folder:
        root = Path(folder)
        whole = root / "whole"
        regen("mission", "run", "circuit", "--data", whole, *KINEMATIC)
        cases = {name: case for name, case in CASES.items() if name != READ_ONLY or _modes_bind()}
        for name, case in cases.items():
            copy = root / name.replace(" ", "-")
            shutil.copytree(whole, copy)
            offences += [f"{name}: {sentence}" for sentence in case(copy)]
    skipped = tuple(name for name in CASES if name not in cases)
    return DamageReport(cases=len(cases), skipped=skipped, offences=tuple(offences))


def _blob(data: Path) -> list[str]:
    """Changes one byte of one blob."""
    file = max((path for path in (data / "blobs").rglob("*") if path.is_file()), key=lambda path: path.stat().st_size)
    _turn_byte(file, file.stat().st_size // 2)
    return _named(data, file.name[:16])


def _lost_blob(data: Path) -> list[str]:
    """Deletes a blob that an event cites: reading it must report this, and the rest of the log stays readable."""
    store = SqlEventStore(prepare(data).log_url)
    try:
        bodies = b"".join(event.body for event in store.read(limit=1_000_000))
    finally:
        store.close()
    files = [path for path in (data / "blobs").rglob("*") if path.is_file()]
    cited = next(path for path in files if path.name.encode() in bodies)
    mission = regen("mission", "list", "--data", data, "--json")
    cited.unlink()
    after = regen("mission", "list", "--data", data, "--json")
    return [] if after.stdout == mission.stdout else ["the missions cannot be read any more"]


def _event(data: Path) -> list[str]:
    """Flips one bit of one stored event."""
    file = data / "events.db"
    place = file.read_bytes().find(b'"kind":"NodeCommitted"')
    if place < 0:
        return ["the log holds no commit to damage"]
    _turn_byte(file, place + 25)
    return _named(data, "position")


def _truncated(data: Path) -> list[str]:
    """Cuts off the second half of the database file."""
    file = data / "events.db"
    os.truncate(file, file.stat().st_size // 2)
    return _named(data, "events.db")


def _full_disk(data: Path) -> list[str]:
    """The next mission has no space to write: it must report this, and the missions before it are sound."""
    done = regen("mission", "run", "circuit", "--data", data, *KINEMATIC, before=_small_disk)
    wrong = _output_lines(done)
    return wrong + _sound(data)


def _read_only(data: Path) -> list[str]:
    """The folder cannot be written: nothing begins."""
    for path in [data, *data.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    done = regen("mission", "run", "circuit", "--data", data, *KINEMATIC, before=_bound_by_modes)
    for path in [data, *data.rglob("*")]:
        path.chmod(0o700 if path.is_dir() else 0o600)
    return _output_lines(done) + _sound(data)


CASES: dict[str, Callable[[Path], list[str]]] = {
    "corrupt blob": _blob,
    "missing blob": _lost_blob,
    "flipped bit in the log": _event,
    "truncated database": _truncated,
    "full disk": _full_disk,
    READ_ONLY: _read_only,
}


def _named(data: Path, what: str) -> list[str]:
    """Whether the doctor finds the damage and names it without a traceback."""
    found = regen("doctor", "--data", data)
    text = found.stdout + found.stderr
    wrong = [] if found.returncode == 1 else [f"the doctor ended with {found.returncode}"]
    wrong += [] if what in text else [f"the doctor does not name {what}: {text[-200:]}"]
    return wrong + (["the doctor broke down"] if "Traceback" in text else [])


def _output_lines(done: subprocess.CompletedProcess[str]) -> list[str]:
    wrong = [] if done.returncode not in (0, 3) else [f"it ended with {done.returncode} as if nothing was wrong"]
    wrong += ["it broke down with a traceback"] if "Traceback" in done.stderr + done.stdout else []
    return wrong + ([] if (done.stderr + done.stdout).strip() else ["it said nothing"])


def _sound(data: Path) -> list[str]:
    """Whether the log is whole up to its last commit."""
    verified = regen("audit", "verify", "--data", data)
    return [] if verified.returncode == 0 else [f"the log does not verify: {verified.stderr[-200:]}"]


def _turn_byte(file: Path, place: int) -> None:
    with file.open("r+b") as opened:
        opened.seek(place)
        byte = opened.read(1)
        opened.seek(place)
        opened.write(bytes([byte[0] ^ 0x01]))


def _small_disk() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (SMALL_DISK_BYTES, SMALL_DISK_BYTES))


def _bound_by_modes() -> None:
    """A superuser may write where the modes forbid it, so the child drops that privilege before it begins."""
    if os.geteuid() == 0:
        for capability in OVERRIDES:
            _LIBC.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)


def _modes_bind() -> bool:
    """Whether a child can be kept from writing by a folder's modes here."""
    with TemporaryDirectory(prefix="modes-") as folder:
        Path(folder).chmod(0o555)
        attempt = subprocess.run(["touch", f"{folder}/x"], capture_output=True, check=False, preexec_fn=_bound_by_modes)
        Path(folder).chmod(0o700)
    return attempt.returncode != 0
