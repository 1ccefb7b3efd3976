"""The one table of roles and permissions, and the one function that reads it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

from app.i18n.catalogues import N_
from harness.contracts.actors import Actor
from harness.contracts.errors import HarnessError
from harness.contracts.reasons import because

Role = Literal["viewer", "operator", "reviewer", "releaser", "admin"]
Permission = Literal[
    "read", "export", "drive", "stop", "observe", "decide", "dispute", "attest", "alerts", "propose", "review",
    "release", "policy", "trail", "people", "erase", "suggest", "robots",
]  # fmt: skip
ROLES: tuple[str, ...] = get_args(Role)
GRANTS: Mapping[Permission, tuple[Role, ...]] = {
    "read": ("viewer", "operator", "reviewer", "releaser", "admin"),
    "export": ("operator",),
    "drive": ("operator",),
    "stop": ("operator", "reviewer", "releaser", "admin"),
    "observe": ("operator",),
    "decide": ("operator",),
    "dispute": ("operator", "reviewer"),
    "attest": ("operator",),
    "alerts": ("operator", "admin"),
    "propose": ("releaser", "reviewer", "operator"),
    "review": ("reviewer",),
    "release": ("releaser",),
    "policy": ("admin",),
    "trail": ("reviewer", "releaser", "admin"),
    "people": ("admin",),
    "erase": ("admin",),
    "suggest": ("operator",),
    "robots": ("admin",),
}
SCOPES: frozenset[Permission] = frozenset({"read", "suggest", "drive", "stop", "observe"})
"""The scopes a token may have; answering handoffs, releasing and managing accounts are for people only."""
OF_ACCOUNTS: frozenset[Permission] = frozenset({"decide", "attest", "review", "release", "policy", "erase"})
"""What counts as a person's decision: it needs an account that somebody signed in to, at a page or a terminal."""
HOST_PREFIX = "host:"
"""Before the name of a user of this machine; no account's name may have a colon."""

MEANING: Mapping[Permission, str] = {
    "read": N_("see missions, evidence and the log"),
    "export": N_("export a mission's 3D view"),
    "drive": N_("start and resume missions"),
    "stop": N_("stop and pause missions"),
    "observe": N_("look again at a handoff, without motion"),
    "decide": N_("answer a handoff"),
    "dispute": N_("dispute an accepted completion"),
    "attest": N_("attest to what was seen"),
    "alerts": N_("acknowledge, shelve, suppress and assign alerts"),
    "propose": N_("propose changes to the harness and speak about them"),
    "review": N_("review candidates"),
    "release": N_("release and roll back configurations"),
    "policy": N_("say who must agree before a release"),
    "trail": N_("read who signed in and who commanded what"),
    "people": N_("change accounts, roles and tokens"),
    "erase": N_("erase voice and photographs"),
    "suggest": N_("propose a goal for a person to start"),
    "robots": N_("add, change and remove robots of the site"),
}


class NotPermitted(HarnessError):
    """A signed-in principal asked for something that their roles or scopes do not allow."""

    code = "not_permitted"


@dataclass(frozen=True)
class Principal:
    """Who is asking: a person with roles, or an integration with scopes; from where; `session` is a cookie's digest.

    `robot_id` binds an integration to one robot. `invited` came by the first link, before there were accounts. `host`
    is a user of this machine at a terminal who signed in to no account: they run, stop and administer, and what they do
    is stored with the channel `policy`, so that it never counts as a person's decision.
    """

    name: str
    roles: tuple[str, ...] = ()
    scopes: tuple[str, ...] = ()
    source: str = ""
    session: str = ""
    robot_id: str = ""
    invited: bool = False
    host: bool = False

    @property
    def actor(self) -> Actor:
        """The principal as an actor with all their roles; a command is stored with the one role that allowed it."""
        if self.host:
            return Actor(name=self.name, role="host", channel=self._channel)
        return Actor(name=self.name, role="+".join(self.roles) or "integration", channel=self._channel)

    def acting(self, permission: Permission) -> Actor:
        """The actor in the role that allows it; raises NotPermitted."""
        if self.host:
            if permission in OF_ACCOUNTS:
                raise NotPermitted(because("account_needed", meaning=MEANING[permission]), where=self.name)
            return self.actor
        if not self.roles:
            if permission not in self.scopes:
                raise NotPermitted(
                    because("token_not_permitted", meaning=MEANING[permission], scope=permission),
                    where=because("at_token_scopes", name=self.name, scopes=tuple(self.scopes) or ("none",)),
                )
            return Actor(name=self.name, role="integration", channel=self._channel)
        role = next((one for one in GRANTS[permission] if one in self.roles), None)
        if role is None:
            raise NotPermitted(
                because("role_not_permitted", meaning=MEANING[permission], roles=tuple(GRANTS[permission])),
                where=because("at_principal", name=self.name, roles=tuple(self.roles)),
            )
        return Actor(name=self.name, role=role, channel=self._channel)

    def may(self, permission: Permission) -> bool:
        """Whether their roles, scopes or place at a terminal of this machine allow it."""
        if self.host:
            return permission not in OF_ACCOUNTS
        return permission in (permissions_of(self.roles) if self.roles else self.scopes)

    @property
    def only_reads(self) -> bool:
        return not any(self.may(permission) for permission in GRANTS if permission not in ("read", "export", "trail"))

    @property
    def _channel(self) -> Literal["human", "policy"]:
        return "human" if self.roles and not self.host else "policy"


def permissions_of(roles: Collection[str]) -> tuple[Permission, ...]:
    """Everything these roles may do together."""
    return _granted(frozenset(roles))


@cache
def _granted(roles: frozenset[str]) -> tuple[Permission, ...]:
    return tuple(permission for permission, allowed in GRANTS.items() if not roles.isdisjoint(allowed))
