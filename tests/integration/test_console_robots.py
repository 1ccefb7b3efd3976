"""/robots: a stop of everything, autonomy, camera, driving by hand, who may; and the page while robots start."""

import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from math import hypot

import httpx

from app.i18n.reasons.rendering import sentence
from app.main import bind
from app.settings import ConsoleSettings
from app.web.filters import iso
from app.web.starting_page import starting
from harness.contracts.control import CONTROL
from harness.contracts.ids import MissionId
from harness.contracts.upcasting import name_of
from simulator.robot import SimulatedRobot
from tests.builders.consoles import Stand
from tests.builders.fleets import ONE, TWO, fleet_stand, moving, run_together, started

REASON = {"reason": "a person in the way"}


def under_way(stand: Stand) -> tuple[MissionId, MissionId]:
    """Both robots on their first leg."""
    both = started(stand.harness, ONE), started(stand.harness, TWO)
    run_together(stand.harness, *both, until=lambda: all(moving(stand.harness, one) for one in both))
    return both


def test_robots_without_a_mission_stand_on_the_map_of_the_first_page() -> None:
    with fleet_stand() as stand:
        ended = started(stand.harness, ONE), started(stand.harness, TWO)
        run_together(stand.harness, *ended, until=lambda: not stand.harness.runtime.open_missions())
        page = stand.operator().get("/").text
        assert "runs no mission" in page
        for robot in (ONE, TWO):
            assert re.search(rf'href="/robots/{robot}">\s*<g\s+class="robot-mark"', page)


def test_a_stop_of_everything_names_every_mission_and_robot_and_stops_them() -> None:
    with fleet_stand() as stand:
        both, operator = under_way(stand), stand.operator()
        page = operator.get("/robots/stop").text
        assert all(name in page for name in (*both, ONE, TWO)) and "Stop all 2 now" in page
        assert operator.post("/robots/stop", data=REASON).status_code == 303
        assert {stand.harness.runtime.mission(one).status for one in both} == {"stopping"}
        assert "the provider has not answered yet" in operator.get("/robots").text
        watched = operator.get(f"/missions/{both[0]}").text
        assert f'id="camera-{ONE}"' in watched and 'class="planned"' in watched, "camera and map beside each other"
        run_together(stand.harness, *both)
        for mission_id in both:
            mission = stand.harness.runtime.mission(mission_id)
            assert mission.ended and mission.stopped is not None and mission.stopped.static
            assert mission.stop is not None and mission.stop.reason == REASON["reason"]
        assert {stand.harness.robots[one].status().posture for one in (ONE, TWO)} == {"standing"}


def test_every_page_carries_the_stop_of_everything_without_any_script() -> None:
    with fleet_stand() as stand:
        operator = stand.operator()
        for path in ("/", "/missions", "/robots", f"/robots/{ONE}", "/handoffs"):
            page = operator.get(path).text
            assert '<form method="post" action="/robots/stop" data-stop="">' in page
            for robot in (ONE, TWO):
                assert f'<form method="post" action="/robots/{robot}/stop" data-stop="{robot}">' in page


def test_the_page_sets_the_limit_and_one_mission_s_own_level() -> None:
    with fleet_stand() as stand:
        mission_id, operator = started(stand.harness, ONE), stand.operator()
        assert operator.post("/robots/autonomy", data={"autonomy": "manual", "reason": ""}).status_code == 422
        assert operator.post("/robots/autonomy", data={"autonomy": "wild", **REASON}).status_code == 422
        assert operator.post("/robots/autonomy", data={"autonomy": "approve_risky", **REASON}).status_code == 303
        assert "Set by <b>operator</b>" in operator.get("/robots").text
        assert stand.harness.runtime.mission(mission_id).level == "approve_risky"
        asked = {"autonomy": "manual", "mission_id": mission_id, **REASON}
        assert operator.post(f"/robots/{ONE}/autonomy", data=asked).status_code == 303
        assert stand.harness.runtime.mission(mission_id).level == "manual"
        stale = operator.post(f"/robots/{ONE}/pause", data={"mission_id": "msn_other", **REASON})
        assert stale.status_code == 409 and "another mission by now" in stale.text


def test_the_camera_shows_a_picture_its_age_and_the_ones_before() -> None:
    with fleet_stand() as stand:
        operator = stand.operator()
        answer = operator.get(f"/robots/{ONE}/camera.jpg")
        assert answer.headers["content-type"] == "image/jpeg" and answer.content[:3] == b"\xff\xd8\xff"
        assert float(answer.headers["x-age-s"]) >= 0.0
        page = operator.get(f"/robots/{ONE}/camera").text
        assert f"/robots/{ONE}/camera/1" in page
        assert operator.get(f"/robots/{ONE}/camera/1").content == answer.content
        assert operator.get(f"/robots/{ONE}/camera/77").status_code == 404
        assert operator.get("/robots/vbot-9/camera").status_code == 404


def test_driving_by_hand_from_the_page_moves_the_robot_and_only_for_its_driver() -> None:
    with fleet_stand() as stand:
        operator, owner = stand.operator(), stand.owner()
        assert operator.post(f"/robots/{ONE}/drive", data={"device": "tablet", **REASON}).status_code == 303
        page = operator.get(f"/robots/{ONE}/drive").text
        assert f'id="camera-{ONE}"' in page and f'id="map-{ONE}"' in page
        session = page.partition('data-session="')[2].partition('"')[0]
        clock, before = stand.harness.clocks[ONE], len(stand.harness.robots[ONE].starts())
        for _ in range(6):
            answer = operator.post(f"/robots/{ONE}/drive/turn", json={"session": session, "v_mps": 0.3})
            assert answer.status_code == 200
            clock.wait_until(clock.now().mission_s + 0.4)
        assert answer.json()["status"] == "driving" and answer.json()["v_mps"] > 0.1
        shown = operator.get(f"/robots/{ONE}/map?near=yes").text
        assert 'class="robot-mark"' in shown and 'class="hits' in shown, "where it is, and what its lidar sees"
        assert len(stand.harness.robots[ONE].starts()) == before + 1
        assert "by hand from tablet" in operator.get("/robots").text
        wrong = operator.post(
            f"/robots/{ONE}/drive/turn", json={"session": "x", "v_mps": 0.3}, headers={"Accept-Language": "zh-CN"}
        )
        assert wrong.status_code == 409 and not wrong.json()["reason"].isascii()
        taken = owner.post(f"/api/v1/robots/{ONE}/teleoperation", json={"device": "script", **REASON})
        assert taken.status_code == 409 and taken.json()["code"] == "wheel_taken"
        assert operator.post(f"/robots/{ONE}/drive/return").status_code == 303
        assert stand.harness.robots[ONE].status().posture == "standing"


def test_a_stop_of_everything_takes_the_wheel_from_whoever_drives() -> None:
    with fleet_stand() as stand:
        operator, clock = stand.operator(), stand.harness.clocks[TWO]
        assert operator.post(f"/robots/{TWO}/drive", data={"device": "tablet", **REASON}).status_code == 303
        session = stand.app.state.console.control().wheels[TWO].session
        for _ in range(4):
            operator.post(f"/robots/{TWO}/drive/turn", json={"session": session, "v_mps": 0.3})
            clock.wait_until(clock.now().mission_s + 0.4)
        assert "driven by hand" in operator.get("/robots/stop").text
        assert operator.post("/robots/stop", data=REASON).status_code == 303
        assert stand.app.state.console.control().wheels == {}
        assert stand.harness.robots[TWO].status().posture == "standing"
        late = operator.post(f"/robots/{TWO}/drive/turn", json={"session": session, "v_mps": 0.3})
        assert late.status_code == 409


def test_the_api_says_and_does_what_the_pages_do() -> None:
    with fleet_stand() as stand:
        both, owner = under_way(stand), stand.owner()
        rows = owner.get("/api/v1/robots").json()
        assert [(row["robot_id"], row["mission_id"]) for row in rows] == list(zip((ONE, TWO), both, strict=True))
        assert rows[0]["status"]["armed"] is True and rows[0]["autonomy"] == "autonomous"
        level = {"autonomy": "manual", **REASON}
        assert owner.post(f"/api/v1/missions/{both[0]}/autonomy", json=level).json()["autonomy"] == "manual"
        assert owner.post("/api/v1/control/autonomy", json=level).json()["autonomy"] == "manual"
        assert owner.post("/api/v1/control/autonomy", json={"autonomy": "wild", **REASON}).status_code == 422
        asked = owner.post("/api/v1/robots/stop", json=REASON).json()
        assert sorted(asked["asked"]) == sorted(both) and asked["refused"] == []
        run_together(stand.harness, *both)
        lying = owner.post(f"/api/v1/robots/{TWO}/safe", json=REASON)
        assert lying.status_code == 200 and lying.json()["status"]["posture"] == "lying"
        up = owner.post(f"/api/v1/robots/{TWO}/posture", json={"posture": "standing", **REASON})
        assert up.json()["status"]["posture"] == "standing"


def test_a_robot_is_sent_to_its_safe_place_shown_on_its_way_and_stopped_there_by_the_stop_of_everything() -> None:
    with fleet_stand() as stand:
        mission_id, operator = started(stand.harness, ONE), stand.operator()
        run_together(stand.harness, mission_id, until=lambda: from_dock_m(stand) > 2.0)
        assert operator.post(f"/robots/{ONE}/safe", data=REASON).status_code == 409
        run_together(stand.harness, mission_id)
        assert "goes the authorised way" in sentence(operator.get(f"/robots/{ONE}").text)
        assert operator.post(f"/robots/{ONE}/safe", data=REASON).status_code == 303
        page = operator.get(f"/robots/{ONE}").text
        assert "On the way to Anchor A, started by operator, authorised on 2026-11-20" in page
        assert "Stop it on its way" in page and "Stop all 1 now" in operator.get("/robots/stop").text
        assert operator.post("/robots/stop", data=REASON).status_code == 303
        to_the_end(stand)
        assert "arrival not confirmed" in sentence(operator.get(f"/robots/{ONE}").text)
        assert operator.post("/robots/stop", data={"safe": "yes", **REASON}).status_code == 303
        to_the_end(stand)
        assert "declared succeeded. No facts are accepted from this." in sentence(operator.get(f"/robots/{ONE}").text)
        assert from_dock_m(stand) < 0.4
        ended = [one.recorded_s for one in stand.harness.runtime.stream(CONTROL) if name_of(one.kind) == "RetreatEnded"]
        text = operator.get(f"/robots/{ONE}").text
        said = re.findall(r'<time datetime="([^"]*)">[^<]+ UTC\s*</time>:\s+Sent to', text)
        assert said == [iso(ended[-1])]
        started(stand.harness, ONE)
        assert "Sent to" not in sentence(operator.get(f"/robots/{ONE}").text), "it mattered until the next mission"
        assert 'href="/audit?kind=Retreat"' in sentence(operator.get(f"/robots/{ONE}").text)
        history = operator.get("/audit?kind=RetreatEnded").text
        assert (history.count("<td>RetreatEnded</td>"), history.count(f'<span class="under">{ONE}</span>')) == (2, 2)
        assert stand.harness.robots[TWO].status().posture == "lying"


def test_a_button_that_says_stop_never_sends_a_robot_off_and_the_other_way_round() -> None:
    with fleet_stand() as stand:
        mission_id, operator = started(stand.harness, ONE), stand.operator()
        run_together(stand.harness, mission_id, until=lambda: from_dock_m(stand) > 2.0)
        operator.post(f"/robots/{ONE}/safe", data=REASON)
        run_together(stand.harness, mission_id)
        go, stay = {"meant": "go", **REASON}, {"meant": "stay", **REASON}
        assert 'name="meant" value="go"' in sentence(operator.get(f"/robots/{ONE}").text)
        refused = operator.post(f"/robots/{ONE}/safe", data=stay)
        assert refused.status_code == 409 and "nothing to stop: nothing was done" in refused.text
        assert stand.harness.runtime.fold(CONTROL).retreats == {}
        assert operator.post(f"/robots/{ONE}/safe", data=go).status_code == 303
        assert 'name="meant" value="stay"' in sentence(operator.get(f"/robots/{ONE}").text)
        again = operator.post(f"/robots/{ONE}/safe", data=go)
        assert again.status_code == 409 and "on its way to its safe place by now" in again.text
        assert stand.harness.runtime.fold(CONTROL).retreats[ONE].status == "sent"
        assert operator.post(f"/robots/{ONE}/safe", data=stay).status_code == 303
        assert stand.harness.runtime.fold(CONTROL).retreats[ONE].status == "stopping"


def from_dock_m(stand: Stand) -> float:
    """By the truth of the simulation."""
    robot = stand.harness.robots[ONE]
    assert isinstance(robot, SimulatedRobot)
    return hypot(robot.world.body.state.x_m, robot.world.body.state.y_m)


def to_the_end(stand: Stand) -> None:
    """The robot's own loop, until its way to the safe place has ended."""
    for _ in range(200):
        if stand.harness.runtime.fold(CONTROL).retreating(ONE) is None:
            return
        stand.harness.clocks[ONE].wait_until(stand.harness.supervisor.step_retreat(ONE))
    raise AssertionError("the retreat did not end")


@contextmanager
def listening() -> Iterator[socket.socket]:
    listener: socket.socket = bind(0)
    try:
        yield listener
    finally:
        listener.close()


def test_while_robots_start_the_console_says_so_and_takes_no_command() -> None:
    with listening() as listener:
        port = listener.getsockname()[1]
        client = httpx.Client(base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=60.0)
        with client, starting(ConsoleSettings(port=port), listener, ("vbot-1", "vbot-2")):
            assert client.get("/healthz").text == "ok\n"
            page = client.get("/missions")
            assert page.status_code == 503 and "vbot-1, vbot-2" in page.text
            assert "default-src 'self'" in page.headers["content-security-policy"]
            assert client.post("/robots/stop", data=REASON).status_code == 503
        with socket.create_connection(("127.0.0.1", port), timeout=60.0):
            assert listener.accept()[0].close() is None, "whoever serves next takes the connections that come"
