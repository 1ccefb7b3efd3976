"""`regen account identity`, and what `regen doctor` says of an identity provider that runs, is wrong or is away."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from app.cli.main import app
from app.i18n.reasons.rendering import explained
from harness.bootstrap import open_harness
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid, HarnessError, UnknownName
from harness.settings import HarnessSettings
from tests.fakes.issuer import CLIENT_ID, CLIENT_SECRET, Issuer, issuing


@pytest.fixture
def issuer() -> Iterator[Issuer]:
    with issuing() as running:
        yield running


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A folder with an empty log."""
    with open_harness(HarnessSettings(data_folder=tmp_path / "data", speed=0, fidelity="kinematic")):
        return tmp_path / "data"


def regen(*words: object, typed: str = "", **known: str) -> Result:
    """One call of the command line, in this process."""
    return CliRunner().invoke(app, [str(word) for word in words], input=typed, env=known)


def answer(done: Result) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def refused(done: Result, kind: type[HarnessError]) -> str:
    """What it says to a person."""
    assert isinstance(done.exception, kind), done.output
    return explained(done.exception)


def environment(issuer: str, **more: str) -> dict[str, str]:
    known = {"ISSUER": issuer, "CLIENT_ID": CLIENT_ID, "ROLES": json.dumps({"robot-operators": ["operator"]}), **more}
    return {f"REGEN_OIDC_{name}": value for name, value in known.items()}


def test_doctor_asks_the_identity_provider_and_names_what_is_wrong(data: Path, issuer: Issuer, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text(CLIENT_SECRET)
    secret.chmod(0o600)
    good = regen("doctor", "--data", data, "--json", **environment(issuer.url, CLIENT_SECRET_FILE=str(secret)))
    assert good.exit_code == 0, good.stdout
    found = answer(good)
    assert found["identity_provider"] == {
        "issuer": issuer.url,
        "redirect": "http://127.0.0.1:8000/account/oidc/back",
        "groups": {"robot-operators": ["operator"]},
        "keys": 1,
    }
    secret.chmod(0o644)
    issuer.document = {"token_endpoint": "https://elsewhere.example/token"}
    wrong = regen(
        "doctor", "--data", data, "--json",
        **environment(issuer.url, CLIENT_SECRET_FILE=str(secret), ROLES='{"a": ["emperor"]}'),
    )  # fmt: skip
    assert wrong.exit_code == 1
    told = " ".join(answer(wrong)["problems"])
    for one in ("'emperor'", "chmod 600", "https://elsewhere.example/token", "REGEN_OIDC_HOSTS"):
        assert one in told
    assert CLIENT_SECRET not in wrong.output
    away = regen("doctor", "--data", data, "--json", **environment("http://127.0.0.1:9", ROLES="{}"))
    told = " ".join(answer(away)["problems"])
    assert "does not answer" in told
    assert "REGEN_OIDC_ROLES is empty" in told
    assert "identity_provider" not in answer(regen("doctor", "--data", data, "--json"))


def test_a_person_with_an_account_is_linked_from_the_machine_itself(data: Path, issuer: Issuer) -> None:
    known = environment(issuer.url)
    added = regen(
        "account",
        "add",
        "root",
        "--role",
        "admin",
        "--password-stdin",
        "--data",
        data,
        typed="a long sentence\n",
    )
    assert added.exit_code == 0, added.output
    linked = regen("account", "identity", "root", "--subject", "7", "--data", data, "--json", **known)
    assert answer(linked) == {"name": "root", "issuer": issuer.url, "subject": "7"}
    again = regen("account", "identity", "root", "--subject", "7", "--data", data, **known)
    assert "known already" in refused(again, ConcurrencyConflict)
    assert "nobody" in refused(regen("account", "identity", "nobody", "--subject", "8", "--data", data), UnknownName)
    without = regen("account", "identity", "root", "--subject", "8", "--data", data)
    assert "an issuer and a subject" in refused(without, ContractInvalid)
    removed = regen("account", "identity", "root", "--remove", "--data", data, **known)
    assert removed.stdout.strip() == "root signs in with a password alone."


def test_a_console_does_not_start_with_an_identity_provider_that_cannot_be_trusted(tmp_path: Path) -> None:
    began = regen("up", "--data", tmp_path, "--port", "0", **environment("http://id.example"))
    assert "REGEN_OIDC_ISSUER" in refused(began, ContractInvalid)
    assert {one.name.split(".")[0] for one in tmp_path.iterdir()} <= {"accounts"}, "nothing was opened or started"
