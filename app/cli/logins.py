"""regen login, logout and whoami: a terminal acts as an account of a data folder, by a token in a file of its user."""

import os
import stat
import sys
import time
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from app.auth.accounts import Accounts, TooManyAttempts
from app.auth.permissions import Principal
from app.auth.sessions import LOGIN_PREFIX, Origin, SessionService
from app.cli import output
from app.cli.data_folder import opened
from app.cli.person import here
from app.i18n.reasons.rendering import explained
from app.settings import ConsoleSettings
from harness.contracts.errors import ContractInvalid, HarnessError, StoreUnavailable
from harness.contracts.ids import sha256
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

TERMINAL = Origin(source="terminal", agent="command line")


class Login(Value):
    """Who signed in to which data folder, and the token of the session."""

    folder: str
    name: str
    token: str


def login(
    name: str,
    data: output.Data = output.DEFAULT_DATA,
    password_stdin: Annotated[
        bool, typer.Option("--password-stdin", help="Read the password from standard input.")
    ] = False,
    token_stdin: Annotated[
        bool, typer.Option("--token-stdin", help="Read a token of your account page from standard input.")
    ] = False,
    as_json: output.Json = False,
) -> None:
    """Sign in to an account of this data folder: what you decide at this terminal is then that person's word.

    Without a password, because you sign in at the identity provider: make a token on your account page.
    The token lies in a file that only you may read; it ends with the session, as in a browser, or by `regen logout`.
    """
    with opened(data) as accounts:
        if not accounts.store.any_account():
            raise ContractInvalid(because("no_account_yet"), where=str(data))
        sessions = _sessions(accounts)
        if token_stdin:
            token: str | TooManyAttempts | None = _given_token(sessions, name)
        else:
            token = sessions.terminal_sign_in(name, output.password(from_stdin=password_stdin), TERMINAL)
        if isinstance(token, TooManyAttempts):
            raise ContractInvalid(because("sign_in_throttled", wait_s=token.wait_s), where=name)
        if token is None:
            raise ContractInvalid(because("sign_in_refused"), where=name)
        account = accounts.known(name)
    _write(Login(folder=str(data.resolve()), name=name, token=token))
    answer = {"name": name, "roles": list(account.roles), "file": str(_file(data))}
    output.show(answer, as_json=as_json, lines=[f"Signed in as {name} ({', '.join(account.roles)})."])


def logout(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """End the session of this terminal, and forget its token."""
    found = _read(data)
    if found is not None:
        with opened(data) as accounts:
            _sessions(accounts).leave_terminal(found.token)
        _file(data).unlink(missing_ok=True)
    sentence = f"{found.name} is signed out." if found else "Nobody was signed in here."
    output.show({"name": found.name if found else ""}, as_json=as_json, lines=[sentence])


def whoami(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Who acts here: an account, or a user of this machine without one."""
    found = principal(data)
    role_list = (
        ", ".join(found.roles) if found.roles else "no account: may run, stop and administer, and decides nothing"
    )
    output.show(
        {"name": found.name, "roles": list(found.roles)}, as_json=as_json, lines=[f"{found.name} ({role_list})"]
    )


def token_of(data: Path) -> str:
    """The token of whoever is signed in at this terminal; empty for nobody, said on standard error if they were.

    Nothing is opened where nobody signed in; where the accounts cannot be read, nobody is signed in: stopping goes on.
    """
    found = _read(data)
    if found is None:
        return ""
    try:
        with opened(data) as accounts:
            good = _sessions(accounts).bearer(f"Bearer {found.token}", source="terminal") is not None
    except StoreUnavailable as error:
        sys.stderr.write(f"regen: {found.name} is not signed in: {explained(error)}\n")
        return ""
    if not good:
        sys.stderr.write(f"regen: the session of {found.name} is over; sign in again with `regen login {found.name}`\n")
        _file(data).unlink(missing_ok=True)
    return found.token if good else ""


def principal(data: Path) -> Principal:
    """Who acts at this terminal on this data folder."""
    token = token_of(data)
    if not token:
        return here()
    with opened(data) as accounts:
        return _sessions(accounts).bearer(f"Bearer {token}", source="terminal") or here()


def acting_name(data: Path) -> str:
    """The name of whoever acts at this terminal on this data folder."""
    return principal(data).name


def _given_token(sessions: SessionService, name: str) -> str:
    """The token on standard input. Raises ContractInvalid unless it is one of a terminal of this person's."""
    token = sys.stdin.readline().strip()
    found = sessions.bearer(f"Bearer {token}", source="terminal") if token.startswith(LOGIN_PREFIX) else None
    if found is None or found.name != name:
        raise ContractInvalid(because("terminal_token_refused", name=name), where=name)
    return token


def _sessions(accounts: Accounts) -> SessionService:
    settings = ConsoleSettings()
    return SessionService(
        accounts,
        owner_token="",
        operator=settings.operator,
        limits=(settings.session_idle_s, settings.session_age_s),
        clock=time.time,
        fresh=accounts.fresh,
    )


def _folder() -> Path:
    """Where the logins of this user lie: REGEN_LOGINS, else in the user's own configuration."""
    named = os.environ.get("REGEN_LOGINS", "")
    config = os.environ.get("XDG_CONFIG_HOME", "")
    return Path(named) if named else (Path(config) if config else Path.home() / ".config") / "regen" / "logins"


def _file(data: Path) -> Path:
    return _folder() / f"{sha256(str(data.resolve()).encode())[:24]}.json"


def _write(found: Login) -> None:
    path = _file(Path(found.folder))
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        path.unlink(missing_ok=True)
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        with os.fdopen(file, "wb") as out:
            out.write(encode(found))
    except OSError as error:
        raise StoreUnavailable(
            because("file_unreadable", error=error.strerror or str(error)), where=str(path)
        ) from error


def _read(data: Path) -> Login | None:
    """The login of this user. Raises HarnessError for a file that others may read or that is another user's."""
    path = _file(data)
    try:
        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise HarnessError(because("file_unreadable", error=error.strerror or str(error)), where=str(path)) from error
    with os.fdopen(file, "rb") as source:
        found = os.fstat(source.fileno())
        if found.st_uid != os.geteuid() or stat.S_IMODE(found.st_mode) & 0o077:
            raise HarnessError(because("login_file_open_to_others"), where=str(path))
        try:
            return decode(source.read(65536), Login)
        except msgspec.DecodeError:
            return None
