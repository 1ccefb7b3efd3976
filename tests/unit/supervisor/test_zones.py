"""What a site file may authorise: a way that exists, stays on the map, ends at its place, and is begun on it only."""

from typing import Any

import pytest
from msgspec.structs import replace

from harness.baseline.load import site
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import PlaceId
from harness.contracts.places import Site, Zone
from harness.contracts.values import Point, encode
from harness.supervisor.zones import OFF_WAY_M, ahead, patience, way_of
from harness.verification.geometry import distance, polyline_length
from harness.workspace.contract_yaml import read_yaml
from tests.saying import raises_saying


def check_zones(at: Site) -> None:
    """Every zone that would retreat, as a site's folder is checked when it is read."""
    for one in at.zones:
        if one.retreat is not None or one.no_answer == "retreat":
            way_of(at, one)


def zone(name: str, at: Site) -> Zone:
    return next(one for one in at.zones if one.name == name)


def corridor(**changes: Any) -> Site:
    """The shipped site, its corridor's retreat changed."""
    shipped = site()
    found = zone("corridor", shipped)
    assert found.retreat is not None
    changed = replace(found, retreat=replace(found.retreat, **changes))
    return replace(shipped, zones=tuple(changed if one.name == "corridor" else one for one in shipped.zones))


def test_the_shipped_site_authorises_a_way_to_the_dock_from_every_zone() -> None:
    check_zones(site())
    for one in site().zones:
        way = way_of(site(), one)
        assert way.place.place_id == "anchor_a" and way.waypoints_m[-1] == way.place.approach_m
        assert way.retreat.authorised_by and way.retreat.speed_cap_mps <= 0.5


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"place_id": PlaceId("cellar")}, "does not exist"),
        ({"route": "Z-Z"}, "does not exist"),
        ({"route": "A-B"}, "beside"),
        ({"place_id": PlaceId("office_storage")}, "beside"),
    ],
)
def test_a_retreat_to_nowhere_or_by_no_way_is_refused_when_the_site_is_read(changes: Any, said: str) -> None:
    with raises_saying(ContractInvalid, match=said):
        check_zones(corridor(**changes))


def test_a_zone_that_would_retreat_without_a_way_is_refused() -> None:
    bare = tuple(replace(one, retreat=None) for one in site().zones)
    with raises_saying(ContractInvalid, match="declares no safe place"):
        check_zones(replace(site(), zones=bare))


def test_a_way_that_leaves_the_map_or_is_of_another_map_is_refused() -> None:
    shipped = site()
    routes = tuple(
        replace(one, waypoints_m=((-9.0, -9.0), *one.waypoints_m)) if one.name == "B-A" else one
        for one in shipped.routes
    )
    with raises_saying(ContractInvalid, match="leaves the map"):
        check_zones(replace(shipped, routes=routes))
    old = tuple(replace(one, map_version="site-0") for one in shipped.routes)
    with raises_saying(ContractInvalid, match="different maps"):
        check_zones(replace(shipped, routes=old))


@pytest.mark.parametrize("wrong", ["speed_cap_mps: 2.0", "speed_cap_mps: 0", "authorised_on: now", "otherwise: run"])
def test_a_site_file_with_a_senseless_retreat_is_refused_by_its_type(wrong: str) -> None:
    name = wrong.partition(":")[0]
    text = encode(site()).decode()
    current = {"speed_cap_mps": '"speed_cap_mps":0.3', "authorised_on": '"authorised_on":"2026-11-20"'}
    shown = current.get(name, '"otherwise":"lie_down"')
    assert shown in text
    value = wrong.partition(": ")[2]
    broken = f'"{name}":{value}' if name == "speed_cap_mps" else f'"{name}":"{value}"'
    with pytest.raises(ContractInvalid):
        read_yaml(text.replace(shown, broken), Site, where="site")


@pytest.mark.parametrize("at", [(5.0, 4.9), (9.0, 4.3), (1.2, 4.0), (0.9, 2.0)])
def test_only_what_lies_ahead_is_gone_and_it_begins_where_the_robot_stands(at: Point) -> None:
    way = way_of(site(), zone("corridor", site()))
    points = ahead(way, at)
    assert distance(points[0], at) <= 0.011 and points[-1] == (0.0, 0.0)
    assert polyline_length(points) < polyline_length(way.waypoints_m)
    assert set(points[2:]) <= set(way.waypoints_m)


def test_a_robot_off_the_way_gets_none() -> None:
    way = way_of(site(), zone("corridor", site()))
    assert ahead(way, (5.0, 4.75 + OFF_WAY_M + 0.05)) == ()


def test_a_question_says_where_the_robot_would_go_only_where_it_would() -> None:
    assert patience(site().zones, (5.0, 4.8), reserve_s=1e9).retreat is not None
    office = patience(site().zones, (0.0, 0.0), reserve_s=1e9)
    assert (office.no_answer, office.retreat) == ("hold", None)
