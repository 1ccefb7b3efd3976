"""The installation's key: seals what is stored beside the log and is not the log. It never lies in the data folder.

Somebody who can write the data folder but not this file cannot make a snapshot that is used (D59).
"""

import os
import secrets
import stat
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from harness.contracts.reasons import Reason, because

KEY_BYTES = 32
LARGEST_KEY = 4096
_PLACE = Path("regenharness") / "installation.key"


@dataclass(frozen=True)
class InstallationKey:
    """The secret; or why there is none, and then it is empty."""

    secret: bytes = b""
    missing: Reason | None = None

    def __repr__(self) -> str:
        return f"InstallationKey(missing={self.missing!r})"


def standard_place() -> Path | None:
    """$XDG_STATE_HOME/regenharness/installation.key, or below ~/.local/state; None for a user without a home."""
    if given := os.environ.get("XDG_STATE_HOME"):
        return Path(given) / _PLACE
    try:
        return Path.home() / ".local" / "state" / _PLACE
    except RuntimeError:
        return None


def installation_key(given: Path | None, *, data: Path, make: bool) -> InstallationKey:
    """The key in the file `given`, or at the standard place. With `make` it is made where there is none.

    Never raises: a file in the data folder, of another user, that others can read, or too short gives no key, and why.
    """
    place = given or standard_place()
    if place is None:
        return InstallationKey(missing=because("installation_key_homeless"))
    place = place.absolute()
    if place.resolve().is_relative_to(data.resolve()):
        return InstallationKey(missing=because("installation_key_in_data_folder", path=str(place)))
    try:
        if make and not place.exists():
            _create(place)
        return _read(place)
    except FileNotFoundError:
        return InstallationKey(missing=because("installation_key_absent", path=str(place)))
    except OSError as error:
        return InstallationKey(
            missing=because("installation_key_unusable", path=str(place), error=error.strerror or str(error))
        )


def _read(place: Path) -> InstallationKey:
    with os.fdopen(os.open(place, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or found.st_uid not in (os.getuid(), 0) or found.st_mode & 0o077:
            return InstallationKey(missing=because("installation_key_exposed", path=str(place)))
        secret = file.read(LARGEST_KEY + 1)
    if not KEY_BYTES <= len(secret) <= LARGEST_KEY:
        return InstallationKey(missing=because("installation_key_length", path=str(place), bytes=len(secret)))
    return InstallationKey(secret=secret)


def _create(place: Path) -> None:
    """Written whole under another name, then linked: two processes that begin together read the same key."""
    place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    number, name = tempfile.mkstemp(dir=place.parent, prefix=".installation-")
    try:
        with os.fdopen(number, "wb") as file:
            file.write(secrets.token_bytes(KEY_BYTES))
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileExistsError):
            os.link(name, place)
    finally:
        os.unlink(name)
