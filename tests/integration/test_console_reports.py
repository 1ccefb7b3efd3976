"""Reports of missions: PDF, signed dossier, and the dispute of an acceptance."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from fastapi.testclient import TestClient

from app.background.signals import SignalBroker
from app.i18n.reasons.rendering import sentence
from app.main import create_app
from app.routes.report import page_of
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from app.views.report import ReportPage
from app.web.report_pdf import PictureUnreadable, report_pdf
from harness.contracts.actors import Actor
from harness.dossiers import verify_dossier
from harness.projections.mission import Mission
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import BASE, OWN, Stand, console_stand
from tests.saying import raises_saying

ADA = Actor(name="ada", role="operator")
FONTS = ConsoleSettings().static / "vendor"


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture(scope="module")
def ran(stand: Stand) -> Mission:
    """One mission that ended well."""
    return stand.run()


@pytest.fixture
def page(stand: Stand, ran: Mission) -> ReportPage:
    return page_of(stand.app.state.console, ADA, ran.mission_id)


@pytest.fixture
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def test_the_report_as_pdf_has_every_verified_picture_and_its_own_fonts(page: ReportPage, operator: TestClient) -> None:
    answer = operator.get(f"/missions/{page.mission_id}/report.pdf")
    assert answer.headers["content-type"] == "application/pdf"
    assert f"{page.mission_id}.pdf" in answer.headers["content-disposition"]
    assert answer.content.startswith(b"%PDF-")
    assert len(page.pictures) >= 8
    assert answer.content.count(b"/Subtype /Image") == len({one.blob for one in page.pictures})
    assert answer.content.count(b"/FontFile2") >= 2


def test_a_picture_that_does_not_verify_is_not_printed(page: ReportPage, stand: Stand) -> None:
    whole = {one.blob: stand.harness.runtime.blob(one.blob) for one in page.pictures}  # type: ignore[arg-type]
    rotten = page.pictures[0].blob
    left = {blob: body for blob, body in whole.items() if blob != rotten}
    pdf = report_pdf(page, left, fonts=FONTS, made_s=0.0)
    assert pdf.body.count(b"/Subtype /Image") == len(whole) - 1
    with raises_saying(PictureUnreadable, match=rotten[:12]):
        report_pdf(page, {**left, rotten: b"no picture"}, fonts=FONTS, made_s=0.0)


def test_signs_that_no_font_has_are_counted_and_european_and_chinese_ones_are_drawn(page: ReportPage) -> None:
    def lacking(goal: str) -> int:
        told = replace(
            page, head=replace(page.head, mission=msgspec.structs.replace(page.head.mission, goal=goal)), pictures=()
        )
        return report_pdf(told, {}, fonts=FONTS, made_s=0.0).lacking

    assert lacking("Prüfe “Łódź”, Ωmega, Склад – 5 €") == 0
    assert lacking("检查仓库，阻塞") == 0
    assert lacking("\U0001f916\U0001f916") == 2


def test_the_report_as_pdf_is_in_the_language_of_its_reader(page: ReportPage, stand: Stand) -> None:
    english = report_pdf(page, {}, fonts=FONTS, made_s=0.0)
    assert b"/Lang (en)" in english.body and b"DroidSansFallback" not in english.body
    operator = stand.operator()
    operator.headers["accept-language"] = "zh-CN"
    chinese = operator.get(f"/missions/{page.mission_id}/report.pdf").content
    assert b"/Lang (zh-Hans)" in chinese and b"DroidSansFallback" in chinese


def test_the_same_report_gives_the_same_bytes(page: ReportPage) -> None:
    bare = replace(page, pictures=())
    assert report_pdf(bare, {}, fonts=FONTS, made_s=7.0) == report_pdf(bare, {}, fonts=FONTS, made_s=7.0)


def test_a_report_opens_with_what_was_found_and_its_measurements_are_drawn(
    page: ReportPage, operator: TestClient, ran: Mission
) -> None:
    text = operator.get(f"/missions/{page.mission_id}/report").text
    assert "obstructed" in page.findings[0].text
    assert text.index(page.findings[0].text) < text.index("Facts about this report")
    assert re.search(r"found\s+by opencv-analysis at \d\d:\d\d:\d\d UTC, mission time, declared", text)
    evidence = operator.get("/evidence?kind=trajectory").text
    blob = re.findall(r"/evidence/([0-9a-f]{64})/about", evidence)[0]
    drawn = operator.get(f"/evidence/{blob}/about").text
    assert 'class="trail" points="' in drawn and "speed by odometry" in drawn and 'class="hits"' in drawn
    pictures = operator.get("/evidence?kind=image").text
    assert re.search(r'<img\s+class="mini"\s+src="/evidence/[0-9a-f]{64}"', pictures)


def test_the_dossier_that_is_downloaded_verifies_offline(stand: Stand, ran: Mission, tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    scenes = Scenes(stand.harness.runtime)
    app = create_app(
        stand.harness.runtime,
        ConsoleSettings(port=8000, password_memory_kib=19456),
        SignalBroker(),
        scenes,
        accounts=quick_accounts(ConsoleSettings(port=8000, password_memory_kib=19456)),
        answer=stand.harness.supervisor.answer,
        folder=data,
    )
    client = TestClient(app, base_url=BASE, follow_redirects=False, headers=OWN)
    client.get(app.state.sessions.invite())
    answer = client.get(f"/missions/{ran.mission_id}/dossier")
    assert answer.status_code == 200
    assert f"{ran.mission_id}.dossier.zip" in answer.headers["content-disposition"]
    file = tmp_path / "mission.zip"
    file.write_bytes(answer.content)
    verdict = verify_dossier(file)
    assert (verdict.mission_id, verdict.status, verdict.differences) == (ran.mission_id, "succeeded", ())
    assert client.get("/missions/msn_none/dossier").status_code == 404
    app.state.console.lists.close()
    scenes.close()


def test_a_console_without_a_key_says_so_and_a_stranger_gets_no_dossier(stand: Stand, ran: Mission) -> None:
    assert "no key to sign with" in sentence(stand.operator().get(f"/missions/{ran.mission_id}/dossier").text)
    assert stand.stranger().get(f"/missions/{ran.mission_id}/dossier").status_code in (303, 401, 403)


@pytest.mark.ledger("R234", symbol="harness.gate.revisions:dispute")
def test_a_dispute_is_one_form_and_stands_everywhere() -> None:
    with console_stand() as stand:
        mission, operator = stand.run(), stand.operator()
        fact, other = mission.facts[-1], mission.facts[0]
        report, href = f"/missions/{mission.mission_id}/report", f"facts/{fact.packet_id}/{fact.condition_id}"
        address = f"/missions/{mission.mission_id}/{href}/dispute"
        assert f'action="{address}"' in operator.get(report).text
        assert operator.post(address, data={"reason": " "}).status_code == 422
        wrong = f"/missions/{mission.mission_id}/facts/pkt_none/{fact.condition_id}/dispute"
        assert operator.post(wrong, data={"reason": "x"}).status_code in (404, 409)
        assert stand.harness.runtime.mission(mission.mission_id).false_completions == 0
        answer = operator.post(address, data={"reason": "nobody heard it", "from": "report"})
        assert answer.headers["location"] == f"{report}#facts-title"
        disputed = stand.harness.runtime.mission(mission.mission_id)
        assert disputed.false_completions == 1
        assert len(disputed.facts) == len(mission.facts), "nothing is deleted"
        assert "nobody heard it" in operator.get(report).text
        assert "nobody heard it" in sentence(operator.get(f"/missions/{mission.mission_id}/{href}").text)
        assert "1 disputed" in sentence(operator.get(f"/missions/{mission.mission_id}/head").text)
        assert f'action="{address}"' not in operator.get(report).text
        assert sentence(operator.get(report).text).count("do not rely on it") == 1, "it succeeded, and is disputed"
        (row,) = re.findall(rf'/missions/{mission.mission_id}">.*?</tr>', operator.get("/missions").text, re.DOTALL)
        assert "succeeded" in row and "disputed" in row
        untouched = f"/missions/{mission.mission_id}/facts/{other.packet_id}/{other.condition_id}"
        assert "Disputed" not in operator.get(untouched).text


def test_what_the_analysis_found_is_drawn_over_its_picture_on_the_report_in_the_pdf_and_beside_the_evidence(
    page: ReportPage, operator: TestClient, stand: Stand
) -> None:
    marked = {one.blob: one.marked for one in page.pictures if one.marked}
    assert marked and all(found.boxes and found.source == "opencv-analysis" for found in marked.values())
    report = operator.get(f"/missions/{page.mission_id}/report").text
    assert report.count('<svg class="boxes" viewBox="0 0 1280 720"') == sum(bool(one.marked) for one in page.pictures)
    blob, found = next(iter(marked.items()))
    box = found.boxes[0]
    drawn = f'<rect x="{box.x}" y="{box.y}" width="{box.width}" height="{box.height}"'
    assert drawn in report and drawn in operator.get(f"/evidence/{blob}/about").text
    bodies = {one.blob: stand.harness.runtime.blob(one.blob) for one in page.pictures}  # type: ignore[arg-type]
    bare = replace(page, pictures=tuple(replace(one, marked=None) for one in page.pictures))
    with_boxes, without = (report_pdf(one, bodies, fonts=FONTS, made_s=0.0) for one in (page, bare))
    assert len(with_boxes.body) > len(without.body)


def test_every_time_of_day_in_a_report_and_beside_its_evidence_names_its_clock(
    page: ReportPage, operator: TestClient
) -> None:
    report = operator.get(f"/missions/{page.mission_id}/report").text
    packet = operator.get(f"/missions/{page.mission_id}?node=analyze").text
    for text in (report, packet):
        shown = re.sub(r"<[^>]*>", " ", re.sub(r"<(style|script).*?</\1>", "", text, flags=re.DOTALL))
        times = re.findall(r"(?<![\d:.])\d{2}:\d{2}:\d{2}(?![\d:.])(\s+\S+)?", shown)
        assert len(times) > 5 and {one.strip() for one in times} <= {"UTC", "UTC,", "UTC."}, times
