"""Stores accounts, sessions, tokens, their audit log and answers to idempotent requests in a database of its own.

Secrets are stored as digests only. The audit log is a separate hash chain: an entry's digest covers the one before it.
"""

import sqlite3
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from typing import Any, TypeVar

import msgspec
from sqlalchemy import Connection, RowMapping, create_engine, delete, func, insert, or_, select, update
from sqlalchemy.exc import IntegrityError, SQLAlchemyError
from sqlalchemy.pool import StaticPool

from harness.adapters.stores import accounts_rows, accounts_schema
from harness.adapters.stores.query_cache import QueryCache
from harness.contracts.errors import ConcurrencyConflict, LogDamaged, StoreNewer, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because
from harness.contracts.values import Value, encode

BUSY_S = 5.0
GENESIS = Digest("0" * 64)
Answer = TypeVar("Answer")


class SqlAccounts:
    """Accounts in one SQLite file, or in memory for tests. Safe between threads and processes."""

    def __init__(self, file: Path | None = None) -> None:
        """Opens or creates the file, readable by its owner alone. Raises StoreUnavailable or StoreNewer."""
        self._file = file
        if file is not None:
            _private(file)
        self._engine = create_engine(
            "sqlite://" if file is None else f"sqlite:///{file}",
            poolclass=StaticPool,
            isolation_level="AUTOCOMMIT",
            connect_args={"check_same_thread": False, "timeout": BUSY_S},
        )
        self.close = weakref.finalize(self, self._engine.dispose)
        self._lock = RLock()
        with self._connection() as connection:
            connection.exec_driver_sql("PRAGMA journal_mode=WAL")
            connection.exec_driver_sql("PRAGMA synchronous=FULL")
            found = int(connection.exec_driver_sql("PRAGMA user_version").scalar_one())
            if found > accounts_schema.VERSION:
                raise StoreNewer(because("accounts_newer"), where=str(file))
            accounts_schema.METADATA.create_all(connection, checkfirst=True)
            connection.exec_driver_sql(f"PRAGMA user_version={accounts_schema.VERSION}")
            driver = connection.connection.driver_connection
        assert isinstance(driver, sqlite3.Connection)
        self._remembered = QueryCache(driver)

    # accounts -------------------------------------------------------------------------------------------------------

    def accounts(self) -> list[accounts_rows.Account]:
        """All accounts, disabled ones included, by name."""
        return [
            _account(row)
            for row in self._rows(select(accounts_schema.ACCOUNTS).order_by(accounts_schema.ACCOUNTS.c.name))
        ]

    def account(self, name: str) -> accounts_rows.Account | None:
        def ask() -> accounts_rows.Account | None:
            return next(
                (
                    _account(row)
                    for row in self._rows(
                        select(accounts_schema.ACCOUNTS).where(accounts_schema.ACCOUNTS.c.name == name)
                    )
                ),
                None,
            )

        return self._answer(("account", name), ask)

    def any_account(self) -> bool:
        return self._answer(
            ("any account", ""), lambda: bool(self._rows(select(accounts_schema.ACCOUNTS.c.name).limit(1)))
        )

    def add_account(self, account: accounts_rows.Account) -> None:
        """Raises ConcurrencyConflict if the name is taken."""
        try:
            self._write(insert(accounts_schema.ACCOUNTS).values(_columns(account, roles=" ".join(account.roles))))
        except IntegrityError as error:
            raise ConcurrencyConflict(because("account_exists", name=account.name)) from error

    def change_account(self, account: accounts_rows.Account) -> None:
        row = _columns(account, roles=" ".join(account.roles))
        self._write(update(accounts_schema.ACCOUNTS).where(accounts_schema.ACCOUNTS.c.name == account.name).values(row))

    # identities -----------------------------------------------------------------------------------------------------

    def identity(self, issuer: str, subject: str) -> accounts_rows.ExternalIdentity | None:
        """The account of that identity."""
        mine = (accounts_schema.IDENTITIES.c.issuer == issuer) & (accounts_schema.IDENTITIES.c.subject == subject)
        return next((_identity(row) for row in self._rows(select(accounts_schema.IDENTITIES).where(mine))), None)

    def identities(self, name: str) -> list[accounts_rows.ExternalIdentity]:
        """Every identity that leads to one account, oldest first."""
        query = (
            select(accounts_schema.IDENTITIES)
            .where(accounts_schema.IDENTITIES.c.name == name)
            .order_by(accounts_schema.IDENTITIES.c.linked_at_s)
        )
        return [_identity(row) for row in self._rows(query)]

    def link(self, identity: accounts_rows.ExternalIdentity, *, account: accounts_rows.Account | None = None) -> None:
        """Store the identity and its new account, or neither. Raises ConcurrencyConflict if either is known already."""
        try:
            with self._transaction() as connection:
                if account is not None:
                    connection.execute(
                        insert(accounts_schema.ACCOUNTS).values(_columns(account, roles=" ".join(account.roles)))
                    )
                connection.execute(insert(accounts_schema.IDENTITIES).values(_columns(identity)))
        except IntegrityError as error:
            raise ConcurrencyConflict(because("identity_known", name=identity.name)) from error

    def unlink(self, issuer: str, subject: str) -> bool:
        """Whether it was linked."""
        mine = (accounts_schema.IDENTITIES.c.issuer == issuer) & (accounts_schema.IDENTITIES.c.subject == subject)
        return self._write(delete(accounts_schema.IDENTITIES).where(mine)) == 1

    # sessions -------------------------------------------------------------------------------------------------------

    def session(self, digest: str) -> accounts_rows.Session | None:
        """The session whose cookie this is, or was until it was rotated."""

        def ask() -> accounts_rows.Session | None:
            found = self._rows(
                select(accounts_schema.SESSIONS).where(
                    or_(accounts_schema.SESSIONS.c.digest == digest, accounts_schema.SESSIONS.c.previous == digest)
                )
            )
            return _session(found[0]) if found else None

        return self._answer(("session", digest), ask)

    def sessions(self, name: str) -> list[accounts_rows.Session]:
        """One person's, newest first."""
        query = (
            select(accounts_schema.SESSIONS)
            .where(accounts_schema.SESSIONS.c.name == name)
            .order_by(accounts_schema.SESSIONS.c.began_at_s.desc())
        )
        return [_session(row) for row in self._rows(query)]

    def open_session(self, session: accounts_rows.Session) -> None:
        self._write(insert(accounts_schema.SESSIONS).values(_columns(session)))

    def change_session(self, digest: str, session: accounts_rows.Session) -> bool:
        """Replace the session that has this digest; False if another request changed its digest first."""
        return (
            self._write(
                update(accounts_schema.SESSIONS)
                .where(accounts_schema.SESSIONS.c.digest == digest)
                .values(_columns(session))
            )
            == 1
        )

    def close_sessions(self, *, digest: str = "", name: str = "", but: str = "") -> int:
        """End one session by its digest, or all of a person's but one; how many."""
        if digest:
            return self._write(
                delete(accounts_schema.SESSIONS).where(
                    or_(accounts_schema.SESSIONS.c.digest == digest, accounts_schema.SESSIONS.c.previous == digest)
                )
            )
        return self._write(
            delete(accounts_schema.SESSIONS).where(
                accounts_schema.SESSIONS.c.name == name, accounts_schema.SESSIONS.c.digest != but
            )
        )

    # tokens ---------------------------------------------------------------------------------------------------------

    def tokens(self) -> list[accounts_rows.Token]:
        """All of them, revoked ones included, newest first."""
        return [
            _token(row)
            for row in self._rows(select(accounts_schema.TOKENS).order_by(accounts_schema.TOKENS.c.created_at_s.desc()))
        ]

    def token(self, digest: str) -> accounts_rows.Token | None:
        return next(
            (
                _token(row)
                for row in self._rows(select(accounts_schema.TOKENS).where(accounts_schema.TOKENS.c.digest == digest))
            ),
            None,
        )

    def add_token(self, token: accounts_rows.Token) -> None:
        self._write(insert(accounts_schema.TOKENS).values(_columns(token, scopes=" ".join(token.scopes))))

    def change_token(self, token: accounts_rows.Token) -> None:
        row = _columns(token, scopes=" ".join(token.scopes))
        self._write(
            update(accounts_schema.TOKENS).where(accounts_schema.TOKENS.c.token_id == token.token_id).values(row)
        )

    # the audit log --------------------------------------------------------------------------------------------------

    def record(
        self, *, at_s: float, kind: str, actor: str, role: str, subject: str, detail: str, source: str
    ) -> accounts_rows.AuditEntry:
        """Append one entry to the audit log's chain."""
        with self._transaction() as connection:
            last = (
                connection.execute(
                    select(accounts_schema.TRAIL).order_by(accounts_schema.TRAIL.c.number.desc()).limit(1)
                )
                .mappings()
                .first()
            )
            bare = accounts_rows.AuditEntry(
                number=(last["number"] if last else 0) + 1,
                at_s=at_s,
                kind=kind,
                actor=actor[:200],
                role=role,
                subject=subject[:200],
                detail=detail[:500],
                source=source[:100],
                previous=last["digest"] if last else GENESIS,
                digest="",
            )
            entry = msgspec.structs.replace(bare, digest=sha256(encode(bare)))
            connection.execute(insert(accounts_schema.TRAIL).values(_columns(entry)))
            return entry

    def audit_log(
        self, *, before: int | None = None, kind: str = "", actor: str = "", limit: int = 50
    ) -> list[accounts_rows.AuditEntry]:
        """Newest first, with numbers below `before`; `kind` may be a beginning such as `sign_in`."""
        query = select(accounts_schema.TRAIL).order_by(accounts_schema.TRAIL.c.number.desc()).limit(limit)
        if before is not None:
            query = query.where(accounts_schema.TRAIL.c.number < before)
        if kind:
            query = query.where(accounts_schema.TRAIL.c.kind.startswith(kind, autoescape=True))
        if actor:
            query = query.where(accounts_schema.TRAIL.c.actor == actor)
        return [_entry(row) for row in self._rows(query)]

    def refusals(self, *, since_s: float, name: str = "", source: str = "") -> tuple[int, float]:
        """How many sign-ins were refused since then (for a name: since its last success), and when the last one was."""
        column, value = (accounts_schema.TRAIL.c.subject, name) if name else (accounts_schema.TRAIL.c.source, source)
        mine = select(func.coalesce(func.max(accounts_schema.TRAIL.c.number), 0)).where(
            accounts_schema.TRAIL.c.kind == "sign_in.accepted", accounts_schema.TRAIL.c.subject == name
        )
        query = select(
            func.count().label("count"), func.coalesce(func.max(accounts_schema.TRAIL.c.at_s), 0.0).label("last_s")
        ).where(
            accounts_schema.TRAIL.c.kind == "sign_in.refused",
            column == value,
            accounts_schema.TRAIL.c.at_s > since_s,
            accounts_schema.TRAIL.c.number > mine.scalar_subquery(),
        )
        row = self._rows(query)[0]
        return int(row["count"]), float(row["last_s"])

    def verify_trail(self) -> int:
        """Recompute the chain; how many entries it has. Raises LogDamaged at the first entry that does not fit."""
        previous: str = GENESIS
        entries = 0
        for index, row in enumerate(
            self._rows(select(accounts_schema.TRAIL).order_by(accounts_schema.TRAIL.c.number)), start=1
        ):
            entry = _entry(row)
            bare = msgspec.structs.replace(entry, digest="")
            if (entry.number, entry.previous, entry.digest) != (index, previous, sha256(encode(bare))):
                raise LogDamaged(because("trail_damaged", number=entry.number), where=str(self._file or "memory"))
            previous = entry.digest
            entries = index
        return entries

    # idempotent requests --------------------------------------------------------------------------------------------

    def begin(self, answer: accounts_rows.StoredAnswer, *, forget_before_s: float) -> accounts_rows.StoredAnswer | None:
        """None if this key is new (it is reserved now), else what is stored of the first request."""
        with self._transaction() as connection:
            connection.execute(
                delete(accounts_schema.ANSWERS).where(accounts_schema.ANSWERS.c.begun_at_s < forget_before_s)
            )
            query = select(accounts_schema.ANSWERS).where(
                accounts_schema.ANSWERS.c.caller == answer.caller, accounts_schema.ANSWERS.c.key == answer.key
            )
            found = connection.execute(query).mappings().first()
            if found is None:
                connection.execute(insert(accounts_schema.ANSWERS).values(_columns(answer)))
                return None
            return accounts_rows.StoredAnswer(**dict(found))

    def keep(self, answer: accounts_rows.StoredAnswer) -> None:
        """Store the answer to a request that was begun."""
        mine = (accounts_schema.ANSWERS.c.caller == answer.caller) & (accounts_schema.ANSWERS.c.key == answer.key)
        self._write(update(accounts_schema.ANSWERS).where(mine).values(_columns(answer)))

    def forget(self, caller: str, key: str) -> None:
        """Free the key of a request that changed nothing."""
        self._write(
            delete(accounts_schema.ANSWERS).where(
                accounts_schema.ANSWERS.c.caller == caller, accounts_schema.ANSWERS.c.key == key
            )
        )

    # ----------------------------------------------------------------------------------------------------------------

    @contextmanager
    def _transaction(self) -> Iterator[Connection]:
        """One write transaction; writers of other processes queue for BUSY_S."""
        with self._connection() as connection:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            try:
                yield connection
            except BaseException:
                connection.exec_driver_sql("ROLLBACK")
                raise
            self._remembered.forget()
            connection.exec_driver_sql("COMMIT")

    @contextmanager
    def _connection(self) -> Iterator[Connection]:
        try:
            with self._lock, self._engine.connect() as connection:
                yield connection
        except IntegrityError:
            raise
        except SQLAlchemyError as error:
            raise self._unavailable(getattr(error, "orig", None) or error) from error

    def _unavailable(self, cause: object) -> StoreUnavailable:
        return StoreUnavailable(because("accounts_unusable", error=str(cause)), where=str(self._file or "memory"))

    def _answer(self, question: tuple[str, str], ask: Callable[[], Answer]) -> Answer:
        """Caches a query that every request makes; the database is read again after any write."""
        try:
            with self._lock:
                return self._remembered.answer(question, ask)
        except sqlite3.Error as error:
            raise self._unavailable(error) from error

    def _rows(self, query: Any) -> Sequence[RowMapping]:
        with self._connection() as connection:
            return connection.execute(query).mappings().all()

    def _write(self, statement: Any) -> int:
        with self._transaction() as connection:
            return int(connection.execute(statement).rowcount)


def _private(file: Path) -> None:
    try:
        file.touch(mode=0o600, exist_ok=True)
        file.chmod(0o600)
    except OSError as error:
        raise StoreUnavailable(
            because("accounts_unopened", error=error.strerror or str(error)), where=str(file)
        ) from error


def _columns(value: Value, **instead: Any) -> dict[str, Any]:
    return {**{name: getattr(value, name) for name in value.__struct_fields__}, **instead}


def _account(row: RowMapping) -> accounts_rows.Account:
    return accounts_rows.Account(**{**row, "roles": tuple(row["roles"].split()), "disabled": bool(row["disabled"])})


def _identity(row: RowMapping) -> accounts_rows.ExternalIdentity:
    return accounts_rows.ExternalIdentity(**{**row, "by_groups": bool(row["by_groups"])})


def _session(row: RowMapping) -> accounts_rows.Session:
    return accounts_rows.Session(**{**row, "invited": bool(row["invited"])})


def _token(row: RowMapping) -> accounts_rows.Token:
    return accounts_rows.Token(**{**row, "scopes": tuple(row["scopes"].split())})


def _entry(row: RowMapping) -> accounts_rows.AuditEntry:
    return accounts_rows.AuditEntry(**row)
