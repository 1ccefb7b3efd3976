"""A wrong folder is said to be one: nothing is created in it, and an empty log is never called intact."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from harness.contracts.errors import StoreUnavailable
from tests.saying import said

COMMANDS = ("audit verify", "audit anchor", "audit replay --all", "mission list", "mission show msn_1", "rsi list")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_that_reads_refuses_a_folder_without_a_log_and_leaves_it_alone(command: str, tmp_path: Path) -> None:
    missing = tmp_path / "typo"
    answer = CliRunner().invoke(app, [*command.split(), "--data", str(missing)])
    assert isinstance(answer.exception, StoreUnavailable)
    assert "There is no data folder with a log here" in said(answer) and "--data" in said(answer)
    assert not missing.exists()


def test_the_doctor_names_it_as_the_problem(tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, ["doctor", "--data", str(tmp_path)])
    assert answer.exit_code == 1
    assert "There is no data folder with a log here" in answer.output
    assert list(tmp_path.iterdir()) == []
