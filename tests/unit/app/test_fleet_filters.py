"""The filters above the list of the fleet."""

from app.views.fleet import FleetFilter, fleet_page, fleet_region
from app.views.shell import NOBODY
from harness.baseline.load import shipped_workspace


def test_a_process_without_a_name_is_no_choice_of_its_own() -> None:
    region = fleet_region((), shipped_workspace().site, FleetFilter(), query="")
    page = fleet_page(region, NOBODY, FleetFilter(worker="hall-b"), workers=["", "hall-b"])
    assert [(one.value, one.chosen) for one in page.workers] == [("", False), ("hall-b", True)]
