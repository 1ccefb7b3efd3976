"""Where an exploring mission looks next, watched while it chooses: live, on a phone, in Chinese, under axe."""

import re

from playwright.sync_api import expect

from harness.baseline.load import shipped_workspace
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId
from harness.planning.templates import by_name
from harness.projections.exploration import decisions
from harness.runtime import Start
from tests.browser.conftest import OpenPage, TakePicture
from tests.browser.test_accessible import found
from tests.builders.missions_run import ROBOT
from tests.builders.serving import Serving, serving
from tests.builders.waiting import ADA

ENGLISH = re.compile(r"[A-Za-z]{4,}(?: [A-Za-z]{2,}){2,}")
"""Three words of it in a row."""


def begun(served: Serving) -> MissionId:
    """An exploration that nothing has run yet."""
    start = Start(actor=ADA, robot_id=ROBOT, template="exploration", seed=3)
    decision = served.asked.runtime.start(start, template=by_name("exploration", shipped_workspace().missions))
    assert isinstance(decision, Accepted), decision
    return served.asked.runtime.missions()[0].mission_id


def test_targets_appear_on_the_open_page_as_they_are_chosen(open_page: OpenPage, take_picture: TakePicture) -> None:
    with serving(waits=False) as served:
        mission_id = begun(served)
        path = f"/missions/{mission_id}/exploration"
        page = served.enter(open_page(), path)
        expect(page.locator("#choices")).to_contain_text("has chosen no target")
        page.evaluate("document.body.dataset.loaded = 'once'")
        assert served.run(mission_id) == "succeeded"
        made = decisions(served.asked.runtime.mission(mission_id))
        last = page.get_by_role("link", name=re.compile(rf"^{len(made)}\. \("))
        expect(last).to_be_visible()
        expect(page.locator("body")).to_have_attribute("data-loaded", "once")
        expect(page.get_by_role("heading", name=f"Why target {len(made)}")).to_be_visible()
        expect(page.locator("svg.explored circle.edge[data-chosen]")).to_have_count(1)
        take_picture(page, "exploration")
        page.get_by_role("link", name=re.compile(r"^1\. \(")).click()
        expect(page.get_by_role("heading", name="Why target 1")).to_be_visible()
        assert found(served, page, path) == []
        take_picture(page, "exploration-phone-dark")
        page.get_by_role("link", name="简体中文").click()
        served.open(page, path)
        expect(page.get_by_role("heading", level=1)).to_contain_text("探索")
        said = page.locator("#choices").inner_text()
        assert ENGLISH.findall(said) == []
