"""The console in Chinese, in a browser: chosen without scripts, kept, live, and with the scripts' own words."""

import re

from playwright.sync_api import expect

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.serving import VIEWER, serving


def test_a_reader_switches_to_chinese_and_back_without_scripts_and_stays_on_the_page(open_page: OpenPage) -> None:
    with serving() as served:
        page = served.enter(open_page(scripts=False), "/missions?status=waiting")
        expect(page.locator("h1")).to_have_text("Missions")
        page.get_by_role("link", name="简体中文").click()
        expect(page.locator("h1")).to_have_text("任务")
        assert "status=waiting" in page.url
        expect(page.locator("html")).to_have_attribute("lang", "zh-Hans")
        served.open(page, "/handoffs")
        expect(page.locator("h1")).to_have_text("交接")
        page.get_by_role("link", name="English").click()
        expect(page.locator("h1")).to_have_text("Handoffs")


def test_a_chinese_operator_reads_the_question_decides_and_follows(
    open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    console_watch.expect(VIEWER)
    with serving() as served:
        page = open_page()
        page.set_extra_http_headers({"Accept-Language": "zh-CN,zh;q=0.9,en;q=0.4"})
        served.enter(page)
        expect(page.locator("h1")).to_have_text("总览")
        take_picture(page, "overview-chinese")
        served.open(page, f"/handoffs/{served.asked.handoff_id}")
        expect(page.locator("h1")).to_contain_text("无法完成")
        expect(page.locator(".callout").first).to_contain_text("若无人回答")
        expect(page.locator(".countdown")).to_have_text(re.compile("剩余 .*分"))
        take_picture(page, "handoff-chinese")
        page.get_by_role("button", name="不安全").click()
        page.locator("#reject").click()
        expect(page.locator(".steps")).to_contain_text("已拒绝")
        answer = served.asked.handoff.answer
        assert answer is not None and answer.reason == "not safe", "what is kept does not depend on a language"
        served.asked.run()
        served.open(page, f"/missions/{served.asked.mission_id}")
        expect(page.locator("#events")).to_contain_text("任务结束")
        take_picture(page, "mission-chinese")
