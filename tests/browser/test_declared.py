"""A mission that is verified in part only, on its page, in the list and in its report: wide and narrow, light and
dark."""

from typing import Literal

from playwright.sync_api import expect

from harness.contracts.decisions import Accepted
from harness.runtime import Start
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.browser.test_accessible import found
from tests.builders.declared import DESCRIBED, ORDER, two_pictures
from tests.builders.missions_run import ROBOT
from tests.builders.serving import serving
from tests.builders.waiting import ADA

LOOKS: tuple[tuple[Literal["light", "dark"], int], ...] = (("light", 1280), ("dark", 1280), ("light", 390))


def test_what_is_declared_stands_apart_from_what_is_accepted(
    open_page: OpenPage, take_picture: TakePicture, console_watch: ConsoleWatch
) -> None:
    with serving(waits=False, rules=2) as served:
        template = two_pictures(goals=(ORDER, DESCRIBED))
        begun = served.asked.runtime.start(
            Start(actor=ADA, robot_id=ROBOT, template=template.name, seed=3), template=template
        )
        assert isinstance(begun, Accepted), begun
        mission_id = served.asked.runtime.missions()[0].mission_id
        assert served.run(mission_id) == "partly_verified"
        page = served.enter(open_page(), f"/missions/{mission_id}")
        for scheme, width in LOOKS:
            page.emulate_media(color_scheme=scheme)
            page.set_viewport_size({"width": width, "height": 800})
            served.open(page, f"/missions/{mission_id}")
            stage = page.locator("#stage-describe")
            expect(stage).to_contain_text("nothing: declared only")
            expect(page.locator("#head .sentence")).to_contain_text("Partly verified")
            expect(page.locator("body")).not_to_contain_text("Goal met")
            take_picture(page, f"declared-mission-{scheme}-{width}")
            served.open(page, f"/missions/{mission_id}/report")
            expect(page.get_by_role("heading", name="Unverified parts")).to_be_visible()
            expect(page.locator("body")).not_to_contain_text("Goal met")
            take_picture(page, f"declared-report-{scheme}-{width}")
            served.open(page, "/missions?status=partly_verified")
            expect(page.locator("#list")).to_contain_text("partly verified")
            take_picture(page, f"declared-list-{scheme}-{width}", whole=False)
        for path in (f"/missions/{mission_id}", f"/missions/{mission_id}/report"):
            assert found(served, page, path) == []
