"""The places editor: what people add or change is what new missions are compiled with, and nothing else."""

from collections.abc import Iterator

import msgspec
import pytest
from fastapi.testclient import TestClient

from app.acts.places import SavePlaceAct
from app.i18n.reasons.rendering import sentence
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.ids import PlaceId
from harness.contracts.place_events import SavePlace, place_stream
from harness.contracts.tasks import TaskContract
from harness.projections.mission import required_contract
from tests.builders.consoles import Stand, console_stand

ADA = Actor(name="ada", role="operator")
DOCK = {
    "place_id": "dock_1", "name": "Loading dock", "aliases": "ramp, bay two", "x": "2.5", "y": "-1", "heading": "90",
    "region": "2, -2; 3, -2; 3, 0", "verification": "configured", "reason": "new ramp", "basis": "0",
}  # fmt: skip


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def names(stand: Stand) -> list[str]:
    return [str(one.place_id) for one in stand.harness.runtime.site.places]


def as_it_ships(stand: Stand, place_id: str) -> dict[str, str]:
    place = stand.harness.runtime.shipped_place(PlaceId(place_id))
    assert place is not None
    region = "; ".join(f"{x}, {y}" for x, y in place.region_m)
    return {
        "name": place.name, "aliases": ", ".join(place.aliases), "x": str(place.approach_m[0]),
        "y": str(place.approach_m[1]), "heading": "0", "region": region, "verification": "verified",
        "reason": "measured", "basis": "0",
    }  # fmt: skip


@pytest.mark.ledger("R191", symbol="app.acts.places:SavePlaceAct.place")
def test_a_place_keeps_everything_that_was_entered(stand: Stand, operator: TestClient) -> None:
    assert operator.post("/places/new", data=DOCK).status_code == 303
    place = stand.harness.runtime.site.places[-1]
    assert (place.place_id, place.name, place.aliases) == ("dock_1", "Loading dock", ("ramp", "bay two"))
    assert (place.approach_m, place.region_m) == ((2.5, -1.0), ((2.0, -2.0), (3.0, -2.0), (3.0, 0.0)))
    assert (place.frame, place.map_version) == (
        stand.harness.runtime.site.frame,
        stand.harness.runtime.site.map_version,
    )
    assert (place.verification, place.provenance) == ("configured", "entered by operator")
    assert place.yaw_rad == pytest.approx(1.5708, abs=1e-4)
    assert "ramp, bay two" in operator.get("/places").text


@pytest.mark.ledger("R193", symbol="harness.projections.places:changed_site")
def test_a_new_place_is_offered_to_missions_and_changes_no_contract(stand: Stand, operator: TestClient) -> None:
    def compiled() -> TaskContract:
        return required_contract(stand.harness.runtime.mission(stand.created()))

    before = compiled()
    assert operator.post("/places/new", data=DOCK).status_code == 303
    assert compiled() == before
    assert '<option value="dock_1"' in sentence(operator.get("/missions/new?template=warehouse-inspection").text)


def test_a_mission_keeps_the_places_it_was_compiled_with(stand: Stand, operator: TestClient) -> None:
    runtime = stand.harness.runtime
    old = runtime.mission(stand.created())
    moved = {**as_it_ships(stand, "office_storage"), "x": "1.25", "y": "0.75"}
    assert operator.post("/places/office_storage/edit", data=moved).status_code == 303
    new = runtime.mission(stand.created())

    def at(mission: object) -> tuple[float, float]:
        site = runtime.site_of(mission)  # type: ignore[arg-type]
        return next(one.approach_m for one in site.places if one.place_id == "office_storage")

    assert at(new) == (1.25, 0.75)
    assert at(old) != (1.25, 0.75)
    assert required_contract(old).bindings["destination"]["approach_m"] == list(at(old))


def test_two_tabs_on_one_place_the_second_is_refused_and_keeps_what_was_typed(
    stand: Stand, operator: TestClient
) -> None:
    first = {**as_it_ships(stand, "office_storage"), "aliases": "first"}
    second = {**first, "aliases": "second"}
    assert operator.post("/places/office_storage/edit", data=first).status_code == 303
    answer = operator.post("/places/office_storage/edit", data=second)
    assert answer.status_code == 409
    assert "changed meanwhile" in answer.text
    assert 'value="second"' in answer.text
    (place,) = [one for one in stand.harness.runtime.site.places if one.place_id == "office_storage"]
    assert place.aliases == ("first",)
    assert operator.post("/places/office_storage/edit", data={**second, "basis": "1"}).status_code == 303
    page = operator.get("/places/office_storage/edit").text
    assert "(first)" in page, "every version is kept"
    assert "(second)" in page


def test_a_removed_place_is_named_by_no_new_mission_and_comes_back_as_it_was(
    stand: Stand, operator: TestClient
) -> None:
    operator.post("/places/new", data=DOCK)
    removed = operator.post("/places/dock_1/remove", data={"basis": "1", "reason": "ramp is closed"})
    assert removed.status_code == 303
    assert "dock_1" not in names(stand)
    assert operator.post("/places/dock_1/remove", data={"basis": "1", "reason": "again"}).status_code == 409
    page = operator.get("/places/dock_1/edit").text
    assert 'value="Loading dock"' in page
    assert operator.post("/places/dock_1/edit", data={**DOCK, "basis": "2", "reason": "open again"}).status_code == 303
    assert "dock_1" in names(stand)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("place_id", "Dock 1"), ("place_id", "office_storage"), ("name", ""), ("aliases", "office storage area"),
        ("x", "east"), ("y", "inf"), ("heading", ""), ("region", "1, 2; 3, 4"), ("region", "1; 2; 3"),
        ("verification", "seen"), ("reason", ""),
    ],
)  # fmt: skip
def test_a_wrong_field_is_told_beside_it_and_nothing_is_saved(
    stand: Stand, operator: TestClient, field: str, value: str
) -> None:
    known = names(stand)
    taken = next(one.name for one in stand.harness.runtime.site.places if one.place_id == "office_storage")
    typed = {**DOCK, field: taken if value == "office storage area" else value}
    answer = operator.post("/places/new", data=typed)
    assert answer.status_code == 422
    assert 'id="errors"' in answer.text
    assert f'id="wrong-{field}"' in answer.text or field == "verification"
    assert names(stand) == known


def test_a_place_off_the_map_is_told_beside_its_field_and_refused_by_the_gate(
    stand: Stand, operator: TestClient
) -> None:
    far = operator.post("/places/new", data={**DOCK, "x": "1e9"})
    assert far.status_code == 422 and 'id="wrong-x"' in far.text and "from -100000 to 100000" in far.text
    site = stand.harness.runtime.site
    place = SavePlaceAct(name="Far", x_m=1.0, y_m=0.0, reason="new").place(PlaceId("far"), site, by="ada")
    asked = SavePlace(place=msgspec.structs.replace(place, approach_m=(1e9, 0.0)), basis=0, actor=ADA, reason="new")
    decision = stand.harness.runtime.decide([(place_stream(site.name), asked)])
    assert isinstance(decision, Refused)
    assert "dock_1" not in names(stand) and "far" not in names(stand)


def test_a_route_that_ends_elsewhere_is_told(operator: TestClient, stand: Stand) -> None:
    moved = {**as_it_ships(stand, "office_storage"), "x": "1.25", "y": "0.75"}
    operator.post("/places/office_storage/edit", data=moved)
    assert "survey it again" in operator.get("/places/office_storage/edit").text
