"""Who gives the commands of this command line."""

import getpass

from harness.contracts.actors import Actor


def me() -> Actor:
    """The person at this terminal."""
    return Actor(name=getpass.getuser(), role="operator")
