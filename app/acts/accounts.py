"""Acts on accounts and tokens: add somebody, change them, make a token. They are not in the log: no gate decides."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, StringConstraints

from app.acts import base
from app.auth import accounts
from app.auth.permissions import GRANTS, ROLES, Permission, Role
from app.i18n.catalogues import N_
from app.views.forms import Wrong

AccountName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9._\-]{0,39}$")]
Roles = Annotated[list[Role], Field(min_length=1, max_length=len(ROLES))]
Secret = Annotated[str, StringConstraints(min_length=accounts.SHORTEST, max_length=accounts.LONGEST)]
Typed = Mapping[str, Sequence[str]]
"""Every value of every field of a form: roles and scopes are ticked several at a time."""
SENTENCES: Mapping[str, str] = {
    "name": N_("A name is 1 to 40 of a-z, 0-9, dot, dash, underscore."),
    "roles": N_("An account needs at least one role."),
    "password": accounts.PASSWORD_RULE,
    "scopes": N_("A token needs scopes that integrations may have."),
}


class AddAccountAct(base.ActModel):
    """Add somebody. The first account is an admin."""

    sentences: ClassVar[Mapping[str, str]] = SENTENCES
    name: AccountName
    roles: Roles
    password: Secret

    @classmethod
    def from_people(cls, typed: Typed) -> Self | tuple[Wrong, ...]:
        """The act of the form on the page of people."""
        return cls._read({"name": _name(typed), "roles": typed.get("roles", ()), "password": _last(typed, "password")})


class ChangeAccountAct(base.ActModel):
    """What changes about somebody; what is left out stays. Ends their sessions."""

    sentences: ClassVar[Mapping[str, str]] = SENTENCES
    roles: Roles | None = None
    disabled: bool | None = None
    password: Secret | None = None

    @classmethod
    def from_people(cls, typed: Typed) -> Self | tuple[Wrong, ...]:
        """`do` names what the button changes: roles, password, disable, enable."""
        match _last(typed, "do") or "roles":
            case "roles":
                return cls._read({"roles": typed.get("roles", ())})
            case "password":
                return cls._read({"password": _last(typed, "password")})
            case what:
                return cls(disabled=what == "disable")


class IssueTokenAct(base.ActModel):
    """Make a token. Without `robot_id` it speaks for any robot; without `days` it lasts until it is revoked."""

    sentences: ClassVar[Mapping[str, str]] = SENTENCES
    name: AccountName
    scopes: Annotated[list[Permission], Field(min_length=1, max_length=len(GRANTS))]
    robot_id: base.Text = ""
    days: Annotated[float, Field(gt=0, le=3650)] | None = None

    @classmethod
    def from_people(cls, typed: Typed) -> Self | tuple[Wrong, ...]:
        """The act of the form on the page of people."""
        given: dict[str, Any] = {"name": _name(typed), "scopes": typed.get("scopes", ())}
        return cls._read({**given, "robot_id": _last(typed, "robot_id")})


def _last(typed: Typed, field: str) -> str:
    return next(reversed(typed.get(field, ())), "")


def _name(typed: Typed) -> str:
    return _last(typed, "name").strip().lower()
