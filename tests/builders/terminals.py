"""Builds people with accounts of a data folder and a terminal each, signed in or not."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from typer.testing import CliRunner, Result

from app.auth.permissions import Principal
from app.cli.data_folder import opened
from app.cli.main import app
from app.i18n.reasons.rendering import explained
from harness.contracts.errors import HarnessError
from tests.builders.accounts import LITTLE_WORK

SETTING_UP = Principal(name="setup", roles=("admin",), source="test")
PASSWORD = "seven green bottles"


class Terminals:
    """Terminals on one data folder; each person has their own file of logins."""

    def __init__(self, data: Path) -> None:
        self.data = data

    def add(self, name: str, *roles: str) -> None:
        """Somebody with an account, signed in at their own terminal."""
        with opened(self.data) as accounts:
            accounts._hasher = LITTLE_WORK
            accounts.add(name, roles=roles, password=PASSWORD, by=SETTING_UP)
        self.login(name)

    def login(self, name: str) -> None:
        """Sign in at this person's terminal."""
        done = self.run(name, "login", name, "--password-stdin", typed=PASSWORD)
        assert done.exit_code == 0, (done.output, done.exception)

    def env(self, name: str) -> dict[str, str]:
        """The environment of one person's terminal; what it says of their name counts for nothing."""
        return {"REGEN_LOGINS": str(self.data.parent / "logins" / name), "LOGNAME": name, "USER": name}

    def run(self, name: str, *words: str, typed: str = "", env: Mapping[str, str] | None = None) -> Result:
        """What a command does at this person's terminal."""
        arguments = [*words, "--data", str(self.data), "--json"]
        return CliRunner().invoke(app, arguments, env=self.env(name) | dict(env or {}), input=typed)

    def said(self, name: str, *words: str, code: int = 0) -> dict[str, Any]:
        """The JSON that it prints."""
        result = self.run(name, *words)
        assert result.exit_code == code, (result.output, result.exception)
        answer: dict[str, Any] = json.loads(result.stdout.splitlines()[-1])
        return answer

    def refused(self, name: str, *words: str) -> str:
        """Why it is refused."""
        result = self.run(name, *words)
        assert isinstance(result.exception, HarnessError), (result.output, result.exception)
        return explained(result.exception)
