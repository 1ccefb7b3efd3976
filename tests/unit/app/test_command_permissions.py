"""Every command class is a person's with a permission or the harness's own; what nobody listed is refused."""

from collections.abc import Iterator
from types import UnionType
from typing import Any, get_args

import pytest

from app.auth.accounts import Accounts
from app.auth.command_permissions import (
    ASKED,
    CARRIED,
    HARNESS_COMMANDS,
    PERMISSIONS,
    NoPermissionDeclared,
    asked_permission,
    required_permission,
)
from app.auth.commit_authority import authority
from app.auth.permissions import NotPermitted, Principal
from app.settings import ConsoleSettings
from harness.contracts import commands, person_commands
from harness.contracts.actors import Actor, Command
from harness.contracts.decisions import Refused
from rsi_reviews import commands as review_commands
from rsi_reviews import refused_proposals, suite_growth
from tests.builders.accounts import quick_accounts
from tests.saying import raises_saying

ADMIN = Principal(name="setup", roles=("admin",), source="test")
PASSWORD = "seven green bottles"


class OpenEveryDoor(Command, tag=True):
    """A command that somebody added and that no table names."""

    actor: Actor


def classes(*unions: Any) -> set[type[Command]]:
    """Every class of these unions."""
    return {kind for union in unions for kind in (get_args(union) if isinstance(union, UnionType) else (union,))}


EVERY = classes(
    commands.AnyCommand,
    person_commands.PersonCommand,
    review_commands.CandidateCommand,
    review_commands.PointerCommand,
    suite_growth.AddCase,
    refused_proposals.KeepRefusal,
)


@pytest.fixture
def accounts() -> Iterator[Accounts]:
    kept = quick_accounts(ConsoleSettings(port=8000, password_memory_kib=19456))
    kept.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    kept.add("ada", roles=["operator"], password=PASSWORD, by=ADMIN)
    yield kept
    kept.store.close()


def stop(name: str) -> commands.StopMission:
    return commands.StopMission(actor=Actor(name=name, role="operator"), reason="enough")


def test_every_command_class_is_listed_once() -> None:
    assert set(PERMISSIONS) | HARNESS_COMMANDS == EVERY
    assert not set(PERMISSIONS) & HARNESS_COMMANDS
    assert not set(ASKED) & set(CARRIED)


def test_a_command_that_nobody_listed_is_refused_when_asked_and_inside_the_commit(accounts: Accounts) -> None:
    with raises_saying(NoPermissionDeclared, match="OpenEveryDoor"):
        required_permission(OpenEveryDoor)
    refused = authority(accounts)(OpenEveryDoor(actor=Actor(name="ada", role="operator")))
    assert isinstance(refused, Refused) and refused.rule == "no_permission_declared"


def test_nobody_asks_for_the_harness_own_commands_or_for_what_it_builds_from_an_answer() -> None:
    for kind in HARNESS_COMMANDS:
        with raises_saying(NotPermitted, match=kind.__name__):
            asked_permission(kind)
    for kind in CARRIED:
        with raises_saying(NotPermitted, match=kind.__name__):
            asked_permission(kind)
    assert all(asked_permission(kind) == permission for kind, permission in ASKED.items())


def test_inside_the_commit_every_persons_command_needs_the_role_that_the_table_names(accounts: Accounts) -> None:
    still = authority(accounts)
    assert still(stop("ada")) is None
    assert still(stop("somebody without an account")) is None
    accounts.change("ada", disabled=True, by=ADMIN)
    refused = still(stop("ada"))
    assert isinstance(refused, Refused) and refused.rule == "role_revoked"
    clock = commands.StopMission(actor=Actor(name="ada", role="harness", channel="timeout"), reason="late")
    assert still(clock) is None, "what the clock or a policy does is nobody's role"
    assert still(commands.ActivateMission()) is None
