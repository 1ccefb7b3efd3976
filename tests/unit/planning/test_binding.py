"""Places by name, and the open spots of templates."""

import pytest
from msgspec.structs import replace

from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import PlaceId
from harness.planning.binding import bind_passage, bind_place, bind_route, names_in, substitute
from tests.saying import raises_saying
from tests.unit.planning.building import SITE

BOUND = {"goal": {"digest": "ab"}, "destination": {"approach_m": [1.0, 2.0], "name": "Storage"}, "count": 4.0}


@pytest.mark.ledger("R191", symbol="harness.planning.binding:bind_place")
@pytest.mark.parametrize("name", ["office_storage", "Office storage area", "THE  STORAGE", "b"])
def test_a_place_answers_to_its_id_name_and_aliases_in_any_case(name: str) -> None:
    place = bind_place(name, site=SITE)
    assert (place.place_id, place.frame, place.map_version) == ("office_storage", "map", SITE.map_version)
    assert place.provenance
    assert place.verification == "configured"


def test_an_unknown_place_is_named_with_the_nearest_one_and_all_that_exist() -> None:
    with raises_saying(UnknownName, match="“ofice storage”.*did you mean “office storage”.*anchor_a"):
        bind_place("ofice storage", site=SITE)


def test_a_name_that_two_places_share_is_refused_with_their_ids() -> None:
    twin = replace(SITE.places[1], place_id=PlaceId("cellar"))
    with raises_saying(ContractInvalid, match="2 places are called.*office_storage, cellar"):
        bind_place("the storage", site=replace(SITE, places=(*SITE.places, twin)))


def test_a_disputed_place_is_no_target() -> None:
    disputed = replace(SITE.places[0], verification="disputed")
    with raises_saying(ContractInvalid, match="disputed"):
        bind_place("anchor_a", site=replace(SITE, places=(disputed,)))


def test_a_route_is_bound_by_its_ends_and_a_missing_one_lists_those_that_exist() -> None:
    home, storage = (bind_place(name, site=SITE) for name in ("A", "B"))
    assert bind_route(home, storage, site=SITE).name == "A-B"
    assert bind_route(storage, home, site=SITE).name == "B-A"
    says = r"No route leads from office_storage to office_storage.*A-B \(anchor_a to office_storage\)"
    with raises_saying(UnknownName, match=says):
        bind_route(storage, storage, site=SITE)


def test_a_passage_belongs_to_the_place_whose_region_holds_it_and_to_no_other() -> None:
    storage = bind_place("B", site=SITE)
    far = replace(SITE.passages[0], passage_id=PlaceId("far"), floor_m=((90.0, 0.0), (91.0, 0.0), (91.0, 1.0)))
    near = bind_passage(storage, site=replace(SITE, passages=(far, *SITE.passages)))
    assert near.passage_id == "storage_passage"
    with raises_saying(UnknownName, match="No passage lies within office_storage"):
        bind_passage(storage, site=replace(SITE, passages=(far,)))
    with raises_saying(UnknownName, match="No passage lies within anchor_a"):
        bind_passage(bind_place("dock", site=SITE), site=SITE)


def test_a_spot_that_is_the_whole_value_keeps_its_type() -> None:
    filled = substitute({"target": "${destination.approach_m}", "n": ["${count}"]}, bindings=BOUND)
    assert filled == {"target": [1.0, 2.0], "n": [4.0]}


def test_a_spot_inside_a_text_becomes_text() -> None:
    assert substitute("Go to ${destination.name}, ${goal.digest}", bindings=BOUND) == "Go to Storage, ab"


def test_the_two_kinds_of_spot_do_not_mix() -> None:
    text = "${destination.name} @{analysis.text}"
    half = substitute(text, bindings=BOUND)
    assert half == "Storage @{analysis.text}"
    assert names_in(text) == {"destination"}
    assert names_in({"a": [text]}, sigil="@") == {"analysis"}


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("${nowhere.frame}", r"bound to nothing.*\$\.nodes\[0\].*bound: count, destination, goal"),
        ("${destination.colour}", r"names a field that destination lacks.*approach_m, name"),
        ("${count.part}", "names a field that count lacks"),
        ("${ destination }", "open spot that cannot be read"),
        ("to ${destination.approach_m}", "cannot stand inside a text"),
        ("${destination", "open spot that cannot be read"),
    ],
)
def test_a_spot_that_cannot_be_filled_names_its_path(value: str, says: str) -> None:
    with raises_saying(ContractInvalid, match=says):
        substitute({"nodes": [value]}, bindings=BOUND)
