"""Names the operating-system user who runs a command, by the process's user id and not by environment variables."""

import os
import pwd

from app.auth.permissions import HOST_PREFIX, Principal
from harness.contracts.actors import Actor


def host_user() -> str:
    """The name of the user this process runs as; `uid-N` for one without a name."""
    uid = os.geteuid()
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"uid-{uid}"


def me() -> Actor:
    """The user of this machine as an actor: it has no account and cannot decide as a person."""
    return here().actor


def here() -> Principal:
    """Whoever may read and write the data folder administers it; decisions need an account (`regen login`)."""
    return Principal(name=f"{HOST_PREFIX}{host_user()}", source="terminal", host=True)
