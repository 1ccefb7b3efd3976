"""Links people of the identity provider, by (issuer, subject) and never by name, to accounts and roles."""

import re
from collections.abc import Callable, Collection, Mapping

from msgspec.structs import replace

from app.auth.accounts import Accounts, checked_roles
from app.auth.permissions import ROLES, Principal
from harness.adapters.stores.accounts_rows import Account, ExternalIdentity
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.identity import AccountDisabled, Claims, RoleMissing
from harness.contracts.ids import sha256
from harness.contracts.reasons import because

NAMED, UNNAMED = 33, re.compile(r"[^a-z0-9._-]+")


class Identities:
    """People who sign in at the identity provider. `roles`: which roles a group there has here; none by default."""

    def __init__(self, accounts: Accounts, *, roles: Mapping[str, Collection[str]], clock: Callable[[], float]) -> None:
        """Raises ContractInvalid for a role that does not exist."""
        for group, named in roles.items():
            if not named or set(named) - set(ROLES):
                raise ContractInvalid(
                    because("group_role_invalid", group=group[:60], roles=tuple(ROLES)), where="REGEN_OIDC_ROLES"
                )
        self._accounts, self._mapping, self._clock = accounts, roles, clock

    def by_groups(self, issuer: str, subject: str) -> bool:
        """Whether groups decide what they may do here: not where no group has a role, nor for a linked account."""
        known = self._accounts.store.identity(issuer, subject)
        return bool(self._mapping) and (known is None or known.by_groups)

    def account_of(self, claims: Claims, *, source: str) -> Account:
        """The person's account; made for them if their groups have a role here. Raises RoleMissing, AccountDisabled."""
        known = self._accounts.store.identity(claims.issuer, claims.subject)
        if known is None:
            return self._create(claims, source=source)
        account = self._accounts.known(known.name)
        if account.disabled:
            raise AccountDisabled(because("account_disabled"), where=account.name)
        return self._update(account, claims, source=source) if known.by_groups else account

    def link(self, name: str, *, issuer: str, subject: str, by: Principal) -> ExternalIdentity:
        """An account that is there, with its own roles, for who this is at the issuer. Raises UnknownName."""
        by.acting("people")
        account = self._accounts.known(name)
        if not issuer or not 0 < len(subject) <= 255:
            raise ContractInvalid(
                because("identity_incomplete"), where=because("at_identity", issuer=issuer[:60], subject=subject[:60])
            )
        made = ExternalIdentity(
            issuer=issuer, subject=subject, name=account.name, by_groups=False, linked_at_s=self._clock()
        )
        self._accounts.store.link(made)
        self._accounts.note(by, "identity.linked", subject=name, detail=f"{subject} at {issuer}")
        return made

    def unlink(self, name: str, *, by: Principal) -> int:
        """Unlink this account from the identity provider and end its sessions; returns the number of links."""
        by.acting("people")
        linked = self._accounts.store.identities(self._accounts.known(name).name)
        if not linked:
            raise UnknownName(because("no_identity_linked", name=name))
        if any(one.by_groups for one in linked):
            raise ContractInvalid(because("only_identity", name=name))
        for one in linked:
            self._accounts.store.unlink(one.issuer, one.subject)
        self._accounts.store.close_sessions(name=name)
        self._accounts.note(by, "identity.unlinked", subject=name)
        return len(linked)

    def _mapped(self, claims: Claims) -> tuple[str, ...]:
        """Raises RoleMissing where no group of theirs has a role here."""
        found = {role for group in claims.groups for role in self._mapping.get(group, ())}
        if not found:
            raise RoleMissing(
                because("role_missing"),
                where=because("at_groups_of", name=(claims.name or claims.subject)[:200], groups=len(claims.groups)),
            )
        return checked_roles(found)

    def _create(self, claims: Claims, *, source: str) -> Account:
        roles, now_s = self._mapped(claims), self._clock()
        if "admin" not in roles and not self._accounts.store.any_account():
            raise RoleMissing(because("first_person_not_admin"), where=claims.name[:200])
        account = Account(
            name=self._free_name(claims), roles=roles, secret="", disabled=False, created_at_s=now_s, changed_at_s=now_s
        )
        identity = ExternalIdentity(
            issuer=claims.issuer, subject=claims.subject, name=account.name, by_groups=True, linked_at_s=now_s
        )
        self._accounts.store.link(identity, account=account)
        text = f"{' '.join(roles)}, {claims.subject} at {claims.issuer}"
        self._accounts.note(_issuer(source), "account.added", subject=account.name, detail=text)
        return account

    def _update(self, account: Account, claims: Claims, *, source: str) -> Account:
        """Give the account the roles of the person's groups; a person without a role is signed out everywhere."""
        try:
            roles = self._mapped(claims)
        except RoleMissing:
            self._accounts.store.close_sessions(name=account.name)
            raise
        if roles == account.roles:
            return account
        changed = replace(account, roles=roles, changed_at_s=self._clock())
        self._accounts.store.change_account(changed)
        self._accounts.store.close_sessions(name=account.name)
        text = f"{' '.join(account.roles)} before, {' '.join(roles)} now"
        self._accounts.note(_issuer(source), "account.changed", subject=account.name, detail=text)
        return changed

    def _free_name(self, claims: Claims) -> str:
        """What they are called there, as far as it fits; with a stamp of who they are if somebody has that name."""
        wish = UNNAMED.sub("-", claims.name.split("@")[0].lower()).strip("-._")[:NAMED].rstrip("-._")
        stamp = sha256(f"{claims.issuer} {claims.subject}".encode())[:6]
        if wish and self._accounts.store.account(wish) is None:
            return wish
        return f"{wish or 'person'}-{stamp}"


def _issuer(source: str) -> Principal:
    """In whose name accounts of mapped groups are made and changed, and where the person sits for whom it is done."""
    return Principal(name="identity provider", roles=("admin",), source=source)
