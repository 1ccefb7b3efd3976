"""Places that were changed in the console are written back to site.yaml; what nobody touched keeps its comments."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.acts.places import SavePlaceAct
from app.cli.main import app
from harness.baseline.load import workspace_in
from harness.bootstrap import edit_harness
from harness.contracts.actors import Actor
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import PlaceId
from harness.contracts.place_events import RemovePlace, place_stream
from harness.settings import HarnessSettings
from harness.workspace.new_folder import write_folder

ADA = Actor(name="ada", role="operator")


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    """A site in which somebody drew a bench, moved the first place, and nothing else."""
    folder = tmp_path / "shop"
    write_folder(folder)
    with edit_harness(HarnessSettings(data_folder=folder / "var", site_folder=folder)) as runtime:
        site = runtime.site
        stream = place_stream(site.name)
        first = SavePlaceAct.of(name="First place", x_m=2.0, y_m=0.25, aliases=["the first place"], reason="moved")
        bench = SavePlaceAct.of(name="Bench", x_m=1.0, y_m=1.0, region_m=[[0, 0], [2, 0], [2, 2]], reason="new")
        for name, act in (("first_place", first), ("bench", bench)):
            place = act.place(PlaceId(name), site, by="ada")
            runtime.decide([(stream, act.to_command(ADA, place=place))])
    return folder


def export(folder: Path, *words: str) -> tuple[int, dict[str, object]]:
    done = CliRunner().invoke(app, ["site", "export", str(folder), *words, "--json"])
    return done.exit_code, json.loads(done.stdout)


def test_the_changes_are_shown_first_and_written_on_request_with_all_comments_kept(shop: Path) -> None:
    before = (shop / "site.yaml").read_text()
    code, shown = export(shop)
    assert code == 1 and shown["written"] is False and (shop / "site.yaml").read_text() == before
    assert any("bench" in str(line) for line in shown["changes"])  # type: ignore[attr-defined]
    code, made = export(shop, "--write")
    after = (shop / "site.yaml").read_text()
    assert code == 0 and made["written"] is True
    comments = [line.partition("#")[2] for line in before.splitlines() if "#" in line]
    kept = [line.partition("#")[2] for line in after.splitlines() if "#" in line]
    assert len(comments) > 5 and [one.strip() for one in comments] == [one.strip() for one in kept]
    assert "region_m: [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]" in after
    site = workspace_in(shop).site
    assert {one.place_id: one.approach_m for one in site.places} == {
        "home": (0.0, 0.0),
        "first_place": (2.0, 0.25),
        "bench": (1.0, 1.0),
    }
    assert export(shop) == (0, {"changes": [], "written": False}), "folder and log say the same"


def test_a_place_that_was_removed_leaves_the_file(shop: Path) -> None:
    export(shop, "--write")
    with edit_harness(HarnessSettings(data_folder=shop / "var", site_folder=shop)) as runtime:
        gone = RemovePlace(actor=ADA, place_id=PlaceId("bench"), basis=1, reason="sold")
        runtime.decide([(place_stream(runtime.site.name), gone)])
    code, _ = export(shop, "--write")
    assert code == 0 and "bench" not in (shop / "site.yaml").read_text()


def test_a_route_whose_end_was_moved_away_is_named_and_nothing_is_written(shop: Path) -> None:
    with edit_harness(HarnessSettings(data_folder=shop / "var", site_folder=shop)) as runtime:
        far = SavePlaceAct.of(name="First place", x_m=5.0, y_m=0.0, aliases=["the first place"], basis=1, reason="far")
        command = far.to_command(ADA, place=far.place(PlaceId("first_place"), runtime.site, by="ada"))
        runtime.decide([(place_stream(runtime.site.name), command)])
    before = (shop / "site.yaml").read_bytes()
    done = CliRunner().invoke(app, ["site", "export", str(shop), "--write"])
    assert isinstance(done.exception, ContractInvalid) and done.exception.reason.code == "route_end_elsewhere"
    assert (shop / "site.yaml").read_bytes() == before
