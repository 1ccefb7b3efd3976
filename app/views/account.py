"""Shapes a person's own account page, and the list of all accounts for an admin."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from app.auth import permissions
from app.i18n.messages import listed
from app.views.shell import Shell


@dataclass(frozen=True)
class OpenSession:
    """One browser that is signed in."""

    browser: str
    began_at_s: float
    seen_at_s: float
    this: bool


@dataclass(frozen=True)
class Ability:
    """One permission, and whether this person has it."""

    meaning: str
    allowed: bool
    roles: str


@dataclass(frozen=True)
class AccountPage:
    """A person's own page. `invited`: signed in by the first link, no account yet; `by_password`: has a password."""

    shell: Shell
    name: str
    roles: str
    invited: bool
    by_password: bool
    keeps_people: bool
    abilities: tuple[Ability, ...]
    sessions: tuple[OpenSession, ...]
    errors: tuple[str, ...]
    done: str
    token: str


@dataclass(frozen=True)
class RoleChoice:
    """One role as a checkbox."""

    name: str
    held: bool


@dataclass(frozen=True)
class Person:
    """One account in the list. `by_groups`: made by the identity provider's word, which also gives the roles.

    `identities`: who they are there.
    """

    name: str
    roles: tuple[RoleChoice, ...]
    disabled: bool
    created_at_s: float
    last_seen_at_s: float | None
    by_groups: bool
    identities: tuple[str, ...]


@dataclass(frozen=True)
class TokenRow:
    """One token in the list. `state` is in use, expired or revoked."""

    token_id: str
    name: str
    scopes: str
    robot_id: str
    created_by: str
    created_at_s: float
    used_at_s: float | None
    state: str


@dataclass(frozen=True)
class ScopeChoice:
    """One scope as a checkbox."""

    name: str
    meaning: str


@dataclass(frozen=True)
class PeoplePage:
    """Accounts and tokens. `secret` is a token just made: shown on this answer and never again."""

    shell: Shell
    first: bool
    people: tuple[Person, ...]
    roles: tuple[RoleChoice, ...]
    tokens: tuple[TokenRow, ...]
    scopes: tuple[ScopeChoice, ...]
    robots: tuple[str, ...]
    errors: tuple[str, ...]
    secret: str
    typed: str


def account_page(
    shell: Shell,
    principal: permissions.Principal,
    sessions: Sequence[tuple[str, float, float, bool]],
    *,
    by_password: bool = True,
    errors: Sequence[str] = (),
    done: str = "",
    token: str = "",
) -> AccountPage:
    """`sessions`: (browser, since, last seen, whether it is this one)."""
    return AccountPage(
        shell=shell,
        name=principal.name,
        roles=listed(principal.roles),
        invited=principal.invited,
        by_password=by_password and not principal.invited,
        keeps_people=principal.may("people"),
        abilities=tuple(
            Ability(meaning=permissions.MEANING[permission], allowed=principal.may(permission), roles=listed(roles))
            for permission, roles in permissions.GRANTS.items()
        ),
        sessions=tuple(OpenSession(*one) for one in sessions),
        errors=tuple(errors),
        done=done,
        token=token,
    )


def role_choices(held: Collection[str] = ()) -> tuple[RoleChoice, ...]:
    return tuple(RoleChoice(name=role, held=role in held) for role in permissions.ROLES)


def scope_choices() -> tuple[ScopeChoice, ...]:
    return tuple(
        ScopeChoice(name=name, meaning=permissions.MEANING[name])
        for name in permissions.GRANTS
        if name in permissions.SCOPES
    )
