"""A mission verified in part only, on every surface that tells people and machines how it ended: never "Goal met"."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import Result
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from app.cli.main import app
from app.i18n.reasons.rendering import sentence
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.ids import RobotId
from harness.projections.mission import Mission
from harness.runtime import Start
from tests.builders.consoles import Stand, console_stand
from tests.builders.declared import DESCRIBED, ORDER, two_pictures

ADA = Actor(name="ada", role="operator")
WHAT = "The description is of the accepted picture"


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand(rules=2) as made:
        yield made


@pytest.fixture(scope="module")
def ran(stand: Stand) -> Mission:
    template = two_pictures(goals=(ORDER, DESCRIBED))
    start = Start(actor=ADA, robot_id=RobotId("vbot-1"), template=template.name, seed=3)
    assert isinstance(stand.harness.runtime.start(start, template=template), Accepted)
    return stand.harness.supervisor.run(stand.harness.runtime.missions()[0].mission_id)


@pytest.fixture
def operator(stand: Stand) -> TestClient:
    return stand.operator()


@pytest.mark.parametrize("page", ["", "/report", "/contract", "/stages", "/head", "/evidence?node=describe", "/log"])
def test_no_page_calls_it_met(operator: TestClient, ran: Mission, page: str) -> None:
    answer = operator.get(f"/missions/{ran.mission_id}{page}")
    assert answer.status_code == 200
    assert "Goal met" not in answer.text and "目标已达成" not in answer.text


@pytest.mark.parametrize("page", ["", "/report"])
def test_the_page_and_the_report_name_what_is_only_declared(operator: TestClient, ran: Mission, page: str) -> None:
    text = operator.get(f"/missions/{ran.mission_id}{page}").text
    assert "Partly verified" in text and WHAT in text
    assert page == "" or ("Unverified parts" in text and "declared by its provider alone" in text)
    assert 'data-verdict="declared"' in text


def test_the_list_counts_it_apart(operator: TestClient, ran: Mission) -> None:
    for group, shown in (("partly_verified", True), ("succeeded", False), ("ended", False)):
        assert (ran.mission_id in operator.get(f"/missions?status={group}").text) is shown
    row = operator.get("/api/v1/missions", params={"status": "partly_verified"}).json()[0]
    assert (row["mission_id"], row["status"], row["goal_verdict"]) == (ran.mission_id, *["partly_verified"] * 2)


def test_the_api_and_the_report_name_the_conditions(operator: TestClient, ran: Mission) -> None:
    for path in (f"/api/v1/missions/{ran.mission_id}", f"/missions/{ran.mission_id}/report.json"):
        outcome = operator.get(path).json()
        assert (outcome["status"], outcome["goal_verdict"]) == ("partly_verified", "partly_verified")
        named = {one["condition_id"]: one["node_id"] for one in outcome["declared_conditions"]}
        assert named == {"describe.of_picture": "describe", "goal.described": None}
        parts = [(one["why"], one["node_id"], one["condition_id"]) for one in outcome["unverified_parts"]]
        assert parts == [
            ("declared", "describe", "describe.of_picture"),
            ("rests_on_declared", None, "goal.described"),
        ]
        verdicts = {one["condition_id"]: (one["verdict"], one["independence"]) for one in outcome["goal_conditions"]}
        assert verdicts == {"goal.in_order": ("satisfied", 1), "goal.described": ("declared", 0)}
        assert "Goal met" not in json.dumps(outcome)
        stages = {one["node_id"]: (one["status"], one["accepted_at_k"]) for one in outcome["stages"]}
        assert stages["describe"] == ("declared", None)


@pytest.mark.ask("flotilla#562")
@pytest.mark.ledger("R108", entry="command line", symbol="harness.gate.completion:declarable")
@pytest.mark.ledger("R108", entry="command line", symbol="harness.verification.independence:derived_independence")
def test_a_providers_word_is_never_satisfied_from_the_command_line(tmp_path: Path) -> None:
    run = regen(tmp_path, "mission", "run", "camera-report", "--speed", "0", "--fidelity", "kinematic")
    assert run.exit_code == 4, run.output
    outcome = json.loads(run.stdout)
    assert [one["condition_id"] for one in outcome["declared_conditions"]] == ["describe.of_picture", "goal.in_order"]
    stages = {one["node_id"]: (one["status"], one["verdict"]) for one in outcome["stages"]}
    assert stages["describe"] == ("declared", "ambiguous") and stages["persist"] == ("committed", "satisfied")
    told = [run, *(regen(tmp_path, "mission", *words) for words in (("show", outcome["mission_id"]), ("list",)))]
    assert not any("Goal met" in one.output for one in told)
    dossier = str(tmp_path / "mission.zip")
    assert regen(tmp_path, "mission", "dossier", outcome["mission_id"], "--out", dossier).exit_code == 0
    verified = CliRunner().invoke(app, ["verify", dossier])
    assert f"Unverified: {WHAT} (declared by its provider alone)." in verified.stdout
    shown = CliRunner().invoke(app, ["mission", "show", outcome["mission_id"], "--data", str(tmp_path / "data")])
    assert f"unverified: {WHAT} (declared by its provider alone)" in shown.stdout
    replayed = json.loads(regen(tmp_path, "audit", "replay", "--all").stdout)["missions"]
    assert [one["differences"] for one in replayed] == [[]]


def regen(data: Path, *words: str) -> Result:
    return CliRunner().invoke(app, [*words, "--data", str(data / "data"), "--json"])


def test_it_raises_a_low_alert_of_its_own(operator: TestClient, stand: Stand, ran: Mission) -> None:
    stand.app.state.alert_watch.step()
    alerts = operator.get("/api/v1/alerts").json()
    (own,) = [one for one in alerts if one["kind"] == "partly_verified"]
    assert own["priority"] == "low"
    assert not [one for one in alerts if one["kind"] == "mission_failed"]


def test_the_report_as_pdf_is_made(operator: TestClient, ran: Mission) -> None:
    assert operator.get(f"/missions/{ran.mission_id}/report.pdf").content.startswith(b"%PDF-")


def test_its_report_is_no_completion(ran: Mission) -> None:
    assert sentence(ran.report).startswith("Partly verified: ") and WHAT in sentence(ran.report)
