"""Routes and own missions of a site are changed by page and API, checked as its folder is, and written back to it."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.auth.commit_authority import authority
from app.background.signals import SignalBroker
from app.main import create_app
from app.scene.port import NoSceneViews
from app.settings import ConsoleSettings
from harness.baseline.load import workspace_in
from harness.bootstrap import Harness, open_harness
from harness.contracts.actors import Actor
from harness.contracts.ids import RobotId
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.site_robots import robot_names
from harness.workspace.new_folder import write_folder
from rsi_reviews.deciders import DECIDERS
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import BASE, OWN, Stand, console_stand
from tests.builders.shops import ROOT, regen

ADA = Actor(name="ada", role="operator")
HALL = ROOT / "docs" / "examples" / "hall.yaml"
THROUGH_THE_WALL = "0, 0; 6, 0"


class Hall:
    """A site with a floor map, its harness without a robot that answers, and its console."""

    def __init__(self, folder: Path, harness: Harness, client: TestClient) -> None:
        self.folder, self.harness, self.client = folder, harness, client

    @property
    def site(self) -> Any:
        return self.harness.runtime.site

    def route(self, name: str) -> Any:
        return next(one for one in self.site.routes if one.name == name)

    def robots(self) -> dict[str, Any]:
        return {one["name"]: one for one in self.client.get("/api/v1/own-robots").json()}

    def missions(self) -> dict[str, Any]:
        return {one["name"]: one for one in self.client.get("/api/v1/own-missions").json()}


@contextmanager
def opened(folder: Path, *, robots: tuple[str, ...] = ()) -> Iterator[Hall]:
    settings = ConsoleSettings(port=8000, robots=(), password_memory_kib=19456)
    accounts = quick_accounts(settings)
    chosen = HarnessSettings(site_folder=folder, data_folder=folder / "var", no_robots=True, robots=robots)
    with open_harness(chosen, deciders=DECIDERS, authority=authority(accounts)) as harness:
        app = create_app(
            harness.runtime,
            settings,
            SignalBroker(),
            NoSceneViews(),
            accounts=accounts,
            site_files=harness.site_files,
            site_robots=harness.site_robots,
        )
        try:
            client = TestClient(app, base_url=BASE, follow_redirects=False, headers=OWN)
            assert client.get(app.state.sessions.invite()).status_code == 200
            yield Hall(folder, harness, client)
        finally:
            app.state.console.speech.close()


@pytest.fixture
def hall(tmp_path: Path) -> Iterator[Hall]:
    write_folder(tmp_path / "hall", name="hall", map_file=HALL)
    with opened(tmp_path / "hall") as found:
        yield found


def typed(hall: Hall, of: str, /, **changed: str) -> dict[str, str]:
    """The form of a route as its page fills it in."""
    route = hall.route(of)
    waypoints = "; ".join(f"{x}, {y}" for x, y in route.waypoints_m)
    given = {"start": route.start, "end": route.end, "waypoints": waypoints, "aliases": "", "reason": "surveyed"}
    return given | {"basis": "0"} | changed


def bent(hall: Hall, name: str) -> str:
    """The route with one more waypoint, half-way along its first leg."""
    (ax, ay), (bx, by), *rest = hall.route(name).waypoints_m
    points = [(ax, ay), ((ax + bx) / 2, (ay + by) / 2), (bx, by), *rest]
    return "; ".join(f"{x:g}, {y:g}" for x, y in points)


def test_a_changed_route_is_what_new_missions_follow_and_old_ones_keep_theirs(hall: Hall) -> None:
    runtime, name = hall.harness.runtime, hall.site.routes[0].name
    before = hall.route(name).waypoints_m
    answer = hall.client.post(f"/routes/{name}/edit", data=typed(hall, name, waypoints=bent(hall, name)))
    assert answer.status_code == 303, answer.text
    assert len(hall.route(name).waypoints_m) == len(before) + 1
    page = hall.client.get(f"/routes/{name}/edit").text
    assert "surveyed" in page and "waypoints" in page
    assert f"/routes/{name}/edit" in hall.client.get("/places").text
    assert runtime.shipped_route(name).waypoints_m == before  # type: ignore[union-attr]
    runtime.verify()


@pytest.mark.parametrize(
    ("changed", "field", "said"),
    [
        ({"waypoints": THROUGH_THE_WALL}, "waypoints", "through a wall"),
        ({"waypoints": "1, 1"}, "waypoints", "at least two"),
        ({"waypoints": "1, 1; far"}, "waypoints", "at least two"),
        ({"end": "nowhere"}, "end", "no place of the site"),
        ({"end": ""}, "end", "where it ends"),
        ({"aliases": "home"}, "aliases", "names two things"),
        ({"reason": ""}, "reason", ""),
    ],
)
def test_what_is_wrong_with_a_route_stands_beside_its_field_and_nothing_is_saved(
    hall: Hall, changed: dict[str, str], field: str, said: str
) -> None:
    name = hall.site.routes[0].name
    before = hall.site
    answer = hall.client.post(f"/routes/{name}/edit", data=typed(hall, name, **changed))
    assert answer.status_code == 422
    assert f'id="wrong-{field}"' in answer.text and said in answer.text
    if changed.get("waypoints"):
        assert changed["waypoints"] in answer.text, "what was typed stays"
    assert hall.site == before


def test_a_route_is_added_removed_and_comes_back_as_it_was(hall: Hall) -> None:
    first = hall.site.routes[0]
    new = typed(hall, first.name, name="detour", waypoints=bent(hall, first.name), aliases="the long way")
    assert hall.client.post("/routes/new", data=new | {"name": "no name"}).status_code == 422
    assert hall.client.post("/routes/new", data=new).status_code == 303
    assert hall.client.post("/routes/new", data=new).status_code == 422, "there is one of that name"
    assert hall.route("detour").aliases == ("the long way",)
    gone = hall.client.post("/routes/detour/remove", data={"basis": "1", "reason": "built over"})
    assert gone.status_code == 303 and all(one.name != "detour" for one in hall.site.routes)
    again = hall.client.post("/routes/detour/remove", data={"basis": "1", "reason": "built over"})
    assert again.status_code == 409
    page = hall.client.get("/routes/detour/edit").text
    assert "removed" in page and "built over" in page and "the long way" in page
    back = hall.client.post("/routes/detour/edit", data=new | {"basis": "2"})
    assert back.status_code == 303 and hall.route("detour").aliases == ("the long way",)
    assert hall.client.get("/routes/nothing/edit").status_code == 404


def test_two_tabs_on_one_route_the_second_is_refused_and_keeps_what_was_typed(hall: Hall) -> None:
    name = hall.site.routes[0].name
    first, second = typed(hall, name, aliases="first way"), typed(hall, name, aliases="second way")
    assert hall.client.post(f"/routes/{name}/edit", data=first).status_code == 303
    answer = hall.client.post(f"/routes/{name}/edit", data=second)
    assert answer.status_code == 409 and "changed meanwhile" in answer.text and 'value="second way"' in answer.text


def test_programs_change_routes_with_the_same_refusals(hall: Hall) -> None:
    route = hall.site.routes[0]
    body = {"start": route.start, "end": route.end, "waypoints_m": [list(one) for one in route.waypoints_m]}
    path = f"/api/v1/routes/{route.name}"
    wall = hall.client.post(path, json=body | {"waypoints_m": [[0, 0], [6, 0], body["waypoints_m"][-1]], "reason": "x"})
    assert wall.status_code == 422 and "through a wall" in wall.json()["detail"]
    saved = hall.client.post(path, json=body | {"aliases": ["the way there"], "reason": "named"})
    assert saved.status_code == 200, saved.text
    (found,) = [one for one in saved.json()["routes"] if one["name"] == route.name]
    assert found["aliases"] == ["the way there"]
    stale = hall.client.post(path, json=body | {"reason": "again"})
    assert (stale.status_code, stale.json()["code"]) == (409, "changed_meanwhile")
    gone = hall.client.post(f"{path}/remove", json={"basis": 1, "reason": "unused"})
    assert gone.status_code == 200 and all(one["name"] != route.name for one in gone.json()["routes"])
    assert hall.client.post(f"{path}/remove", json={"basis": 2, "reason": "unused"}).status_code == 404


def test_the_route_of_a_way_to_safety_is_no_pages_to_change() -> None:
    with console_stand() as stand:
        client, site = stand.operator(), stand.harness.runtime.site
        name = next(zone.retreat.route for zone in site.zones if zone.retreat is not None)
        route = next(one for one in site.routes if one.name == name)
        waypoints = "; ".join(f"{x}, {y}" for x, y in route.waypoints_m)
        form = {
            "start": route.start,
            "end": route.end,
            "waypoints": waypoints,
            "aliases": "",
            "reason": "x",
            "basis": "0",
        }
        for path in ("edit", "remove"):
            answer = client.post(f"/routes/{name}/{path}", data=form)
            assert answer.status_code == 422 and "authorised" in answer.text
        assert stand.harness.runtime.site == site


def test_a_mission_is_changed_by_its_yaml_and_started_as_changed(hall: Hall) -> None:
    (name, mission), *_ = hall.missions().items()
    assert mission["revision"] == 0 and mission["text"].lstrip().startswith(("#", "name"))
    text = mission["text"] + "\n# checked on site\n"
    form = {"text": text, "basis": "0", "reason": "noted"}
    assert hall.client.post(f"/own-missions/{name}/edit", data=form).status_code == 303
    found = hall.missions()[name]
    assert found["revision"] == 1 and "# checked on site" in found["text"]
    page = hall.client.get(f"/own-missions/{name}/edit").text
    assert "# checked on site" in page and "noted" in page
    answer = hall.client.post(f"/own-missions/{name}/edit", data=form)
    assert answer.status_code == 409 and "changed meanwhile" in answer.text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("nodes:", "nodez:", "nodez"),
        ("capabilities: [navigate]", "capabilities: [fly]", "fly"),
        ("recovery_total: ", "recovery_total: minus", "recovery_total"),
        ("name: ", "name: other-", "other-"),
        ("\n", "\n: [", "line 2"),
    ],
)
def test_what_is_wrong_with_a_mission_names_its_line_and_nothing_is_saved(
    hall: Hall, old: str, new: str, said: str
) -> None:
    (name, mission), *_ = hall.missions().items()
    assert old in mission["text"]
    wrong = {"text": mission["text"].replace(old, new, 1), "basis": "0", "reason": "x"}
    answer = hall.client.post(f"/own-missions/{name}/edit", data=wrong)
    assert answer.status_code == 422 and 'id="wrong-text"' in answer.text
    assert f"{name}.yaml" in answer.text and said in answer.text and re.search(r"yaml:\d|line \d", answer.text)
    refused = hall.client.post(f"/api/v1/own-missions/{name}", json=wrong | {"basis": 0})
    assert refused.status_code == 422
    assert hall.missions() == {name: mission}


def test_missions_are_added_and_removed_and_what_ships_stays_out_of_reach(hall: Hall) -> None:
    (name, mission), *_ = hall.missions().items()
    other = mission["text"].replace(f"name: {name}", "name: second-way", 1)
    assert hall.client.post("/own-missions/new", data={"text": other, "reason": "new"}).status_code == 303
    assert set(hall.missions()) == {name, "second-way"}
    start = Start(actor=ADA, robot_id=RobotId("robot-1"), template="second-way")
    assert hall.harness.runtime.draft(start).template == "second-way"
    again = hall.client.post("/own-missions/new", data={"text": other, "reason": "new"})
    assert again.status_code == 422 and "Another mission is called" in again.text
    shipped = other.replace("name: second-way", "name: warehouse-inspection", 1)
    assert hall.client.post("/own-missions/new", data={"text": shipped, "reason": "new"}).status_code == 422
    assert (
        hall.client.post("/api/v1/own-missions/warehouse-inspection", json={"text": shipped, "reason": "x"}).status_code
        == 422
    )
    gone = hall.client.post("/own-missions/second-way/remove", data={"basis": "1", "reason": "unused"})
    assert gone.status_code == 303 and set(hall.missions()) == {name}
    assert "second-way" in hall.client.get("/own-missions/second-way/edit").text, "it comes back as it was"
    assert (
        hall.client.post("/own-missions/warehouse-inspection/remove", data={"basis": "0", "reason": "x"}).status_code
        == 404
    )
    body = {"basis": 0, "reason": "unused"}
    assert hall.client.post("/api/v1/own-missions/nothing/remove", json=body).status_code == 404
    assert hall.client.post(f"/api/v1/own-missions/{name}/remove", json=body).json() == []
    assert "no missions of its own" in hall.client.get("/own-missions").text


def test_changes_are_written_back_to_the_files_and_read_again_as_they_are(tmp_path: Path) -> None:
    folder = tmp_path / "hall"
    write_folder(folder, name="hall", map_file=HALL)
    with opened(folder) as hall:
        route = hall.site.routes[0].name
        assert (
            hall.client.post(f"/routes/{route}/edit", data=typed(hall, route, aliases="the way there")).status_code
            == 303
        )
        (name, mission), *_ = hall.missions().items()
        other = mission["text"].replace(f"name: {name}", "name: second-way", 1) + "# kept\n"
        assert hall.client.post("/own-missions/new", data={"text": other, "reason": "new"}).status_code == 303
        assert hall.client.post(f"/own-missions/{name}/remove", data={"basis": "0", "reason": "old"}).status_code == 303
        before = hall.site
    words = ("site", "export", str(folder))
    code, shown, _ = regen(*words)
    assert code == 1 and not shown["written"] and any("second-way" in line for line in shown["changes"])
    assert regen(*words, "--write")[0] == 0
    assert regen(*words) == (0, {"changes": [], "written": False}, "")
    found = workspace_in(folder)
    assert found.site.routes == before.routes
    assert [one.name for one in found.missions] == ["second-way"]
    assert (folder / "missions" / "second-way.yaml").read_text() == other
    assert not (folder / "missions" / f"{name}.yaml").exists()
    with opened(folder) as hall:
        assert set(hall.missions()) == {"second-way"} and hall.site.routes == before.routes


ARM = """\
# the arm in hall B
name: arm
kind: http
address: http://192.0.2.7:8080
token: {environment: ROBOT_ARM_TOKEN}
"""


def test_a_robot_is_added_and_the_next_start_connects_it(tmp_path: Path) -> None:
    write_folder(tmp_path / "hall", name="hall", map_file=HALL)
    with opened(tmp_path / "hall") as hall:
        first = next(iter(hall.robots()))
        answer = hall.client.post("/own-robots/new", data={"text": ARM, "reason": "bought"})
        assert answer.status_code == 303, answer.text
        added = hall.robots()["arm"]
        assert (added["kind"], added["address"], added["revision"]) == ("http", "http://192.0.2.7:8080", 1)
        assert (added["in_force"], hall.robots()[first]["in_force"]) == (False, True)
        page = hall.client.get("/own-robots").text
        assert "from the next start" in page and "start the console again" in page
        assert "bought" in hall.client.get("/own-robots/arm/edit").text
        assert hall.client.post("/own-robots/new", data={"text": ARM, "reason": "twice"}).status_code == 422
        gone = hall.client.post(f"/own-robots/{first}/remove", data={"basis": "0", "reason": "sold"})
        assert gone.status_code == 303, gone.text
        assert "still driven until then" in hall.client.get("/own-robots").text
        last = hall.client.post("/api/v1/own-robots/arm/remove", json={"basis": 1, "reason": "sold too"})
        assert last.status_code == 422 and "robot_is_last" in last.text, last.text
    with opened(tmp_path / "hall") as hall:
        assert hall.robots().keys() == {"arm"} and hall.robots()["arm"]["in_force"]
        assert [one.name for one in hall.harness.site_robots.addressed] == []
        assert "start the console again" not in hall.client.get("/own-robots").text
    chosen = HarnessSettings(site_folder=tmp_path / "hall", data_folder=tmp_path / "hall" / "var")
    assert robot_names(chosen) == ("arm",)
    code, shown, _ = regen("site", "export", str(tmp_path / "hall"), "--write")
    assert (code, shown["written"]) == (0, True)
    assert "hall B" in (tmp_path / "hall" / "robots.yaml").read_text(), "its comment goes to the file"
    found = workspace_in(tmp_path / "hall").robots
    assert [one.name for one in found] == ["arm"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ARM.replace("kind: http", "kind: telnet"), "arm.yaml:3"),
        (ARM.replace("ROBOT_ARM_TOKEN", "DATABASE_PASSWORD"), "may not name the secret DATABASE_PASSWORD"),
        (ARM.replace("{environment: ROBOT_ARM_TOKEN}", "{file: /etc/shadow}"), "may not name the secret /etc/shadow"),
        (ARM.replace("{environment: ROBOT_ARM_TOKEN}", "{file: secrets/../site.yaml}"), "may not name the secret"),
        (ARM.replace("{environment: ROBOT_ARM_TOKEN}", "{}"), "name one of them"),
        (ARM + "speed: 3\n", "unknown field"),
        (ARM.replace("http://192.0.2.7:8080", "file:///etc/passwd"), "arm.yaml"),
        (ARM.replace("name: arm", "name: Arm One"), "arm.yaml"),
        (ARM + "footprint_m: [[0, 0]]\n", "fewer than three corners"),
        ("- a\n- list\n", "arm.yaml"),
    ],
)
def test_what_is_wrong_with_a_robot_names_its_line_and_nothing_is_saved(hall: Hall, text: str, said: str) -> None:
    before = hall.robots()
    answer = hall.client.post("/own-robots/new", data={"text": text, "reason": "bought"})
    assert answer.status_code == 422
    assert said.replace("arm.yaml", "robot.yaml") in unescape(answer.text)
    assert hall.robots() == before


def test_an_entry_keeps_the_secret_of_its_file_only_at_its_address(tmp_path: Path) -> None:
    folder = write_hall_with_arm(tmp_path, token="{environment: PLANT_TOKEN}")
    with opened(folder) as hall:
        text = hall.robots()["arm"]["text"]
        assert text.startswith("name: arm") and "PLANT_TOKEN" in text
        same = {"text": text + "speed_limit_mps: 0.4\n", "basis": "0", "reason": "slower"}
        assert hall.client.post("/own-robots/arm/edit", data=same).status_code == 303
        moved = same | {"text": text.replace("192.0.2.7", "192.0.2.66"), "basis": "1"}
        answer = hall.client.post("/own-robots/arm/edit", data=moved)
        assert answer.status_code == 422 and "may not name the secret PLANT_TOKEN" in answer.text
        stale = hall.client.post("/own-robots/arm/edit", data=same)
        assert stale.status_code == 409
        renamed = same | {"text": text.replace("name: arm", "name: leg"), "basis": "1"}
        assert hall.client.post("/own-robots/arm/edit", data=renamed).status_code == 422


def test_a_change_that_the_file_contradicts_later_is_left_out_with_its_reason(tmp_path: Path) -> None:
    folder = tmp_path / "hall"
    write_folder(folder, name="hall", map_file=HALL)
    with opened(folder) as hall:
        assert hall.client.post("/own-robots/new", data={"text": ARM, "reason": "bought"}).status_code == 303
    write_arm(folder, name="leg", token="{environment: PLANT_TOKEN}")
    with opened(folder) as hall:
        assert "arm" not in hall.robots() and "leg" in hall.robots()
        assert hall.harness.absent[RobotId("arm")].code == "address_of_two"


def test_robots_that_the_start_named_are_not_changed_by_a_folder(tmp_path: Path) -> None:
    write_folder(tmp_path / "hall", name="hall", map_file=HALL)
    with opened(tmp_path / "hall", robots=("vbot-1",)) as hall:
        page = hall.client.get("/own-robots").text
        assert "--robots" in page and "/own-robots/new" not in page
        assert "<td>yes</td>" not in page, "no entry of the file is in force"
        answer = hall.client.post("/own-robots/new", data={"text": ARM, "reason": "bought"})
        assert answer.status_code == 422 and "apart from its site" in unescape(answer.text)
        name = next(iter(hall.robots()))
        gone = hall.client.post(f"/own-robots/{name}/remove", data={"basis": "0", "reason": "sold"})
        assert gone.status_code == 422 and "apart from its site" in unescape(gone.text)


def write_hall_with_arm(folder: Path, *, token: str) -> Path:
    write_folder(folder / "hall", name="hall", map_file=HALL)
    write_arm(folder / "hall", name="arm", token=token)
    return folder / "hall"


def write_arm(folder: Path, *, name: str, token: str) -> None:
    entry = f"  - name: {name}\n    kind: http\n    address: http://192.0.2.7:8080\n    token: {token}\n"
    file = folder / "robots.yaml"
    file.write_text(file.read_text().rstrip() + "\n" + entry)


def test_a_mission_that_is_under_way_keeps_the_route_it_was_compiled_with() -> None:
    with console_stand() as stand:
        check_kept(stand)


def check_kept(stand: Stand) -> None:
    runtime, client = stand.harness.runtime, stand.operator()
    retreats = {zone.retreat.route for zone in runtime.site.zones if zone.retreat is not None}
    route = next(one for one in runtime.site.routes if one.name not in retreats)
    old = runtime.mission(stand.created())
    body = {"start": route.start, "end": route.end, "waypoints_m": [list(one) for one in route.waypoints_m]}
    (ax, ay), (bx, by) = route.waypoints_m[:2]
    body["waypoints_m"].insert(1, [(ax + bx) / 2, (ay + by) / 2])  # type: ignore[union-attr]
    assert client.post(f"/api/v1/routes/{route.name}", json=body | {"reason": "surveyed"}).status_code == 200
    new = runtime.mission(stand.created())

    def length(mission: Any) -> int:
        return len(next(one for one in runtime.site_of(mission).routes if one.name == route.name).waypoints_m)

    assert (length(old), length(new)) == (len(route.waypoints_m), len(route.waypoints_m) + 1)
