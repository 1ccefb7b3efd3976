"""`regen account` and `regen token` post the acts of the API, in process where nobody owns the folder."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.cli.data_folder import opened
from app.cli.main import app
from app.cli.person import host_user
from harness.contracts.errors import HarnessError

PASSWORD = "seven green bottles"


class Terminal:
    """The command line on one data folder, as whoever sits there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def raw(self, *words: str, typed: str = "") -> Result:
        arguments = [*words, "--data", str(self.folder), "--json"]
        return CliRunner().invoke(app, arguments, env={"LOGNAME": "ada"}, input=typed)

    def said(self, *words: str, typed: str = "") -> dict[str, Any]:
        result = self.raw(*words, typed=typed)
        assert result.exit_code == 0, (result.output, result.exception)
        answer: dict[str, Any] = json.loads(result.stdout)
        return answer

    def refused(self, *words: str, typed: str = "") -> str:
        result = self.raw(*words, typed=typed)
        assert isinstance(result.exception, HarnessError), result.output
        return str(result.exception)

    def trail(self) -> list[tuple[str, str, str, str]]:
        with opened(self.folder) as accounts:
            return [(one.kind, one.actor, one.subject, one.source) for one in accounts.store.audit_log(limit=20)]


@pytest.fixture
def terminal(tmp_path: Path) -> Terminal:
    return Terminal(tmp_path / "var")


def test_people_and_tokens_are_kept_from_the_terminal_and_the_trail_says_who_and_from_where(terminal: Terminal) -> None:
    added = ("--password-stdin", "--role")
    assert "first account must be an admin" in terminal.refused(
        "account", "add", "eve", *added, "viewer", typed=PASSWORD
    )
    root = terminal.said("account", "add", "root", *added, "admin", "--role", "operator", typed=PASSWORD)
    assert (root["name"], root["roles"]) == ("root", ["operator", "admin"])
    terminal.said("account", "add", "eve", *added, "viewer", typed=PASSWORD)
    assert terminal.said("account", "disable", "eve")["disabled"]
    assert not terminal.said("account", "disable", "eve", "--undo")["disabled"]
    assert "last admin" in terminal.refused("account", "disable", "root")
    assert terminal.said("account", "password", "eve", "--password-stdin", typed="eight green bottles")["name"] == "eve"
    assert "no account nobody" in terminal.refused("account", "disable", "nobody")
    made = terminal.said("token", "create", "dock", "--scope", "read")
    assert made["token"].startswith("regen_")
    assert terminal.said("token", "revoke", made["token_id"])["state"] == "revoked"
    assert ("account.added", f"host:{host_user()}", "root", "terminal") in terminal.trail()
    assert ("token.revoked", f"host:{host_user()}", made["token_id"], "terminal") in terminal.trail()
    (row,) = [one for one in terminal.said("account", "list")["accounts"] if one["name"] == "eve"]
    assert not row["disabled"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("account", "add", "Eve!", "--role", "admin"), "name"),
        (("account", "add", "eve", "--role", "king"), "roles"),
        (("token", "create", "dock", "--scope", "decide"), "read"),
    ],
)
def test_what_is_not_well_said_is_told_and_never_repeats_the_password(
    terminal: Terminal, words: tuple[str, ...], told: str
) -> None:
    by_stdin = ("--password-stdin",) if words[0] == "account" else ()
    refused = terminal.refused(*words, *by_stdin, typed="short-secret!")
    assert told in refused and "short-secret" not in refused
