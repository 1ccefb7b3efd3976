"""`regen init` and `regen check`: a site's own folder, and every way in which it may be wrong, by file and line."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.main import app
from app.cli.output import complain
from app.i18n.reasons.rendering import explained
from harness.adapters.map_rasters import read_map
from harness.baseline.load import baseline, shipped_workspace
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.workspace.checks import site_problems
from harness.workspace.contract_yaml import Lines
from harness.workspace.new_folder import write_folder
from harness.workspace.reading import examined, open_workspace
from tests.saying import raises_saying

SHIPPED = tuple(template.name for template in baseline().templates)
PLACE_TWICE = """
  - place_id: bench
    name: Bench
    aliases: [dock]
    frame: map
    map_version: shop-1
    approach_m: [1, 1]
    provenance: measured by hand
    verification: configured

routes:"""


def regen(*words: str) -> tuple[int, Any]:
    """Exit code, and what was printed or complained."""
    done = CliRunner().invoke(app, [*words, "--json"])
    if isinstance(done.exception, HarnessError):
        return complain(done.exception), explained(done.exception)
    return done.exit_code, json.loads(done.stdout)


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    write_folder(tmp_path / "shop")
    return tmp_path / "shop"


def floor(folder: Path, *, resolution: float = 0.05, **changes: Any) -> Path:
    """A hall of 10 x 6 m with walls around it and one across, with a door; saved as map_server saves it."""
    picture = np.full((120, 200), 254, np.uint8)
    picture[[0, 1, -2, -1], :] = picture[:, [0, 1, -2, -1]] = 0
    picture[:80, 98:102] = 0
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / "hall.png"), picture)
    facts = {"image": "hall.png", "resolution": resolution, "origin": [-2.0, -3.0, 0.0], "negate": 0,
             "occupied_thresh": 0.65, "free_thresh": 0.25} | changes  # fmt: skip
    file = folder / "hall.yaml"
    file.write_text("\n".join(f"{name}: {json.dumps(value)}" for name, value in facts.items()) + "\nmode: trinary\n")
    return file


def test_a_new_folder_can_be_used_as_it_was_written(tmp_path: Path) -> None:
    folder = tmp_path / "my shop"
    code, made = regen("init", str(folder))
    assert code == 0 and {Path(one).name for one in made["files"]} >= {"site.yaml", "robots.yaml", "go-to-place.yaml"}
    code, found = regen("check", str(folder))
    assert (code, found["ok"], found["problems"]) == (0, True, [])
    assert [one["code"] for one in found["notes"]] == ["token_not_there"]
    code, refused = regen("init", str(folder))
    assert code == 2 and "holds something already" in refused


def test_a_folder_made_from_a_floor_map_has_places_on_free_floor_and_a_way_through_the_door(tmp_path: Path) -> None:
    folder = tmp_path / "hall"
    assert regen("init", str(folder), "--from", str(floor(tmp_path / "maps")))[0] == 0
    found = open_workspace(folder, reserved=SHIPPED)
    assert found.floor is not None and found.floor.cell_m == 0.05
    way = found.site.routes[0].waypoints_m
    assert len(way) >= 2 and sum(abs(x) + abs(y) for x, y in way) > 2.0
    lines = Lines((folder / "site.yaml").read_text())
    assert not list(site_problems(found.site, folder / "site.yaml", lines, found.floor))


def test_what_ships_is_such_a_folder() -> None:
    shipped = shipped_workspace()
    found, problems = examined(shipped.folder, reserved=SHIPPED)
    assert not problems and found is not None
    missions = [
        "camera-report",
        "exploration",
        "explore-place",
        "go-to-place",
        "photograph-subject",
        "spoken-report",
        "wait-at-place",
    ]
    assert [one.name for one in found.missions] == missions
    assert [one.name for one in found.robots] == ["vbot-1"]


LIMIT = "    speed_limit_mps: 0.5\n"
EVIDENCE = LIMIT + "    evidence:\n      kind: {}\n      address: {}\n"
BAD: list[tuple[str, str, str, str, str, str]] = [
    (
        "an unknown key",
        "site.yaml",
        "name: Home\n",
        "name: Home\n    colour: red\n",
        "unknown field `colour`",
        ":14",
    ),
    ("a value of another type", "site.yaml", "yaw_rad: 0.0 #", "yaw_rad: north #", "Expected `float`", ":18"),
    ("an alias of two places", "site.yaml", "\nroutes:", PLACE_TWICE, "names two things", ":35"),
    ("a place named twice", "site.yaml", "place_id: first_place", "place_id: home", "stands twice", ":22"),
    ("a route to nowhere", "site.yaml", "end: first_place", "end: cellar", "no place of the site", ":38"),
    (
        "a route that ends elsewhere",
        "site.yaml",
        "waypoints_m: [[0, 0], [2, 0]]",
        "waypoints_m: [[0, 0], [9, 0]]",
        "beside first_place",
        ":38",
    ),
    (
        "an unknown home",
        "site.yaml",
        "profile: {home: home",
        "profile: {home: cellar",
        "no place cellar",
        ":9",
    ),
    (
        "a place on another map",
        "site.yaml",
        "map_version: shop-1\n    approach_m: [2",
        "map_version: b\n    approach_m: [2",
        "of map b",
        ":22",
    ),
    (
        "two robots of one name",
        "robots.yaml",
        "    speed_limit_mps: 0.5\n",
        "    speed_limit_mps: 0.5\n  - {name: robot-1, kind: simulator}\n",
        "stands twice",
        ":11",
    ),
    ("a kind that there is not", "robots.yaml", "kind: http", "kind: telepathy", "telepathy", ":6"),
    (
        "an address without a scheme",
        "robots.yaml",
        "http://127.0.0.1:8765",
        "127.0.0.1:8765",
        "matching regex",
        ":7",
    ),
    (
        "a token in the file itself",
        "robots.yaml",
        "{environment: ROBOT_TOKEN}",
        "hunter2",
        "Expected `object`",
        ":8",
    ),
    (
        "evidence of a kind with an address of another",
        "robots.yaml",
        LIMIT,
        EVIDENCE.format("rosbridge", "http://a"),
        "begins with ws://",
        ":13",
    ),
    (
        "evidence by topics without topics",
        "robots.yaml",
        LIMIT,
        EVIDENCE.format("foxglove", "ws://a"),
        "names no topics",
        ":12",
    ),
    (
        "evidence by DDS in no domain",
        "robots.yaml",
        LIMIT,
        EVIDENCE.format("dds", "dds://a/b"),
        "matching regex",
        ":13",
    ),
    (
        "evidence of a program without a token",
        "robots.yaml",
        LIMIT,
        EVIDENCE.format("http", "http://a"),
        "names no token",
        ":13",
    ),
    (
        "evidence without odometry",
        "robots.yaml",
        LIMIT,
        EVIDENCE.format("rosbridge", "ws://a") + "      topics: {pose: /pose}\n",
        "odometry",
        ":14",
    ),
    (
        "a token in two places",
        "robots.yaml",
        "{environment: ROBOT_TOKEN}",
        "{environment: A, file: b}",
        "name one",
        ":8",
    ),
    (
        "a mission to nowhere",
        "missions/go-to-place.yaml",
        "default: first_place",
        "default: cellar",
        "cellar",
        ":12",
    ),
    (
        "a mission of a name that ships",
        "missions/go-to-place.yaml",
        "name: go-to-place",
        "name: circuit",
        "Another mission",
        ":3",
    ),
    (
        "a mission with half a placeholder",
        "missions/go-to-place.yaml",
        "${goal.text}",
        "${goal.text",
        "goal.text",
        ":",
    ),
]


@pytest.mark.parametrize(("file", "old", "new", "said", "line"), [one[1:] for one in BAD], ids=[one[0] for one in BAD])
def test_what_is_wrong_is_said_with_file_line_and_remedy(
    shop: Path, file: str, old: str, new: str, said: str, line: str
) -> None:
    text = (shop / file).read_text()
    assert old in text
    (shop / file).write_text(text.replace(old, new, 1))
    code, found = regen("check", str(shop))
    assert (code, found["ok"]) == (2, False)
    told = [one["text"] for one in found["problems"] if said in one["text"]]
    assert told, found["problems"]
    assert f"{file}{line}" in told[0]
    assert re.search(r":\d+[^ ]*( .+?)?[.] [a-z`].*[.]$", told[0]), "a remedy stands behind it"


def _without(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def _instead(name: str, make: Callable[[Path], object]) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        (folder / name).unlink()
        make(folder / name)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_without("robots.yaml"), "robots.yaml. write it"),
        (_without("site.yaml"), "No such file"),
        (lambda folder: (folder / "robot.yaml").write_text("robots: []\n"), "Nobody reads this file"),
        (lambda folder: (folder / "site.yaml").write_bytes(b"\xff\xfe\x00"), "cannot be read"),
        (_instead("site.yaml", lambda file: file.symlink_to("/dev/zero")), "It is no plain file"),
        (_instead("robots.yaml", os.mkfifo), "It is no plain file"),
        (_instead("site.yaml", lambda file: file.write_bytes(b"#" * 2**21)), "File too large"),
    ],
)
def test_a_missing_and_a_strange_file_are_named(shop: Path, spoil: Callable[[Path], object], said: str) -> None:
    spoil(shop)
    code, found = regen("check", str(shop))
    assert code == 2 and said in " ".join(one["text"] for one in found["problems"])


def test_a_route_through_a_wall_and_one_that_is_too_narrow_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "hall"
    write_folder(folder, map_file=floor(tmp_path / "maps"))
    text = (folder / "site.yaml").read_text()
    way = re.search(r"waypoints_m: (.*)", text)
    assert way is not None
    first, last = json.loads(way.group(1))[0], json.loads(way.group(1))[-1]
    through = json.dumps([first, [2.5, 2.0], [3.5, 2.0], last])
    (folder / "site.yaml").write_text(text.replace(way.group(1), through, 1))
    _, problems = examined(folder, reserved=SHIPPED)
    assert [one.reason.code for one in problems] == ["route_through_wall"]
    assert "site.yaml:" in str(problems[0].where)
    along = json.dumps([first, [2.8, 0.0], [2.8, 0.9], *json.loads(way.group(1))])
    (folder / "site.yaml").write_text(text.replace(way.group(1), along, 1))
    _, problems = examined(folder, reserved=SHIPPED)
    assert [one.reason.code for one in problems] == ["route_too_narrow"]


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"resolution": 50.0}, "map_resolution_odd"),
        ({"origin": [-2.0, -3.0, 0.4]}, "map_turned"),
        ({"origin": [1e9, 0.0, 0.0]}, "map_origin_odd"),
        ({"image": "nowhere.png"}, "map_unreadable"),
        ({"image": "hall.yaml"}, "map_image_unreadable"),
        ({"origin": "here"}, "map_file_invalid"),
    ],
)
def test_a_map_in_other_units_or_without_its_image_is_refused(
    tmp_path: Path, changes: dict[str, Any], code: str
) -> None:
    file = floor(tmp_path, **changes)
    with pytest.raises(ContractInvalid) as error:
        read_map(file, frame="map", map_version="a")
    assert error.value.reason.code == code
    exit_code, said = regen("init", str(tmp_path / "site"), "--from", str(file))
    assert exit_code == 2 and "Where" in said and not (tmp_path / "site").exists()


def test_a_map_file_that_unfolds_is_refused_before_anything_is_built_from_it(tmp_path: Path) -> None:
    file = floor(tmp_path)
    file.write_text(file.read_text() + "a: &a [1, 1]\nb: [*a, *a]\n")
    with pytest.raises(ContractInvalid) as error:
        read_map(file, frame="map", map_version="a")
    assert error.value.reason.code == "yaml_alias"


def test_an_image_that_promises_too_much_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    file = floor(tmp_path)
    body = bytearray((tmp_path / "hall.png").read_bytes())
    body[16:24] = (90_000).to_bytes(4, "big") * 2
    (tmp_path / "hall.png").write_bytes(bytes(body))
    with raises_saying(ContractInvalid, match="90000 x 90000"):
        read_map(file, frame="map", map_version="a")


def test_a_map_outside_of_the_folder_is_not_read(shop: Path, tmp_path: Path) -> None:
    floor(tmp_path / "elsewhere")
    text = (shop / "site.yaml").read_text().replace("# map: maps/floor.yaml", "map: ../elsewhere/hall.yaml")
    (shop / "site.yaml").write_text(text)
    _, problems = examined(shop, reserved=SHIPPED)
    assert [one.reason.code for one in problems] == ["workspace_path_outside"]


def test_evidence_of_a_robot_has_an_address_and_a_token_of_its_own(shop: Path) -> None:
    robots = shop / "robots.yaml"
    text = robots.read_text()
    evidence = "    evidence:\n      address: {}\n      token: {}\n"
    robots.write_text(text + evidence.format("http://127.0.0.1:8766", "{environment: ITS_TOKEN}"))
    code, found = regen("check", str(shop))
    assert code == 0 and [one["code"] for one in found["notes"]] == ["token_not_there", "token_not_there"]
    robots.write_text(text + evidence.format("http://127.0.0.1:8765/", "{}"))
    code, found = regen("check", str(shop))
    problems = {one["code"]: one["where"] for one in found["problems"]}
    line = len(text.splitlines()) + 2
    assert code == 2 and problems["evidence_not_apart"].endswith(f"robots.yaml:{line}")
    assert problems["secret_needs_one_place"].endswith(f"robots.yaml:{line + 1}")
