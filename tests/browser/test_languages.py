"""The console in Chinese, in a browser: chosen without scripts, kept, live, with the scripts' own words, and whole."""

import json
import re
from collections.abc import Iterator
from functools import partial
from typing import Any

from msgspec.structs import replace
from playwright.sync_api import Page, expect

from app.auth.permissions import Principal
from rsi_reviews.acceptance import accepted
from rsi_reviews.release_service import ReleaseService
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.releases import PREDICATE, Bench, candidate, routed
from tests.builders.serving import Serving, hold, serving

CHINESE = {"Accept-Language": "zh-CN,zh;q=0.9,en;q=0.4"}
PASSWORD = "seven green bottles"
PHONE = 390
NARROW = ("/candidates/{canary}", "/releases", "/places", "/memory", "/own-missions", "/own-robots")
"""Pages with the longest words and the widest tables."""
WATCHING = (
    "/", "/missions", "/missions?status=waiting", "/missions/{ended}", "/missions/{ended}/report",
    "/missions/{ended}/log", "/missions/{asking}", "/missions/{asking}/report", "/missions/{asking}/log",
    "/missions/{asking}/stop", "/missions/new", "/missions/new?rerun_of={ended}", "/handoffs", "/handoffs/{handoff}",
    "/handoffs/{handoff}/shown", "/alerts", "/alerts?status=all", "/robots", "/robots/vbot-1", "/robots/vbot-1/drive",
    "/robots/stop", "/queue", "/nowhere",
)  # fmt: skip
DEEP = (
    "/evidence", "/providers", "/places", "/places/new", "/places/anchor_a/edit", "/memory",
    "/routes/new", "/routes/circuit/edit", "/own-missions", "/own-missions/new", "/own-missions/camera-report/edit",
    "/own-robots", "/own-robots/new", "/shadow", "/fleet", "/recordings",
    "/memory?role=episodic&everything=true", "/memory?role=operational", "/memory?role=semantic",
    "/memory?subject=nobody", "/audit?verify=true&everything=true", "/audit?actor=nobody",
    "/missions/{ended}?node=panorama", "/missions/{asking}?node=circuit",
)  # fmt: skip
REVIEWING = (
    "/candidates", "/candidates?q=nothing-like-it", "/candidates/new", "/candidates/new?by=text",
    "/candidates/new?knobs=recovery.wait_s", "/candidates?status=refused", "/candidates/{now}",
    "/candidates/{now}/rollback", "/candidates/{canary}", "/candidates/{canary}/cases", "/candidates/{canary}/replay",
    "/candidates/{canary}/rollback", "/candidates/{review}", "/candidates/{review}/rollback", "/candidates/{draft}",
    "/releases", "/releases?at=2026-11-20T09:30:00Z", "/releases?at=never", "/evaluation",
    "/evaluation?measure=success",
)  # fmt: skip
ADMINISTERING = ("/account", "/account/people", "/audit/access?verify=true", "/audit/access?actor=nobody")
WORDS = """async (paths) => {
  const apart = "script,style,pre,code,kbd,textarea,.mono,[data-recorded],[lang]:not(html)", found = [];
  for (const path of paths) {
    const answer = await fetch(path), page = new DOMParser().parseFromString(await answer.text(), "text/html");
    const texts = [page.title], walker = page.createTreeWalker(page.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
      if (!walker.currentNode.parentElement.closest(apart)) texts.push(walker.currentNode.textContent);
    }
    for (const one of page.querySelectorAll("[title],[aria-label],[placeholder],[alt]")) {
      if (one.closest(apart)) continue;
      texts.push(...["title", "aria-label", "placeholder", "alt"].map((name) => one.getAttribute(name) ?? ""));
    }
    const links = [...page.querySelectorAll("main a[href]")].map((one) => one.getAttribute("href"));
    found.push({path, status: answer.status, language: page.documentElement.lang, texts, links});
  }
  return found;
}"""
"""Every text of pages that reaches a reader, and where each page leads. Code, identifiers and records stand apart."""
_WORD = r"[A-Za-z][A-Za-z'’]*"
PROSE = re.compile(rf"(?<![\w.-]){_WORD}(?: {_WORD})+(?![\w-])")
"""Two words, one after the other, of a language that is written with this alphabet."""


def recorded(served: Serving) -> list[str]:
    """What people said and what they call things, as it was written; the longest first."""
    runtime = served.asked.runtime
    events = (json.loads(one.body) for one in runtime.log(0, runtime.head().position))
    site = runtime.site
    names = [word for place in site.places for word in (place.name, *place.aliases, place.provenance)]
    names += [zone.retreat.authorised_by for zone in site.zones if zone.retreat]
    names += [one.title() for one in site.wake_phrases]
    slugs = (*(one.place_id for one in site.places), *(one.passage_id for one in site.passages))
    said = {*names, *(one.replace("_", " ") for one in slugs), *(text for event in events for text in _reasons(event))}
    said |= {text.rstrip(".") for text in said}
    return sorted((one for one in said if PROSE.search(one)), key=len, reverse=True)


def _reasons(value: Any) -> Iterator[str]:
    """Everything that somebody gave as a reason or an intention, and the speech that was heard in the room."""
    if isinstance(value, dict):
        if isinstance(heard := value.get("heard"), str):
            yield heard
        if value.keys() & {"actor", "author"}:
            written = (value.get(name) for name in ("reason", "intended_effect"))
            yield from (text for text in written if isinstance(text, str))
        for one in value.values():
            yield from _reasons(one)
    elif isinstance(value, list):
        for one in value:
            yield from _reasons(one)


def prose(page: Page, paths: list[str], known: list[str]) -> tuple[list[str], list[str]]:
    """Where a page of these speaks English, and every address that they lead to."""
    wrong, links = [], []
    for one in page.evaluate(WORDS, paths):
        assert one["language"] in ("zh-Hans", ""), one["path"]
        assert one["status"] == (404 if one["path"] == "/nowhere" else 200), one["path"]
        links += one["links"]
        for text in one["texts"]:
            left = " ".join(text.split())
            for said in known:
                left = left.replace(said, "…")
            wrong += [f"{one['path']}: {left[:160]}"] if PROSE.search(left) else []
    return list(dict.fromkeys(wrong)), links


def too_wide(served: Serving, page: Page, paths: list[str]) -> list[str]:
    """Pages that a phone would have to scroll sideways."""
    page.set_viewport_size({"width": PHONE, "height": 844})
    widths = {path: served.open(page, path).evaluate("document.documentElement.scrollWidth") for path in paths}
    return [f"{path} is {width} px wide" for path, width in widths.items() if width > PHONE]


def named(served: Serving, bench: Bench) -> dict[str, str]:
    """What addresses name: missions, a handoff, and a candidate in every state that has a page of its own."""
    now = bench.current(routed())
    current = bench.releases.candidate(now).configuration
    stated = {"component": "routing", "baseline": bench.releases.current(), "rollback": bench.releases.current()}
    made = [
        candidate(replace(current, routing=replace(current.routing, history=share)), **stated)
        for share in (0.8, 0.7, 0.3)
    ]
    canary, review, draft = bench.in_canary(made[0], look=2), bench.in_review(made[1], look=3), bench.proposed(made[2])
    bench.mission()
    served.asked.asked()
    served.app.state.alert_watch.follow()
    return {
        "ended": served.ended, "asking": served.asked.mission_id, "handoff": served.asked.handoff_id,
        "now": now, "canary": canary, "review": review, "draft": draft,
    }  # fmt: skip


def test_no_page_of_the_console_speaks_english_to_a_chinese_reader_or_is_too_wide_for_their_phone(
    open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    console_watch.expect("401|404")  # the open page loses its session with the first account
    with serving(finished=True, waits=False) as served:
        releases = ReleaseService(served.asked.runtime, judge=partial(accepted, predicate=PREDICATE))
        names = named(served, Bench(harness=served.asked.harness, releases=releases))
        page = open_page()
        page.set_extra_http_headers(CHINESE)
        served.enter(page)
        known = recorded(served)
        paths = [path.format(**names) for path in (*WATCHING, *DEEP, *REVIEWING, "/account", "/account/people")]
        wrong, links = prose(page, paths, known)
        further = [
            next(link for link in links if re.search(pattern, link))
            for pattern in ("/facts/", "/events/", "^/alerts/.", "/about$")
        ]
        wrong += prose(page, further, known)[0]
        wrong += too_wide(served, page, [*further, *(path.format(**names) for path in NARROW)])
        by = Principal(name="setup", roles=("admin",), source="test")
        accounts = served.app.state.sessions.accounts
        accounts.add("ada", roles=["admin", "reviewer"], password=PASSWORD, by=by)
        accounts.add("bob", roles=["viewer"], password=PASSWORD, by=by)
        accounts.issue("dock", scopes=["read"], robot_id="", by=by)
        served.open(page, "/account/sign-in")
        wrong += prose(page, ["/account/sign-in"], known)[0]
        page.locator('input[name="name"]').fill("ada")
        page.locator('input[name="password"]').fill(PASSWORD)
        page.locator('input[name="password"]').press("Enter")
        page.wait_for_url(re.compile(r"/$"))
        wrong += prose(page, list(ADMINISTERING), known)[0]
        assert wrong == []


def test_english_that_is_left_on_a_page_is_found(open_page: OpenPage) -> None:
    with serving(waits=False) as served:
        page = served.enter(open_page())
        page.set_extra_http_headers(CHINESE)
        path = "/candidates"
        assert prose(page, [path], [])[0] == []
        page.route(
            "**/candidates",
            lambda route: route.fulfill(
                body='<html lang="zh-Hans"><body><main title="no way out"><p>变更 left in English here</p>'
                "<p>变更 <code>left in code here</code> <i data-recorded>as he said it</i> 没有</p></main></body>",
                content_type="text/html; charset=utf-8",
            ),
        )
        found = prose(page, [path], [])[0]
        assert sorted(found) == ["/candidates: no way out", "/candidates: 变更 left in English here"]


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
    with serving() as served:
        page = open_page()
        page.set_extra_http_headers(CHINESE)
        served.enter(page)
        expect(page.locator("h1")).to_have_text("总览")
        take_picture(page, "overview-chinese")
        served.open(page, f"/handoffs/{served.asked.handoff_id}")
        expect(page.locator("h1")).to_contain_text("无法完成")
        expect(page.locator(".callout").first).to_contain_text("若无人回答")
        expect(page.locator(".countdown")).to_have_text(re.compile("剩余 .*分"))
        take_picture(page, "handoff-chinese")
        page.get_by_role("button", name="不安全").click()
        hold(page, "#reject")
        expect(page.locator(".steps")).to_contain_text("已拒绝")
        answer = served.asked.handoff.answer
        assert answer is not None and answer.reason == "not safe", "what is kept does not depend on a language"
        served.asked.run()
        served.open(page, f"/missions/{served.asked.mission_id}")
        expect(page.locator("#events")).to_contain_text("任务结束")
        take_picture(page, "mission-chinese")
