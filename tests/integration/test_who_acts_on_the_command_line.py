"""The table of docs/explanation/security.md, row by row: who may do what at a terminal, and as whom it is stored."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import Result

from app.auth.permissions import HOST_PREFIX, Principal
from app.auth.sessions import Origin
from app.cli.data_folder import opened
from app.cli.logins import _file, _sessions
from app.cli.person import host_user
from app.i18n.reasons.rendering import explained
from harness.contracts.errors import HarnessError
from rsi_reviews.release_service import ReleaseService
from tests.builders.console_with_roles import ConsoleWithRoles
from tests.builders.consoles import BASE, console_stand
from tests.builders.people import PASSWORD, SETTING_UP, everybody
from tests.builders.releases import LAUNCHER, candidate, expect, say
from tests.integration.test_release_terminal import Terminal

HOST = f"{HOST_PREFIX}{host_user()}"
TABLE = Path(__file__).resolve().parents[2] / "docs" / "explanation" / "security.md"
ROW = re.compile(r"^\| `([a-z ]+)` \| (yes|no) \| (yes|no) \| (yes|no) \|", re.MULTILINE)
EVERYTHING = ("operator", "reviewer", "releaser", "admin")
ADDRESSES = {
    "run": "/api/v1/missions",
    "stop": "/api/v1/missions/{mission_id}/stop",
    "approve": "/api/v1/handoffs/{handoff_id}/decision",
    "attest": "/api/v1/handoffs/{handoff_id}/attest",
    "free a lease": "/api/v1/leases/{resource}/free",
    "propose": "/api/v1/candidates",
    "approve a candidate": "/api/v1/candidates/{candidate}/approve",
    "authorise": "/api/v1/candidates/{candidate}/authorise",
    "release": "/api/v1/candidates/{candidate}/release",
    "roll back": "/api/v1/candidates/{candidate}/rollback",
    "change the release policy": "/api/v1/releases/policy",
    "change accounts": "/api/v1/accounts",
    "erase evidence": "/api/v1/evidence/{digest}/erase",
}


@pytest.fixture(autouse=True)
def kinematic(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REGEN_FIDELITY", "kinematic")
    monkeypatch.setenv("REGEN_SPEED", "0")


def rows() -> dict[str, tuple[bool, ...]]:
    """Act: whether somebody signed in may, a host user beside a console may, a host user alone may."""
    found = ROW.findall(TABLE.read_text(encoding="utf-8"))
    return {act: tuple(one == "yes" for one in answers) for act, *answers in found}


@pytest.fixture(scope="module")
def console() -> Iterator[ConsoleWithRoles]:
    """A running console; `signed` signed in at a terminal, `host` did not."""
    with console_stand() as stand:
        _, handoff_id = stand.handed_off()
        people = everybody(stand)
        sessions = stand.app.state.sessions
        sessions.accounts.add("ada", roles=EVERYTHING, password=PASSWORD, by=SETTING_UP)
        token = sessions.terminal_sign_in("ada", PASSWORD, Origin(source="terminal"))
        headers = {"Authorization": f"Bearer {token}"}
        people["signed"] = TestClient(stand.app, base_url=BASE, headers=headers)
        people["host"] = stand.host()
        made = candidate()
        expect(ReleaseService(stand.harness.runtime).propose(made, say(LAUNCHER)))
        yield ConsoleWithRoles(stand, people, stand.created(), handoff_id, "none", candidate=made.candidate_id)


def test_the_table_has_every_row() -> None:
    assert set(rows()) == set(ADDRESSES)


@pytest.mark.parametrize("act", list(ADDRESSES))
def test_beside_a_running_console_a_row_of_the_table_is_as_it_says(console: ConsoleWithRoles, act: str) -> None:
    signed, beside, _ = rows()[act]
    path = ADDRESSES[act]
    before = console.stand.harness.runtime.head()
    body = {name: value for name, value in console.body(path).items() if path != "/api/v1/missions" or name != "key"}
    answer = console.people["host"].post(console.address(path), json=body)
    if beside:
        assert answer.status_code not in (401, 403), answer.text
    else:
        assert answer.status_code == 403
        assert answer.json()["reason"]["code"] == "account_needed"
        assert console.stand.harness.runtime.head() == before
    assert signed
    assert console.send("signed", "POST", path) not in (401, 403, 422)


@pytest.fixture(scope="module")
def terminal(tmp_path_factory: pytest.TempPathFactory) -> Terminal:
    """A folder without a console: people with accounts, a candidate that was evaluated, `mallory` with neither."""
    made = Terminal(tmp_path_factory.mktemp("alone"))
    made.add("root", "admin")
    made.add("lea", *EVERYTHING)
    return made


def told(result: Result) -> str:
    """What a person reads."""
    failed = explained(result.exception) if isinstance(result.exception, HarnessError) else ""
    return f"{result.output} {failed}"


def not_permitted(result: Result) -> bool:
    return "Only somebody who signed in to an account" in told(result)


def test_where_no_console_runs_a_row_of_the_table_is_as_it_says(terminal: Terminal) -> None:
    ran = terminal.run("mallory", "mission", "run", "warehouse-inspection", "--fault", "interrupted:persistent")
    assert ran.exit_code == 3, (ran.output, ran.exception)
    mission = json.loads(ran.stdout.splitlines()[-1])["mission_id"]
    (waits,) = terminal.said("mallory", "handoff", "list")["handoffs"]
    name = terminal.propose("lea")["candidate"]
    terminal.evaluate()
    shown = terminal.rsi("lea", "submit", name[:12], "--reason", "please look")
    decided = (name, "--digest", shown["digest"], "--reason", "the figures say so")
    files = ("--file", str(terminal.files["file"]), "--manifest", str(terminal.files["manifest"]))
    at = waits["handoff_id"]
    acts: dict[str, tuple[str, ...]] = {
        "approve": ("handoff", "approve", at, "--digest", waits["digest"], "--reason", "seen"),
        "attest": ("handoff", "attest", at, "--condition", "at_target", "--statement", "I saw it"),
        "free a lease": ("lease", "free", "vbot-1/mobile_base", "--reason", "beside it"),
        "propose": ("rsi", "propose", *files),
        "approve a candidate": ("rsi", "approve", *decided),
        "authorise": ("rsi", "authorise", *decided),
        "release": ("rsi", "release", *decided),
        "roll back": ("rsi", "rollback", name, "--reason", "it circled"),
        "change the release policy": (
            "rsi",
            "policy",
            "--kind",
            "single_operator",
            "--cooling-off-s",
            "1",
            "--reason",
            "x",
        ),
        "erase evidence": ("blob", "erase", "0" * 64, "--reason", "asked for"),
        "change accounts": ("account", "disable", "lea", "--undo"),
        "stop": ("mission", "stop", mission, "--reason", "enough"),
    }
    for act, words in acts.items():
        result = terminal.run("mallory", *words)
        assert not_permitted(result) is not rows()[act][2], (act, result.output, result.exception)
    (after,) = [one for one in terminal.rsi("lea", "list")["candidates"] if one["candidate"] == name]
    assert after["status"] == "in_review"
    assert terminal.rsi("lea", "show", name)["approvals"] == []
    events = terminal.said("root", "mission", "events", mission)["events"]
    asked = {(one["body"].get("requested_by") or one["body"].get("actor") or {}).get("name") for one in events}
    assert HOST in asked
    assert "mallory" not in json.dumps(events)


def test_the_token_of_a_terminal_lies_in_a_file_of_its_user_alone_and_ends_with_the_session(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal.add("eve", "reviewer")
    for key, value in terminal.env("eve").items():
        monkeypatch.setenv(key, value)
    file = _file(terminal.data)
    assert file.stat().st_mode & 0o777 == 0o600
    assert file.parent.stat().st_mode & 0o777 == 0o700
    assert terminal.said("eve", "whoami")["name"] == "eve"
    file.chmod(0o644)
    assert "Others may read" in terminal.refused("eve", "whoami")
    file.chmod(0o600)
    terminal.said("root", "account", "disable", "eve")
    assert terminal.said("eve", "whoami") == {"name": HOST, "roles": []}
    assert not file.exists()
    terminal.said("root", "account", "disable", "eve", "--undo")
    terminal.login("eve")
    with opened(terminal.data) as accounts:
        assert [one.agent for one in accounts.store.sessions("eve")] == ["command line"]
    assert terminal.said("eve", "logout")["name"] == "eve"
    with opened(terminal.data) as accounts:
        assert accounts.store.sessions("eve") == []


def test_a_wrong_password_or_nobodys_name_signs_nobody_in(terminal: Terminal) -> None:
    for name in ("root", "nobody"):
        done = terminal.run("stranger", "login", name, "--password-stdin", typed="not this one at all")
        assert "do not go together" in told(done)
    assert terminal.said("stranger", "whoami")["name"] == HOST


def test_who_has_no_password_signs_in_at_a_terminal_with_a_token_of_their_account_page(terminal: Terminal) -> None:
    with opened(terminal.data) as accounts:
        accounts.add("uma", roles=("reviewer",), password=PASSWORD, by=SETTING_UP)
        token = _sessions(accounts).terminal_token(Principal(name="uma", roles=("reviewer",), session="browser"))
    for name, typed in (("lea", token), ("uma", "regen_login_x"), ("uma", "")):
        done = terminal.run("uma", "login", name, "--token-stdin", typed=f"{typed}\n")
        assert "no token for a terminal" in told(done), (name, typed)
        assert terminal.said("uma", "whoami")["name"] == HOST
    done = terminal.run("uma", "login", "uma", "--token-stdin", typed=f"{token}\n")
    assert done.exit_code == 0, (done.output, done.exception)
    assert terminal.said("uma", "whoami") == {"name": "uma", "roles": ["reviewer"]}
    terminal.said("root", "account", "disable", "uma")
    assert terminal.said("uma", "whoami")["name"] == HOST


def test_a_folder_without_accounts_says_how_to_make_the_first(tmp_path: Path) -> None:
    alone = Terminal(tmp_path)
    done = alone.run("mallory", "login", "mallory", "--password-stdin", typed=PASSWORD)
    assert "Nobody has an account" in told(done)


def test_where_nobody_signed_in_nothing_is_opened_or_made(tmp_path: Path) -> None:
    nowhere = Terminal(tmp_path)
    assert nowhere.said("mallory", "whoami") == {"name": HOST, "roles": []}
    assert not nowhere.data.exists()
