"""/fleet, GET /fleet and `regen robot list`: every robot of the site, also those that other processes drive."""

from collections.abc import Callable, Iterator

import pytest
from fastapi.testclient import TestClient

from app.background.fleet_reports import ReportedRobots
from app.cli.robots import HEAD, line_of
from app.views.fleet import operating_mode
from harness.contracts.actors import Actor
from harness.contracts.control import CONTROL, LimitAutonomy
from harness.contracts.decisions import Accepted
from harness.contracts.fleet import WorkerReport
from harness.contracts.ids import RobotId
from tests.builders.consoles import Stand, console_stand
from tests.builders.fleets import ONE, TWO, fleet_stand, run_together, started
from tests.builders.reported_robots import moving, pose_at

AWAY = RobotId("vbot-7")
STATUS, POSE = moving(AWAY, charge=0.37), pose_at(3.0, 2.0)


class Site:
    """A console with two robots of its own, and one that the worker hall-b reports."""

    def __init__(self, stand: Stand, reported: ReportedRobots) -> None:
        self.stand, self._reported = stand, reported
        self.browser: TestClient = stand.operator()

    def report(self, robot_id: RobotId = AWAY, *, age_s: float = 0.5, trouble: str = "") -> None:
        """The worker's newest word on its robot."""
        self._reported.receive(
            WorkerReport(
                worker="hall-b",
                robot_id=robot_id,
                status=STATUS,
                age_s=age_s,
                trouble=trouble,
                pose=POSE,
                pose_age_s=age_s,
            )
        )

    def rows(self, query: str = "") -> dict[str, dict[str, object]]:
        """What the API says, by robot."""
        return {one["robot_id"]: one for one in self.browser.get(f"/api/v1/fleet{query}").json()}


@pytest.fixture
def site() -> Iterator[Site]:
    made: list[ReportedRobots] = []

    def reported(clock: Callable[[], float]) -> ReportedRobots:
        made.append(ReportedRobots(clock, worker="here"))
        return made[0]

    with fleet_stand(reported=reported) as stand:
        yield Site(stand, made[0])


def test_robots_of_other_processes_are_on_the_map_and_in_the_list_with_their_worker(site: Site) -> None:
    assert set(site.rows()) == {ONE, TWO}
    site.report()
    found = site.rows()[AWAY]
    assert (found["worker"], found["here"], found["link"], found["charge"]) == ("hall-b", False, "good", 0.37)
    assert (found["x_m"], found["y_m"], found["pose_old"]) == (3.0, 2.0, False)
    page = site.browser.get("/fleet").text
    assert f'id="fleet-{AWAY}"' in page
    assert 'transform="translate(3.0 -2.0)"' in page and "37 %" in page and "hall-b" in page
    assert f'href="/robots/{AWAY}"' in page
    assert site.browser.get(f"/robots/{AWAY}").status_code == 200


def test_a_worker_that_fell_silent_leaves_its_robots_with_a_lost_link(site: Site) -> None:
    site.report(age_s=9.0)
    found = site.rows()[AWAY]
    age_s = found["link_age_s"]
    assert found["link"] == "old" and isinstance(age_s, float) and age_s > 9.0 and found["pose_old"] is True
    site.report(age_s=9.0, trouble="The robot does not answer")
    assert site.rows("?link=lost").keys() == {AWAY}


@pytest.mark.parametrize(
    ("query", "shown"),
    [
        ("", {ONE, TWO, AWAY}),
        ("?q=hall", {AWAY}),
        ("?q=VBOT-1", {ONE}),
        ("?worker=here", {ONE, TWO}),
        ("?worker=here&q=2", {TWO}),
        ("?mode=manual", set()),
        ("?mode=semi_automatic", {ONE, TWO, AWAY}),
        ("?link=nonsense", set()),
    ],
)
def test_the_list_is_narrowed_by_words_and_values_alike_on_the_page_and_in_the_api(
    site: Site, query: str, shown: set[str]
) -> None:
    site.report()
    if "semi" in query:
        limit = LimitAutonomy(actor=Actor(name="ada", role="operator"), autonomy="approve_risky", reason="visitors")
        assert isinstance(site.stand.harness.runtime.decide([(CONTROL, limit)]), Accepted)
    assert set(site.rows(query)) == shown
    for path in ("/fleet", "/fleet/now"):
        page = site.browser.get(f"{path}{query}").text
        assert {one for one in (ONE, TWO, AWAY) if f'id="fleet-{one}"' in page} == shown
    assert ('hx-get="/fleet/now?' in site.browser.get(f"/fleet{query}").text) == bool(query)


def test_a_mission_is_given_to_a_robot_of_another_process_and_its_question_comes_first(site: Site) -> None:
    site.report()
    created = site.browser.post("/api/v1/missions", json={"robot_id": AWAY, "template": "circuit"})
    assert created.status_code == 201
    assert site.rows()[AWAY]["mission_id"] == created.json()["mission_id"]
    unknown = site.browser.post("/api/v1/missions", json={"robot_id": "vbot-99", "template": "circuit"})
    assert unknown.status_code == 404
    run_together(site.stand.harness, started(site.stand.harness, TWO, faults="early-success:persistent"))
    asking = site.rows()[TWO]
    assert (asking["mode"], asking["mission_status"]) == ("intervened", "awaiting_human")
    page = site.browser.get("/fleet").text
    assert f'href="/handoffs/{asking["handoff_id"]}"' in page
    assert page.index(f'id="fleet-{TWO}"') < page.index(f'id="fleet-{ONE}"')


def test_the_bar_of_a_large_fleet_stops_what_there_is_to_stop(site: Site) -> None:
    for number in range(7, 12):
        site.report(robot_id=RobotId(f"vbot-{number}"))
    assert site.browser.post("/api/v1/missions", json={"robot_id": AWAY, "template": "circuit"}).status_code == 201
    page = site.browser.get("/fleet").text
    assert f'data-stop="{AWAY}"' in page and 'data-stop="vbot-8"' not in page and f'data-stop="{ONE}"' not in page


def test_what_only_the_process_with_the_robot_can_do_is_refused_by_its_name(site: Site) -> None:
    site.report()
    body = {"posture": "lying", "reason": "visitors"}
    refused = site.browser.post(f"/api/v1/robots/{AWAY}/posture", json=body)
    assert refused.status_code == 409 and "hall-b" in refused.json()["detail"]
    everybody = site.browser.post("/api/v1/robots/stop", json={"reason": "smoke", "safe": True}).json()
    assert any("hall-b" in one for one in everybody["refused"])


def test_the_command_line_lists_worker_link_and_mode(site: Site) -> None:
    site.report()
    row = next(one for one in site.browser.get("/api/v1/robots").json() if one["robot_id"] == AWAY)
    line = dict(zip(HEAD, line_of(row), strict=True))
    assert (line["worker"], line["mode"], line["battery"]) == ("hall-b", "automatic", "37 %")


def test_a_robot_that_somebody_drives_is_manual_whatever_its_autonomy() -> None:
    assert operating_mode(None, driven=True, autonomy="autonomous") == "manual"
    assert operating_mode(None, driven=False, autonomy="autonomous") == "automatic"
    assert operating_mode(None, driven=False, autonomy="approve_each_motion") == "semi_automatic"


def test_a_filter_with_nothing_to_choose_is_not_shown(site: Site) -> None:
    with console_stand() as unnamed:
        alone = unnamed.operator().get("/fleet").text
    assert 'name="mode"' in alone and 'name="worker"' not in alone
    assert 'name="worker"' in site.browser.get("/fleet").text
