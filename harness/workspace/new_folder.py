"""Writes a new site's folder: commented YAML files with two places, the routes between them and a first mission.

Nothing is asked that can be derived: from a floor map come the places, on free floor, and a way between them.
"""

import math
import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from harness.adapters.bounded_yaml import plain_values
from harness.adapters.map_rasters import LONGEST_YAML, coarser, read_map
from harness.adapters.plain_files import plain_text
from harness.contracts.errors import ContractInvalid
from harness.contracts.exploration import FREE, GridMap
from harness.contracts.reasons import because
from harness.contracts.values import Point
from harness.exploration.grid import middle_of
from harness.exploration.paths import Ways
from harness.workspace.reading import MISSIONS, ROBOTS, SITE

CELL_M = 0.2
FAR_M = 6.0
"""How long the way to the first place is, where the floor is that large."""
NEAREST_M = 1.0
HALF_REGION_M = 0.8
MAPS = "maps"
_NO_FLOOR = ((0.0, 0.0), (2.0, 0.0))

SITE_TEXT = """\
# {name}: where robots work. `regen check {folder}` says what is wrong, with file and line.
# Metres and radians in `frame`. Robots must report the same frame and map version with their poses.
name: {name}
frame: map
map_version: {map_version}
{map_line}
# What every mission does without being asked; a goal may leave out what is removable.
profile: {{home: home, defaults: [], removable: []}}

places:
  - place_id: home
    name: Home
    aliases: [dock, base, charging station]
    frame: map
    map_version: {map_version}
    approach_m: {home} # where the body stands
    yaw_rad: 0.0 # where it looks
    region_m: {home_region}
    provenance: {provenance}
    verification: configured
  - place_id: first_place
    name: First place
    aliases: [the first place]
    frame: map
    map_version: {map_version}
    approach_m: {first}
    yaw_rad: 0.0
    region_m: {first_region}
    provenance: {provenance}
    verification: configured

routes:
  - name: home-first
    frame: map
    map_version: {map_version}
    start: home
    end: first_place
    waypoints_m: {there}
  - name: first-home
    frame: map
    map_version: {map_version}
    start: first_place
    end: home
    waypoints_m: {back}

# Floor that inspections look at, inside the region of its place:
# passages:
#   - {{passage_id: aisle_1, frame: map, floor_m: [[1.0, 1.0], [2.0, 1.0], [2.0, 3.0], [1.0, 3.0]]}}

# How long a robot waits for a person in a region, and what it does then (hold, lie_down or retreat):
# zones:
#   - {{name: hall, frame: map, region_m: [[-5, -5], [5, -5], [5, 5], [-5, 5]], no_answer: hold, hold_limit_s: 900.0}}
"""

ROBOTS_TEXT = """\
# The robots of this site. A robot is used once the conformance kit passed at its address:
#   regen provider check NAME --site {folder} --allow-motion
# Secrets never stand here: `token` names a variable of the environment, or a file in this folder.
robots:
  - name: {robot}
    kind: http # it serves the provider protocol (docs/how-to/write-a-provider.md)
    address: {address}
    token: {{environment: {variable}}}
    footprint_m: [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]
    speed_limit_mps: 0.5
"""

MISSION_TEXT = """\
# Go to a place and stand there: the first mission of this site, started by `regen mission run go-to-place`.
# A mission is a task template: `${{name.field}}` is bound when it is started; every condition is tested on evidence.
name: go-to-place
version: "1"
title: Go to a place
goal: Go to the first place
phrases: [go to a place]
serves:
  - {{act: go, object: place, parameter: destination}}
  - {{act: return, object: place, parameter: destination}}
parameters:
  - {{name: destination, type: place, title: Place to go to, default: first_place}}
  - {{name: home, type: place, title: Place to start from, default: home}}
"""
_SHIPPED_MISSION = Path(__file__).parents[1] / "baseline" / "site" / "missions" / "go-to-place.yaml"


def write_folder(folder: Path, *, name: str = "", map_file: Path | None = None, address: str = "") -> tuple[Path, ...]:
    """Write the folder and return its files. Raises ContractInvalid where it holds something, or for a bad map."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ContractInvalid(because("folder_not_empty"), where=str(folder))
    title = name or re.sub(r"[^a-z0-9-]+", "-", folder.absolute().name.lower()).strip("-") or "site"
    floor = read_map(map_file, frame="map", map_version=f"{title}-1") if map_file else None
    there = _way(floor, map_file) if floor and map_file else _NO_FLOOR
    (folder / MISSIONS).mkdir(parents=True)
    copied = _copy_map(folder, map_file) if map_file else ""
    facts = {
        "name": title,
        "folder": folder,
        "map_version": f"{title}-1",
        "map_line": f"map: {copied}\n"
        if copied
        else "# map: maps/floor.yaml # a map_server map: places and routes are then checked against its walls\n",
        "provenance": "chosen on the floor map" if copied else "measured by hand",
        "home": _point(there[0]),
        "first": _point(there[-1]),
        "home_region": _square(there[0]),
        "first_region": _square(there[-1]),
        "there": _points(there),
        "back": _points(there[::-1]),
        "robot": "robot-1",
        "address": address or "http://127.0.0.1:8765",
        "variable": "ROBOT_TOKEN",
    }
    texts: Mapping[Path, str] = {
        folder / SITE: SITE_TEXT.format(**facts),
        folder / ROBOTS: ROBOTS_TEXT.format(**facts),
        folder / MISSIONS / "go-to-place.yaml": MISSION_TEXT.format() + _rest_of_mission(),
        folder / ".gitignore": "var/\nsecrets/\n",
    }
    for file, text in texts.items():
        file.write_text(text, encoding="utf-8")
    return tuple(texts)


def _rest_of_mission() -> str:
    """Stages and conditions as they ship: one source, so that a new folder starts with what is tested."""
    text = _SHIPPED_MISSION.read_text(encoding="utf-8")
    return text[text.index("constraints:") :]


def _copy_map(folder: Path, map_file: Path) -> str:
    """The map's two files inside the folder, so that it can be moved as a whole."""
    (folder / MAPS).mkdir()
    named = plain_values(plain_text(map_file, most_bytes=4 * LONGEST_YAML), where=str(map_file))
    image = map_file.parent / str(named["image"])
    shutil.copyfile(image, folder / MAPS / image.name)
    named["image"] = image.name
    (folder / MAPS / "floor.yaml").write_text(yaml.safe_dump(named, sort_keys=False), encoding="utf-8")
    return f"{MAPS}/floor.yaml"


def _way(floor: GridMap, file: Path) -> tuple[Point, ...]:
    """From free floor near the map's origin to free floor that can be reached from there, clear of walls.

    Raises ContractInvalid for a map without room for that.
    """
    coarse = coarser(floor, cell_m=CELL_M)
    free = [index for index, value in enumerate(coarse.cells) if value == FREE]
    middles = sorted(
        (middle_of(coarse, divmod(index, coarse.columns)) for index in free), key=lambda one: math.dist(one, (0.0, 0.0))
    )
    for home in middles[:: max(1, len(middles) // 50)]:
        ways = Ways(coarse, home)
        reached = [(cell, length_m) for cell, length_m in ways.reached() if length_m >= NEAREST_M]
        if reached:
            cell, _ = min(reached, key=lambda one: (abs(one[1] - FAR_M), one[0]))
            route = ways.route_m(middle_of(coarse, cell))
            return tuple((round(x, 2), round(y, 2)) for x, y in route)
    raise ContractInvalid(because("map_without_room"), where=str(file))


def _point(point: Point) -> str:
    return f"[{point[0]:g}, {point[1]:g}]"


def _points(points: Sequence[Point]) -> str:
    return f"[{', '.join(map(_point, points))}]"


def _square(middle: Point) -> str:
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return _points([(middle[0] + x * HALF_REGION_M, middle[1] + y * HALF_REGION_M) for x, y in signs])
