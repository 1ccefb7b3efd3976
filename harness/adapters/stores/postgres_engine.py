"""Opens PostgreSQL connections through SQLAlchemy and psycopg, with their settings, and translates their failures.

Appends commit with synchronous_commit on: they are as durable as the server's own fsync setting makes them. The
server ends an idle transaction after a while, so that a suspended process does not block the others.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

import psycopg
from sqlalchemy import Engine, create_engine
from sqlalchemy.engine import URL, make_url
from sqlalchemy.event import listen
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from harness.contracts.errors import LogDamaged, StoreBusy, StoreUnavailable
from harness.contracts.reasons import because

SILENCE_S = 10
"""A transaction in which nothing is said for this long is ended by the server."""

_DIALECT = "postgresql+psycopg"
_NETWORK: Mapping[str, Any] = MappingProxyType(
    {
        "client_encoding": "utf8",
        "connect_timeout": 5,
        "keepalives_idle": 10,
        "keepalives_interval": 5,
        "keepalives_count": 3,
        "tcp_user_timeout": 20_000,
        "application_name": "regen",
    }
)
_REMEDIES = {
    "08": because("database_unreached"),
    "28": because("database_login_refused"),
    "3D": because("database_absent"),
    "3F": because("schema_absent"),
    "25": because("database_read_only"),
    "42": because("database_rights_missing"),
    "53": because("database_server_full"),
    "55": because("database_busy"),
    "57": because("database_restarting"),
    "58": because("database_disk_failing"),
}
_UNREACHED = "08"
_CORRUPT = "XX"
_LOCK_NOT_AVAILABLE = "55P03"


def server_url(url: str) -> URL:
    """The parsed URL of a PostgreSQL database; raises StoreUnavailable for anything else."""
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise StoreUnavailable(because("database_address_missing"), where="REGEN_DATABASE") from error
    if parsed.get_backend_name() not in ("postgresql", "postgres"):
        raise StoreUnavailable(because("log_kept_in_postgres"), where=display_url(parsed))
    return parsed.set(drivername=_DIALECT)


def display_url(url: URL) -> str:
    """The address for people: without the password."""
    return url.set(drivername=url.get_backend_name()).render_as_string(hide_password=True)


def libpq_url(url: URL) -> str:
    """The address as psycopg itself takes it."""
    return url.set(drivername="postgresql").render_as_string(hide_password=False)


def writer_engine(url: URL, *, busy_s: float) -> Engine:
    """For the one connection that appends: a commit is on the disk when it returns; it waits `busy_s` for others."""
    wait = f"SET lock_timeout = {max(1, int(busy_s * 1000))}"
    silence = f"SET idle_in_transaction_session_timeout = {SILENCE_S * 1000}"
    return _engine(url, f"SET synchronous_commit = on; {wait}; {silence}", poolclass=NullPool)


def reader_engine(url: URL) -> Engine:
    """For any number of threads that read: a small pool whose connections cannot write."""
    return _engine(url, "SET default_transaction_read_only = on", pool_size=4, max_overflow=12)


def aside_engine(url: URL) -> Engine:
    """For what may be lost in a power cut: its commits wait for no disk."""
    return _engine(url, "SET synchronous_commit = off", poolclass=NullPool)


@contextmanager
def translated(url: URL) -> Iterator[None]:
    """Turn the database's failures into StoreUnavailable with where and what to do."""
    try:
        yield
    except SQLAlchemyError as error:
        raise unavailable(url, error.orig if isinstance(error, DBAPIError) else error) from error
    except psycopg.Error as error:
        raise unavailable(url, error) from error


@contextmanager
def examined(url: URL) -> Iterator[None]:
    """The same, for a verification: rows or pages that the server calls corrupt are LogDamaged."""
    try:
        with translated(url):
            yield
    except StoreUnavailable as error:
        cause = error.__cause__
        if isinstance(cause, DBAPIError) and (sqlstate(cause.orig) or "").startswith(_CORRUPT):
            raise LogDamaged(because("database_damaged", error=_message(cause.orig)), where=display_url(url)) from cause
        raise


def unavailable(url: URL, cause: BaseException | None) -> StoreUnavailable:
    """What a database failure means for a person. Who waited too long for a lock has stored nothing."""
    kind = StoreBusy if sqlstate(cause) == _LOCK_NOT_AVAILABLE else StoreUnavailable
    return kind(
        because("log_unusable", error=_message(cause)),
        where=display_url(url),
        do=_REMEDIES.get((sqlstate(cause) or _UNREACHED)[:2], because("database_failing")),
    )


def sqlstate(cause: BaseException | None) -> str | None:
    """The server's five-character code; None without one, as when it cannot be reached."""
    return cause.sqlstate if isinstance(cause, psycopg.Error) else None


def _message(cause: BaseException | None) -> str:
    return " ".join(str(cause).split())


def _engine(url: URL, setting: str, **pool: Any) -> Engine:
    options = {"isolation_level": "AUTOCOMMIT", "connect_args": dict(_NETWORK), "use_native_hstore": False}
    engine = create_engine(url, **options, **pool)

    def set_up(connection: psycopg.Connection, _record: object) -> None:
        was, connection.autocommit = connection.autocommit, True
        connection.execute(setting)
        connection.autocommit = was

    listen(engine, "connect", set_up)
    return engine
