"""Names the person who gives the commands of this command line."""

import getpass

from app.auth.permissions import Principal
from harness.contracts.actors import Actor


def me() -> Actor:
    """The person at this terminal."""
    return Actor(name=getpass.getuser(), role="operator")


def here() -> Principal:
    """Whoever may read and write the data folder is its admin."""
    return Principal(name=me().name, roles=("admin",), source="terminal")
