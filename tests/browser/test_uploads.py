"""Several files are sent in pieces as one by the browser, and are what the console takes apart again."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from playwright.sync_api import APIResponse, Route, expect
from playwright.sync_api import Error as PlaywrightError

from tests.browser.conftest import OpenPage, TakePicture
from tests.builders.serving import Serving, serving
from tests.integration.test_uploads import floor_map


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Serving]:
    (tmp_path / "data").mkdir()
    with serving(waits=False, folder=tmp_path / "data") as one:
        yield one


def test_a_floor_map_of_two_files_is_sent_with_progress_and_becomes_the_map(
    served: Serving, open_page: OpenPage, take_picture: TakePicture, tmp_path: Path
) -> None:
    files = floor_map(tmp_path)
    page = served.enter(open_page(), "/recordings")
    page.locator("[data-upload] input[type=file]").set_input_files(list(files))
    page.locator("[data-upload] button.primary").click()
    sent = page.locator("section[id^=upload-]")
    expect(sent).to_contain_text(f"{files[0].name} +1")
    expect(sent).to_contain_text("The walls of this floor map")
    take_picture(page, "upload-of-two-files")
    (known,) = served.app.state.console.uploads.all()
    assert known.complete and known.kind == "map"
    assert known.size_bytes == sum(one.stat().st_size for one in files)
    site = served.asked.runtime.site
    sent.locator("[name=map_version]").fill(site.map_version)
    sent.locator("[name=frame]").fill(site.frame)
    sent.locator("[name=metres_per_cell]").fill("0.5")
    sent.locator("[name=reason]").fill("surveyed")
    sent.get_by_role("button", name="Import as a map").click()
    page.wait_for_url("**/recordings*")
    assert served.asked.runtime.streams("map/"), "the map version has a picture now"


def test_an_upload_that_is_cancelled_before_it_has_an_id_leaves_nothing(
    served: Serving, open_page: OpenPage, tmp_path: Path
) -> None:
    page = served.enter(open_page(), "/recordings")
    held: list[tuple[Route, APIResponse]] = []
    page.route("**/api/v1/uploads", lambda route: held.append((route, route.fetch())))
    page.locator("[data-upload] input[type=file]").set_input_files(list(floor_map(tmp_path)))
    page.locator("[data-upload] button.primary").click()
    for _ in range(600):
        if held:
            break
        page.wait_for_timeout(50)
    assert served.app.state.console.uploads.all(), "it is begun, and its page does not know its id yet"
    page.locator("[data-cancel]").click()
    with suppress(PlaywrightError):
        held[0][0].fulfill(response=held[0][1])
    expect(page.locator("[data-said]")).to_have_text("Cancelled.")
    assert served.app.state.console.uploads.all() == ()


def test_an_upload_that_is_cancelled_leaves_nothing(served: Serving, open_page: OpenPage, tmp_path: Path) -> None:
    page = served.enter(open_page(), "/recordings")
    page.route("**/api/v1/uploads/*offset=*", lambda route: None)
    page.locator("[data-upload] input[type=file]").set_input_files(list(floor_map(tmp_path)))
    page.locator("[data-upload] button.primary").click()
    page.locator("[data-cancel]").click()
    expect(page.locator("[data-said]")).to_have_text("Cancelled.")
    page.unroute_all(behavior="ignoreErrors")
    served.open(page, "/recordings")
    expect(page.locator("section[id^=upload-]")).to_have_count(0)
    assert served.app.state.console.uploads.all() == ()
