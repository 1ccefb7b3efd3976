"""The console over a finished mission: pages, regions, headers, and who is let in."""

import hashlib
import html
import re
from collections.abc import Iterator
from urllib.parse import quote

import pytest
from fastapi.testclient import TestClient

from app.i18n.reasons.rendering import sentence
from app.web.security import PAGE_POLICY
from harness.contracts.ids import MissionId
from harness.projections.mission import Mission
from tests.builders.consoles import FOREIGN, OWN, Stand, console_stand

REGIONS = (
    "head", "robot", "stages", "graph", "view", "timeline", "plots", "frames", "events", "evidence", "contexts",
    "contract", "facts", "budget", "proposers",
)  # fmt: skip
OPEN = {"/healthz", "/readyz", "/account/sign-in"}


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture(scope="module")
def mission(stand: Stand) -> Mission:
    """One warehouse inspection that succeeded."""
    ended = stand.run()
    assert ended.status == "succeeded"
    return ended


@pytest.fixture(scope="module")
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def paths(stand: Stand, mission_id: str) -> list[tuple[str, str]]:
    """(method, address) of every route of the console, with this mission in the place of every mission."""
    spec: list[tuple[str, str]] = []
    for route in stand.app.routes:
        for inner in getattr(getattr(route, "original_router", None), "routes", [route]):
            methods = getattr(inner, "methods", None) or set()
            path = getattr(inner, "path", "")
            path = (
                path.replace("{mission_id}", mission_id).replace("{handoff_id}", "hof_x").replace("{digest}", "0" * 64)
            )
            spec += [(method, path.replace("{position}", "1")) for method in methods if method in ("GET", "POST")]
    return spec


def test_every_page_answers(operator: TestClient, mission: Mission) -> None:
    one = f"/missions/{mission.mission_id}"
    lists = ("/", "/missions", "/missions/new", "/handoffs", "/evidence", "/places", "/providers", "/memory")
    for path in (*lists, one, f"{one}/report", f"{one}/log"):
        answer = operator.get(path)
        assert answer.status_code == 200, path
        assert answer.text.count("<h1") == 1, path
        assert '<main id="main"' in answer.text, path


def test_the_mission_page_shows_report_verdicts_and_rules(operator: TestClient, mission: Mission) -> None:
    text = operator.get(f"/missions/{mission.mission_id}").text
    assert sentence(mission.report) in text
    assert text.count('data-state="committed"') >= 14
    assert text.count("<h2") >= 8


@pytest.mark.ledger("R36", symbol="app.views.evidence:_decision")
def test_what_the_gate_accepted_is_never_called_the_truth(operator: TestClient, mission: Mission, stand: Stand) -> None:
    commits = [one for one in stand.app.state.console.histories.of(mission.mission_id) if one.kind == "NodeCommitted"]
    accepted = next(one.position for one in commits if one.event.node_id == "go")
    text = operator.get(f"/missions/{mission.mission_id}/evidence?node=go").text
    assert "facts accepted by the configured checks" in text
    assert "That is not proof of the truth." in text
    assert re.findall(r"/events/(\d+)", text) == [str(accepted)]
    before = operator.get(f"/missions/{mission.mission_id}/evidence?node=go&at={accepted - 1}").text
    assert "The gate has not decided yet." in before


@pytest.mark.ledger("R207", symbol="app.views.evidence:packet_view")
def test_receipts_and_declared_distances_are_labelled_as_somebodys_word(operator: TestClient, mission: Mission) -> None:
    delivery = operator.get(f"/missions/{mission.mission_id}/evidence?node=delivery").text
    assert "receipts: declared by the service, not measured" in delivery
    assert delivery.count("<td>delivery<") == 5
    go = operator.get(f"/missions/{mission.mission_id}/evidence?node=go").text
    assert go.index("Declared by the provider") < go.index("remaining")


def test_the_page_and_the_report_say_who_proposed(operator: TestClient, mission: Mission) -> None:
    for path in (f"/missions/{mission.mission_id}/proposers", f"/missions/{mission.mission_id}/report"):
        text = " ".join(operator.get(path).text.split())
        assert "graph-order-1 proposed" in text and "every role was deterministic" in text


@pytest.mark.parametrize("part", REGIONS)
def test_every_region_comes_back_alone_with_its_own_root(operator: TestClient, mission: Mission, part: str) -> None:
    answer = operator.get(f"/missions/{mission.mission_id}/{part}")
    assert answer.status_code == 200
    assert f'id="{part}"' in answer.text[:200]
    assert "<html" not in answer.text


def test_the_panorama_shows_eight_pictures_whose_checksums_verify_now(operator: TestClient, mission: Mission) -> None:
    text = operator.get(f"/missions/{mission.mission_id}/evidence?node=panorama").text
    assert text.count("<img") == 8
    assert text.count("checksum verified") == 8
    assert "does not verify" not in text


@pytest.mark.ledger("R77", symbol="app.views.contexts:_context")
def test_contexts_of_all_roles_are_shown_as_they_were(operator: TestClient, mission: Mission) -> None:
    text = operator.get(f"/missions/{mission.mission_id}/contexts?node=go").text
    for role in ("C1 planner", "C2 skill", "C3 verifier"):
        assert role in text
    assert "holds no record" not in text
    assert text.count("at k 1, ") == 3
    assert " 0 records" not in text
    assert "route-follower" in text
    assert "chosen" in text


def test_an_instant_of_the_past_shows_the_mission_as_it_was(
    operator: TestClient, mission: Mission, stand: Stand
) -> None:
    events = stand.harness.runtime.events(mission.mission_id)
    first = next(event.position for event in events if event.kind == "NodeCommitted")
    head = operator.get(f"/missions/{mission.mission_id}/head?at={first}").text
    assert f"after event {first}" in head
    assert sentence(mission.report) not in head
    assert "active" in head
    stages = operator.get(f"/missions/{mission.mission_id}/stages?at={first}").text
    assert stages.count('data-state="committed"') == 1
    assert "hx-get" not in stages


def test_one_answer_carries_every_region_of_an_instant_for_its_place(operator: TestClient, mission: Mission) -> None:
    text = operator.get(f"/missions/{mission.mission_id}/instant?t=20").text
    assert sorted(re.findall(r'<hx-partial hx-target="#(\w+)"', text)) == sorted(REGIONS)
    for part in REGIONS:
        assert f'id="{part}"' in text, part
    assert "hx-get" not in text


@pytest.mark.parametrize("query", ["t=20", "at=12"])
def test_the_instant_in_the_address_holds_for_every_region_and_link(
    operator: TestClient, mission: Mission, query: str
) -> None:
    text = operator.get(f"/missions/{mission.mission_id}?{query}").text
    assert sentence(mission.report) not in text[text.index('id="head"') : text.index('id="graph"')]
    assert f"/missions/{mission.mission_id}?{query}&amp;node=go#evidence" in text
    assert "as it was after event" in text
    assert operator.get(f"/missions/{mission.mission_id}?t=inf").status_code == 422


def test_an_accepted_fact_leads_down_to_bytes_that_are_read_now(
    operator: TestClient, mission: Mission, stand: Stand
) -> None:
    fact = next(one for one in mission.facts if one.node_id == "go" and "distance_m" in one.measured)
    listed = operator.get(f"/missions/{mission.mission_id}/facts").text
    href = f"/missions/{mission.mission_id}/facts/{fact.packet_id}/{fact.condition_id}"
    assert f'href="{href}"' in listed
    text = operator.get(href).text
    gate = next(
        one
        for one in stand.app.state.console.histories.of(mission.mission_id)
        if one.kind == "NodeCommitted" and one.event.packet_id == fact.packet_id
    )
    assert f"/events/{gate.position}" in text
    assert gate.digest in text
    assert "bound</span> 0.400 m" in text
    assert text.count(">verified<") >= 3
    assert "declared by the service, not measured" in text
    assert operator.get(href + "x").status_code == 404


def test_the_report_labels_every_word_and_stands_at_a_place_in_the_log(
    operator: TestClient, mission: Mission, stand: Stand
) -> None:
    text = html.unescape(operator.get(f"/missions/{mission.mission_id}/report").text)
    newest = stand.harness.runtime.events(mission.mission_id)[-1]
    assert newest.digest in text
    assert sentence(mission.report) in text
    for label in ("declared", "measured", "accepted", "declared by a service, not measured", "no proof of the truth"):
        assert label in " ".join(text.split())
    assert text.count("<img") == 8
    found = operator.get(f"/missions/{mission.mission_id}/report.json").json()
    assert found["log"] == {"position": newest.position, "digest": newest.digest}
    assert [one["node_id"] for one in found["timings"]] == list(mission.nodes)
    assert all(one["took_s"] > 0 for one in found["timings"] if one["node_id"] in ("go", "return"))
    assert found["goal_verdict"] == "satisfied"


def test_events_are_searched_by_word_and_family_and_paged(operator: TestClient, mission: Mission) -> None:
    base = f"/missions/{mission.mission_id}/log"
    assert operator.get(f"{base}?q=NodeCommitted").text.count("NodeCommitted</span>") == 7
    people = operator.get(f"{base}?family=person").text
    assert "MissionCreated" in people
    assert "VerdictRecorded" not in people
    assert "None of the" in sentence(operator.get(f"{base}?q=zebra").text)
    later = operator.get(f"{base}?after=20").text
    assert "e-20<" not in later
    assert "First page" in later


@pytest.mark.ledger("R191", symbol="app.views.places:PlacesPage")
def test_places_show_their_whole_record_and_what_verification_means(operator: TestClient) -> None:
    text = operator.get("/places").text
    record = text[text.index("<b>Office storage area") :].split("</tr>")[0]
    for part in ("office_storage", "11.00 m, 8.56 m", "facing 90°, map site-1", "configured", "surveyed with the map"):
        assert part in record
    assert "17.62 m" in text
    assert "18.83 m" in text
    assert "the storage, B" in text
    assert "not seen by a robot" in text


def test_providers_show_twelve_fields_claims_and_what_the_log_says(operator: TestClient, mission: Mission) -> None:
    text = operator.get("/providers").text
    card = text[text.index('id="provider-route-follower"') :].split("</section>")[0]
    assert card[: card.index("moves the body</dt>")].count("<dt>") == 13
    assert "executions judged by the verifier" in card
    assert f"/missions/{mission.mission_id}" in card
    assert "dead man" in card


@pytest.mark.parametrize(
    ("role", "expected"), [("spatial", "place/"), ("operational", "route-follower"), ("semantic", "card")]
)
def test_memory_shows_records_of_a_role_with_the_event_behind_each(
    operator: TestClient, mission: Mission, role: str, expected: str
) -> None:
    text = operator.get(f"/memory?role={role}").text
    assert expected in text
    assert f"/missions/{mission.mission_id}/events/" in text
    assert operator.get("/memory?role=odd").status_code == 404


def test_an_event_page_shows_what_is_stored_with_its_place_in_the_chain(
    operator: TestClient, mission: Mission, stand: Stand
) -> None:
    stored = stand.harness.runtime.events(mission.mission_id)[3]
    text = operator.get(f"/missions/{mission.mission_id}/events/{stored.position}").text
    assert stored.digest in text
    assert stored.previous in text


def test_search_and_filter_stand_in_the_address(operator: TestClient, mission: Mission) -> None:
    assert mission.mission_id in operator.get("/missions?q=storage&status=succeeded").text
    assert "None of the" in sentence(operator.get("/missions?q=nowhere").text)
    assert mission.mission_id not in operator.get("/missions?status=waiting").text


def test_a_blob_is_served_by_digest_with_a_fixed_type_and_its_own_sum(
    operator: TestClient, mission: Mission, stand: Stand
) -> None:
    packet = next(packet for state in mission.nodes.values() for packet in state.packets if state.node_id == "panorama")
    digest = next(one.blob for one in packet.after if one.kind == "image")
    answer = operator.get(f"/evidence/{digest}")
    assert answer.headers["content-type"] == "image/jpeg"
    assert answer.headers["content-disposition"].startswith("inline")
    assert hashlib.sha256(answer.content).hexdigest() == digest
    sealed = next(one.blob for one in packet.estimates if one.kind == "trajectory")
    assert operator.get(f"/evidence/{sealed}").headers["content-disposition"].startswith("attachment")


@pytest.mark.parametrize("digest", ["0" * 64, "x", "../../etc/passwd", "A" * 64])
def test_no_other_address_reaches_a_blob(operator: TestClient, digest: str) -> None:
    assert operator.get(f"/evidence/{digest}").status_code in (404, 422)


def test_a_stranger_gets_nowhere_but_health_static_and_sign_in(stand: Stand, mission: Mission) -> None:
    stranger, seen = stand.stranger(), 0
    for method, path in paths(stand, mission.mission_id):
        if path in OPEN or path.startswith("/static"):
            continue
        answer = stranger.request(method, path, headers=OWN)
        if path.startswith("/account/oidc"):
            assert answer.status_code == 404, "no identity provider is set up here"
            continue
        assert answer.status_code == 401, (method, path)
        asked_for = quote(path, safe="")
        assert mission.mission_id not in answer.text.replace(f"?page={asked_for}", ""), "but the way back to it"
        seen += 1
    assert seen > 30
    assert stranger.get("/healthz").status_code == 200
    assert stranger.get("/static/css/base.css").status_code == 200
    assert stranger.get("/account/sign-in?token=guess").status_code == 403


def test_a_command_from_another_site_is_refused_on_every_route(stand: Stand, mission: Mission) -> None:
    operator, seen = stand.operator(), 0
    before = stand.harness.runtime.head()
    for method, path in paths(stand, mission.mission_id):
        if method == "POST":
            assert operator.post(path, headers=FOREIGN, data={"reason": "x"}).status_code == 403, path
            seen += 1
    assert seen >= 8
    assert stand.harness.runtime.head() == before


def test_every_answer_carries_the_policy(stand: Stand, operator: TestClient, mission: Mission) -> None:
    for path in (
        "/",
        f"/missions/{mission.mission_id}",
        "/nowhere",
        "/healthz",
        "/static/js/live.js",
        "/api/v1/missions",
    ):
        headers = operator.get(path).headers
        assert headers["content-security-policy"] == PAGE_POLICY, path
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["x-frame-options"] == "DENY"
        assert headers["referrer-policy"] == "same-origin"
    assert stand.stranger().get("/").headers["content-security-policy"] == PAGE_POLICY
    assert "unsafe" not in PAGE_POLICY


def test_another_host_name_reaches_nothing(stand: Stand) -> None:
    assert stand.operator().get("/", headers={"Host": "rebound.example"}).status_code == 421


def test_the_session_cookie_is_out_of_reach_of_scripts_and_other_sites(stand: Stand) -> None:
    answer = stand.stranger().get(stand.app.state.sessions.invite())
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie


def test_a_sign_in_link_works_once(stand: Stand) -> None:
    link = stand.app.state.sessions.invite()
    assert stand.stranger().get(link).status_code == 200
    assert stand.stranger().get(link).status_code == 403


def test_the_api_tells_what_became_of_a_mission(stand: Stand, mission: Mission) -> None:
    found = stand.owner().get(f"/api/v1/missions/{mission.mission_id}").json()
    assert (found["status"], found["goal_verdict"]) == ("succeeded", "satisfied")
    assert found["state_version"] == mission.k
    assert found["duplicate_starts"] == 0
    assert found["physical_starts"] > 0
    assert [one["name"] for one in found["segments"]] == ["go", "return"]
    for segment in found["segments"]:
        assert segment["reference_length_m"] == pytest.approx(17.62, abs=0.005)
        assert segment["measured_distance_m"] <= 0.40
    assert len(found["images"]) == 8
    assert {(one["width"], one["height"]) for one in found["images"]} == {(1280, 720)}
    assert found["findings"]
    assert found["recovery"] == {"spent": 0, "remaining": 8}


@pytest.mark.ledger("R208", symbol="app.views.mission_json:mission_outcome")
def test_the_final_record_keeps_finding_delivery_and_frames_that_check_against_their_sums(
    stand: Stand, operator: TestClient, mission: Mission
) -> None:
    found = stand.owner().get(f"/api/v1/missions/{mission.mission_id}").json()
    assert [one["text"] for one in found["findings"] if one["report_sha256"]]
    assert (found["goal_verdict"], found["recovery"]["remaining"], found["duplicate_starts"]) == ("satisfied", 8, 0)
    delivered = [one for one in found["receipts"] if one["kind"] == "delivery"]
    assert len({one["sha256"] for one in delivered} & {one["sha256"] for one in found["images"]}) == 4
    assert len({one["receipt_id"] for one in delivered}) == 5
    assert all(one["text"].startswith("ack-") for one in delivered)
    for image in found["images"]:
        frame = operator.get(f"/evidence/{image['sha256']}")
        assert hashlib.sha256(frame.content).hexdigest() == image["sha256"]


def test_api_failures_are_problem_documents(stand: Stand, mission: Mission) -> None:
    owner = stand.owner()
    for answer in (owner.get("/api/v1/missions/msn_none"), owner.post("/api/v1/missions", json={"robot_id": ""})):
        assert answer.status_code in (404, 422)
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["title"]
    wrong = stand.stranger().get("/api/v1/missions", headers={"Authorization": "Bearer wrong"})
    assert wrong.status_code == 401
    assert wrong.headers["content-type"] == "application/problem+json"


def test_the_api_lists_events_with_their_chain(stand: Stand, mission: Mission) -> None:
    events = stand.owner().get(f"/api/v1/missions/{mission.mission_id}/events").json()
    assert [one["kind"] for one in events[:2]] == ["MissionCreated", "ContractCompiled"]
    later = stand.owner().get(f"/api/v1/missions/{mission.mission_id}/events?after={events[4]['position']}").json()
    assert later == events[5:]


def test_an_unknown_mission_is_a_page_that_says_so(operator: TestClient) -> None:
    answer = operator.get(f"/missions/{MissionId('msn_none')}")
    assert answer.status_code == 404
    assert "There is no mission msn_none" in answer.text
