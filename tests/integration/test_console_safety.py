"""The console's safety controls: a stop of one robot, what every page says of safety, freeing what is quarantined."""

import time
from dataclasses import replace
from threading import Event
from typing import Any

import pytest

from app.background.alerts import Alerts
from app.i18n.reasons.rendering import sentence
from harness.contracts.commands import AcquireLease, QuarantineLease
from harness.contracts.control import CONTROL, RecordPosture
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import InvocationId, MissionId, ResourceId, RobotId, lease_stream, leased
from harness.contracts.reasons import UNEXPLAINED, because
from harness.gate.commit import CommandEnvelope
from simulator.robot import SimulatedProvider
from tests.builders.fleets import ONE, Stand, fleet_stand
from tests.builders.timeouts import TIMEOUT_S
from tests.integration.test_console_robots import REASON, from_dock_m, run_together, started

BASE = leased(RobotId(ONE), ResourceId("mobile_base"))


def quarantine(stand: Stand, resource: ResourceId = BASE) -> None:
    """Somebody had the resource, and nobody can say what became of it."""
    stream, runtime = lease_stream(resource), stand.harness.runtime
    holder = InvocationId("inv_lost")
    acquired = AcquireLease(
        resource=resource,
        mission_id=MissionId(""),
        invocation_id=holder,
        token=runtime.lease(resource).token + 1,
        expires_s=stand.harness.clocks[RobotId(ONE)].now().mission_s + 60.0,
    )
    lost = QuarantineLease(invocation_id=holder, reason=because("robot_silent"))
    for command in (acquired, lost):
        runtime.commit([CommandEnvelope(stream, command, RobotId(ONE))])


def test_one_press_stops_one_robot_without_a_reason_and_the_reason_joins_it_while_it_stops() -> None:
    with fleet_stand() as stand:
        mission_id, operator = started(stand.harness, ONE), stand.operator()
        run_together(stand.harness, mission_id, until=lambda: from_dock_m(stand) > 0.5)
        answer = operator.post(f"/robots/{ONE}/stop")
        assert (answer.status_code, answer.headers["location"]) == (303, f"/robots/{ONE}?stopped=yes")
        mission = stand.harness.runtime.mission(mission_id)
        assert mission.status == "stopping" and mission.stop is not None and mission.stop.reason == UNEXPLAINED
        invocation = mission.invocation
        assert invocation is not None
        provider = next(iter(stand.harness.robots[RobotId(ONE)].providers()))
        until_s, found = time.monotonic() + TIMEOUT_S, provider.find(invocation.intent.request_id)
        while found is not None and found.status not in ("stopping", "cancelled"):
            assert time.monotonic() < until_s, "the robot was told at once, and nobody stepped its mission"
            found = provider.find(invocation.intent.request_id)
        assert found is not None
        assert "Why was it stopped?" in operator.get(f"/robots/{ONE}?stopped=yes").text
        assert operator.post(f"/robots/{ONE}/stop/reason", data=REASON).status_code == 303
        again = stand.harness.runtime.mission(mission_id).stop
        assert again is not None and again.reason == REASON["reason"]
        run_together(stand.harness, mission_id)
        assert stand.harness.runtime.mission(mission_id).status == "cancelled"
        assert operator.post(f"/robots/{ONE}/stop").status_code == 303, "a stop may always be asked"
        assert f'id="stop-{ONE}"' in operator.get("/").text


def test_a_quarantined_base_says_so_on_every_page_and_one_button_observes_and_releases_it() -> None:
    with fleet_stand() as stand:
        mission_id, operator = started(stand.harness, ONE), stand.operator()
        quarantine(stand)
        for path in ("/", f"/robots/{ONE}", f"/missions/{mission_id}", "/handoffs"):
            page = operator.get(path).text
            assert "is quarantined, nothing moves it. The robot does not answer." in page, path
            assert f'action="/robots/{ONE}/release"' in page, path
        assert operator.post(f"/robots/{ONE}/release").status_code == 303
        assert stand.harness.runtime.lease(BASE).status == "free"
        assert "quarantined" not in operator.get(f"/robots/{ONE}").text
        quarantine(stand, leased(RobotId("vbot-9"), "gripper"))
        assert "vbot-9: gripper is quarantined" in operator.get("/").text, "of a robot that is not connected here too"


def test_an_order_to_lie_down_is_measured_and_one_that_is_not_shown_is_a_critical_alert() -> None:
    with fleet_stand() as stand:
        operator, watch = stand.operator(), stand.app.state.alert_watch
        assert operator.post(f"/robots/{ONE}/safe", data=REASON).status_code == 303
        shown = stand.harness.runtime.stream(CONTROL)[-1]
        assert shown.kind == "PostureShown" and b'"done":true' in shown.body
        watch.step()
        assert not [one for _, one in Alerts(stand.harness.runtime).all() if one.newest.kind == "safety_not_reached"]
        not_shown = RecordPosture(
            robot_id=RobotId(ONE), posture="lying", done=False, measured={}, reason=because("rest_not_shown")
        )
        stand.harness.runtime.commit([CommandEnvelope(CONTROL, not_shown, RobotId(ONE))])
        watch.step()
        found = [one for _, one in Alerts(stand.harness.runtime).all() if one.newest.kind == "safety_not_reached"]
        assert [one.priority for one in found] == ["critical"]
        assert "is not shown to be" in sentence(found[0].newest.title)


def test_a_stop_is_answered_although_the_robot_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    answering, asked = Event(), Event()

    def hanging(provider: SimulatedProvider, handle: str) -> Any:
        asked.set()
        answering.wait(60.0)
        raise ProviderUnreachable(because("robot_silent"))

    with fleet_stand() as stand:
        mission_id, operator = started(stand.harness, ONE), stand.operator()
        run_together(stand.harness, mission_id, until=lambda: from_dock_m(stand) > 0.5)
        monkeypatch.setattr(SimulatedProvider, "stop", hanging)
        began_s = time.monotonic()
        answer = operator.post(f"/api/v1/robots/{ONE}/stop", json={})
        assert answer.json()["asked"] == [mission_id] and time.monotonic() - began_s < 30.0
        assert asked.wait(10.0) and stand.harness.runtime.mission(mission_id).status == "stopping"
        monkeypatch.undo()
        answering.set()


def test_a_mission_is_shown_although_no_robot_answers_for_its_journal() -> None:
    def silent(mission_id: MissionId) -> Any:
        raise ProviderUnreachable(because("robot_silent"))

    with fleet_stand() as stand:
        mission_id, operator = started(stand.harness, ONE), stand.operator()
        stand.app.state.console = replace(stand.app.state.console, starts=silent)
        told = operator.get(f"/api/v1/missions/{mission_id}")
        assert (told.status_code, told.json()["physical_starts"]) == (200, None)
        assert operator.get(f"/missions/{mission_id}/report").status_code == 200
        assert operator.get(f"/missions/{mission_id}/report.json").json()["physical_starts"] is None
