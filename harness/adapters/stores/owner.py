"""Gives a data folder one owner (D11): the running supervisor holds owner.lock, which names its address.

The lock is the kernel's (flock): it ends with the process, however that ends. The file stays and is taken over.
A child made by fork without exec would inherit the lock; children of the harness are started by exec.
"""

import fcntl
import os
import time
from pathlib import Path
from types import TracebackType

import msgspec

from harness.contracts.errors import StoreOwned, StoreUnavailable
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

_NAME = "owner.lock"
_TRIES = 25
_PAUSE_S = 0.02


class Owner(Value):
    """Who owns a data folder: `token` opens its API at `url` (empty until it listens). `started_s` is wall time."""

    pid: int
    url: str
    token: str
    started_s: float


class OwnerLock:
    """The ownership of `folder`. Taken by `take`, given back by `release` or the end of the process."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / _NAME
        self._file: int | None = None
        self._started_s = 0.0

    def take(self, *, token: str, url: str = "") -> Owner:
        """Become the owner; if it already is, update its entry, such as the address it now listens on.

        Raises StoreOwned naming the present owner's process and address, StoreUnavailable if the folder cannot be
        written.
        """
        if self._file is None:
            self._file = self._lock()
            self._started_s = time.time()
        owner = Owner(pid=os.getpid(), url=url, token=token, started_s=self._started_s)
        body = encode(owner)
        try:
            os.pwrite(self._file, body, 0)
            os.ftruncate(self._file, len(body))
        except OSError as error:
            raise _unusable(self._path, error) from error
        return owner

    def release(self) -> None:
        """Stop being the owner. Without effect if it is not."""
        if self._file is not None:
            os.ftruncate(self._file, 0)
            os.close(self._file)
            self._file = None

    def __enter__(self) -> "OwnerLock":
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.release()

    def _lock(self) -> int:
        try:
            file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            os.fchmod(file, 0o600)
        except OSError as error:
            raise _unusable(self._path, error) from error
        for _ in range(_TRIES):
            if _locked(file, fcntl.LOCK_EX):
                os.ftruncate(file, 0)
                return file
            time.sleep(_PAUSE_S)
        os.close(file)
        raise _owned(self._path.parent)


def read_owner(folder: Path) -> Owner | None:
    """The live owner of `folder`, or None. Raises StoreUnavailable if the owner's entry cannot be read."""
    path = folder / _NAME
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unusable(path, error) from error
    try:
        for _ in range(_TRIES):
            if _locked(file, fcntl.LOCK_SH):
                return None
            try:
                return decode(os.pread(file, 65536, 0), Owner)
            except msgspec.DecodeError:
                time.sleep(_PAUSE_S)
    finally:
        os.close(file)
    raise StoreUnavailable(because("owner_unknown"), where=str(path))


def _locked(file: int, kind: int) -> bool:
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _owned(folder: Path) -> StoreOwned:
    owner = read_owner(folder)
    if owner is None:
        return StoreOwned(because("folder_just_returned"), where=str(folder))
    if not owner.url:
        return StoreOwned(because("folder_owned_without_address", pid=owner.pid), where=str(folder))
    return StoreOwned(because("folder_owned", pid=owner.pid, url=owner.url), where=str(folder))


def _unusable(path: Path, error: OSError) -> StoreUnavailable:
    return StoreUnavailable(because("folder_unownable", error=error.strerror or str(error)), where=str(path))
