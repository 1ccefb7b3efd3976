"""Candidates, reviews and releases through the console: what the pages show, who may say what, and what follows."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest
from fastapi.testclient import TestClient

from app.background.evaluations import EvaluationCache
from app.background.release_watch import ReleaseWatch
from app.settings import ConsoleSettings
from harness.contracts.ids import Digest
from harness.contracts.values import encode
from rsi_reviews.acceptance import accepted
from rsi_reviews.contracts import Candidate
from rsi_reviews.regression.results import ResultsFile
from rsi_reviews.release_service import ReleaseService
from tests.builders.consoles import Stand, console_stand
from tests.builders.people import PASSWORD, SETTING_UP, browser, everybody
from tests.builders.releases import (
    CASES,
    PREDICATE,
    RELEASER,
    REVIEWER,
    Bench,
    candidate,
    evaluation,
    expect,
    result,
    routed,
    say,
    terms_of,
    tried,
)

BOUND = ("key", "cycle", "subject")


@dataclass(frozen=True)
class ReleaseConsole:
    """A console, its people by role, and its release service."""

    stand: Stand
    bench: Bench
    people: dict[str, TestClient]

    def page(self, who: str, path: str) -> str:
        answer = self.people[who].get(path)
        assert answer.status_code == 200, answer.text
        return answer.text

    def bound(self, who: str, name: str) -> dict[str, str]:
        """What the form of this person's page carries."""
        text = self.page(who, f"/candidates/{name}")
        return {field: re.findall(rf'name="{field}"\s+value="([^"]*)"', text)[0] for field in BOUND}

    def said(self, who: str, name: str, word: str, **typed: str) -> tuple[int, str]:
        """One word from this person's own page: status, and the page that comes back."""
        fields = {**self.bound(who, name), "reason": f"{word}, because", **typed}
        answer = self.people[who].post(f"/candidates/{name}/{word}", data=fields)
        return answer.status_code, answer.text

    def status(self, name: str) -> str:
        return self.bench.releases.review(name).status


@pytest.fixture
def console() -> Iterator[ReleaseConsole]:
    with console_stand() as stand:
        releases = ReleaseService(stand.harness.runtime, judge=partial(accepted, predicate=PREDICATE))
        people = everybody(stand)
        accounts = stand.app.state.sessions.accounts
        accounts.add("the-other-reviewer", roles=["reviewer"], password=PASSWORD, by=SETTING_UP)
        people["other-reviewer"] = browser(stand, "the-other-reviewer")
        accounts.add("lea", roles=["operator", "reviewer", "releaser"], password=PASSWORD, by=SETTING_UP)
        people["author"] = browser(stand, "lea")
        yield ReleaseConsole(stand, Bench(harness=stand.harness, releases=releases), people)


def shows(text: str, *parts: str) -> None:
    """Every part stands on the page's own content, each behind the one before."""
    place = text.find("<main")
    for part in parts:
        place = text.find(part, place)
        assert place >= 0, f"{part!r} does not come next"


def test_the_board_keeps_search_and_filters_in_the_address(console: ReleaseConsole) -> None:
    waits, draft = console.bench.in_review(candidate()), console.bench.proposed(routed())
    text = console.page("viewer", "/candidates")
    assert waits in text and draft in text and "in review" in text
    only = console.page("viewer", "/candidates?status=draft")
    assert draft in only and waits not in only
    found = console.page("viewer", "/candidates?component=recovery&q=sooner")
    assert waits in found and draft not in found
    assert 'hx-get="/candidates/list?q=sooner&amp;component=recovery"' in found
    assert console.people["viewer"].get("/candidates?status=nonsense").status_code == 404


def test_the_review_page_tells_what_got_worse_first_and_everything_a_reviewer_needs(console: ReleaseConsole) -> None:
    name = console.bench.in_review(candidate())
    text = console.page("viewer", f"/candidates/{name}")
    shows(text, "Pass to fail", "Fail to pass", "Paired differences", "Held-out, apart", "clause by clause",
          "The change, by component", "The raw difference", "Your decision", "Missions that led to it",
          "Counterfactual replay",
          "Who is pinned to what", "Rollback target", "What a release changes", "Discussion")  # fmt: skip
    shows(text, "resource conflict", "<svg", "better by")
    assert "loaded just now and keeps its name" in text
    assert text.count('data-verdict="satisfied"') >= 4
    assert "10.0" in text and "recovery.wait_s" in text
    assert text.index("The change<") < text.index("Why:") < text.index("Paired differences"), "in words, before numbers"
    assert re.search(r"How long a free step waits[^<]*</span>\s*<del>20\.0 s</del> → <ins>10\.0 s</ins>", text)
    assert text.count('class="tick-label"') >= 4, "an axis with ticks and its name"
    chinese = console.people["viewer"].get(f"/candidates/{name}?lang=zh-Hans").text
    assert "1970" not in chinese


def test_a_case_that_got_worse_is_listed_before_those_that_got_better(console: ReleaseConsole) -> None:
    made = candidate()
    name = console.bench.proposed(made)
    expect(console.bench.releases.begin(terms_of(made), say(RELEASER)))
    found = evaluation(made)
    own = made.configuration.configuration_id
    cases = sorted({one.case for one in found.results.results})
    fails = {(cases[0], own), (cases[1], made.baseline)}
    results = tuple(
        msgspec.structs.replace(one, verified_completion=0.0, status="awaiting_human")
        if (one.case, one.configuration) in fails
        else one
        for one in found.results.results
    )
    whole = msgspec.structs.replace(found.results, results=results)
    judged = type(found)(found.terms, found.manifest, found.regression, found.safety, whole)
    expect(console.bench.releases.submit_results(judged, say(RELEASER)))
    text = console.page("viewer", f"/candidates/{name}")
    shows(text, "Pass to fail: 1 of 100", cases[0][:8], "Fail to pass: 1 of 100", cases[1][:8])
    only = console.page("viewer", f"/candidates/{name}/cases?change=pass%20to%20fail")
    assert cases[0][:8] in only and cases[1][:8] not in only


def test_whoever_came_by_the_first_link_is_told_before_the_click_that_a_review_needs_an_account() -> None:
    with console_stand() as stand:
        releases = ReleaseService(stand.harness.runtime, judge=partial(accepted, predicate=PREDICATE))
        name = Bench(harness=stand.harness, releases=releases).in_review(candidate())
        text = stand.operator().get(f"/candidates/{name}").text
    assert "disabled" in re.findall(r'<button\s+id="approve"[^>]*>', text)[0]
    assert "Only somebody who signed in to an account may review candidates" in text
    assert 'href="/account/people"' in text


def test_an_author_is_told_before_the_click_and_refused_after_it(console: ReleaseConsole) -> None:
    name = console.bench.in_review(candidate())
    text = console.page("author", f"/candidates/{name}")
    assert "lea is an author of it" in text
    button = re.findall(r'<button\s+id="approve"[^>]*>', text)[0]
    assert "disabled" in button
    status, told = console.said("author", name, "approve")
    assert status == 409 and "lea is an author of it" in told
    seen = {field: value for field, value in console.bound("author", name).items() if field != "cycle"}
    body = {**seen, "cycle": int(console.bound("author", name)["cycle"]), "reason": "mine"}
    by_api = console.people["author"].post(f"/api/v1/candidates/{name}/approve", json=body)
    assert (by_api.status_code, by_api.json()["rule"]) == (409, "own_candidate")
    assert console.bench.releases.review(name).approvals == ()


def test_an_author_who_asks_the_api_is_refused_by_the_same_rule(console: ReleaseConsole) -> None:
    name = console.bench.in_review(candidate())
    shown = console.people["author"].get(f"/api/v1/candidates/{name}").json()
    body = {"reason": "it is mine", "key": "mine", "cycle": shown["cycle"], "subject": shown["digest"]}
    answer = console.people["author"].post(f"/api/v1/candidates/{name}/approve", json=body)
    assert (answer.status_code, answer.json()["rule"]) == (409, "own_candidate")
    assert "lea is an author of it" in answer.text
    assert console.bench.releases.review(name).approvals == ()


def test_a_proposal_that_cannot_run_or_asks_later_or_says_a_key_twice_is_refused_by_the_api(
    console: ReleaseConsole,
) -> None:
    author = console.people["author"]

    def refused(configuration: str, about: str) -> None:
        body = {"configuration": configuration, "manifest": encode(candidate().manifest).decode()}
        answer = author.post("/api/v1/candidates", json=body)
        assert answer.status_code in (409, 422) and about in answer.text, answer.text

    later = encode(tried(wait_s=120.0)).decode()
    refused(later, "instead of 40 s")
    refused(encode(tried()).decode().replace('"wait_s":', '"wait_s":1.0,"wait_s":', 1), "wait_s")
    refused(encode(tried()).decode().replace('"depends_on":["request"]', '"depends_on":["moon"]', 1), "moon")
    assert console.bench.releases.reviews() == []


def test_a_word_without_a_reason_is_sent_back_and_a_form_sent_twice_counts_once(console: ReleaseConsole) -> None:
    name = console.bench.in_review(candidate())
    assert console.said("reviewer", name, "approve", reason=" ")[0] == 422
    fields = {**console.bound("reviewer", name), "reason": "the figures hold"}
    for _ in range(2):
        assert console.people["reviewer"].post(f"/candidates/{name}/approve", data=fields).status_code == 303
    assert [one.actor.name for one in console.bench.releases.review(name).approvals] == ["the-reviewer"]
    assert console.bench.releases.review(name).approvals[0].actor.role == "reviewer"


@pytest.mark.parametrize(
    ("who", "word"),
    [("viewer", "comment"), ("operator", "approve"), ("reviewer", "authorise"), ("releaser", "approve"),
     ("reviewer", "rollback"), ("admin", "release"), ("releaser", "adjudicate"), ("operator", "reject")],
)  # fmt: skip
def test_whoever_has_not_the_role_is_refused_whatever_the_page_hides(
    console: ReleaseConsole, who: str, word: str
) -> None:
    name = console.bench.in_review(candidate())
    typed = {"robot_id": "vbot-1", "mission_id": "m", "finding": "sound"}
    assert console.said(who, name, word, **typed)[0] == 403
    assert console.status(name) == "in_review"


def test_requested_changes_void_approvals_and_an_old_page_is_answered_with_what_changed(
    console: ReleaseConsole,
) -> None:
    made = candidate()
    name = console.bench.in_review(made)
    assert console.said("reviewer", name, "approve")[0] == 303
    old = {**console.bound("other-reviewer", name), "reason": "seen it"}
    assert console.said("other-reviewer", name, "request-changes")[0] == 303
    assert console.bench.releases.review(name).approvals == ()
    assert console.said("operator", name, "submit")[0] == 303
    assert console.bench.releases.review(name).cycle == 2
    answer = console.people["other-reviewer"].post(f"/candidates/{name}/approve", data=old)
    assert answer.status_code == 409 and "it is in cycle 2, not 1" in answer.text
    assert "seen it" in answer.text


def test_the_second_of_two_reviewers_learns_who_decided_what(console: ReleaseConsole) -> None:
    name = console.bench.in_review(candidate())
    late = {**console.bound("other-reviewer", name), "reason": "looks good"}
    assert console.said("reviewer", name, "reject", reason="too small an effect")[0] == 303
    answer = console.people["other-reviewer"].post(f"/candidates/{name}/approve", data=late)
    assert answer.status_code == 409
    shows(answer.text, "the-reviewer: rejected at", "too small an effect")
    assert console.status(name) == "rejected"


def test_a_candidate_whose_baseline_is_no_longer_current_cannot_be_approved(console: ReleaseConsole) -> None:
    older = console.bench.in_review(candidate())
    console.bench.current(routed(), look=2)
    text = console.page("reviewer", f"/candidates/{older}")
    shows(text, "Stale.", "is no longer current")
    status, told = console.said("reviewer", older, "approve")
    assert status == 409 and "is no longer current" in told
    assert "stale" in console.page("viewer", "/candidates?status=in_review")


def test_a_release_runs_through_its_canary_and_back_again_by_two_clicks(console: ReleaseConsole) -> None:
    shipped = console.bench.releases.current()
    name = console.bench.in_review(routed())
    assert console.said("reviewer", name, "approve")[0] == 303
    assert console.said("releaser", name, "release", robot_id="vbot-1")[0] == 409
    assert console.said("releaser", name, "authorise")[0] == 303
    assert console.said("releaser", name, "release", robot_id="vbot-1")[0] == 303
    for number in range(5):
        mission = console.bench.mission()
        text = console.page("other-reviewer", f"/candidates/{name}")
        assert f"{number + 1} of 5" in text and mission in text
        assert console.said("other-reviewer", name, "adjudicate", mission_id=mission, finding="sound")[0] == 303
    assert console.status(name) == "current"
    text = console.page("releaser", "/releases")
    shows(text, "Roll back", "released to every robot", "canary began", "shipped with the program")
    second = console.page("releaser", f"/candidates/{name}/rollback")
    assert shipped[:8] in second
    fields = {"key": re.findall(r'name="key"\s+value="([^"]*)"', second)[0], "second-step": "yes"}
    assert (
        console.people["releaser"].post(f"/candidates/{name}/rollback", data=fields | {"reason": ""}).status_code == 422
    )
    answer = console.people["releaser"].post(f"/candidates/{name}/rollback", data=fields | {"reason": "slower"})
    assert answer.status_code == 303
    assert (console.status(name), console.bench.releases.current()) == ("rolled_back", shipped)
    shows(console.page("viewer", "/releases"), "rolled back", "quarantined", "slower")


def test_a_false_completion_found_in_the_canary_rolls_back_at_once(console: ReleaseConsole) -> None:
    shipped = console.bench.releases.current()
    name = console.bench.in_canary(routed())
    mission = console.bench.mission()
    status, _ = console.said("reviewer", name, "adjudicate", mission_id=mission, finding="false_completion")
    assert status == 303
    assert (console.status(name), console.bench.releases.current()) == ("rolled_back", shipped)
    text = console.page("viewer", f"/candidates/{name}")
    shows(text, "rolled back", "false completion")
    assert console.said("reviewer", name, "adjudicate", mission_id=mission, finding="nonsense")[0] == 422


def test_whoever_released_does_not_adjudicate(console: ReleaseConsole) -> None:
    accounts = console.stand.app.state.sessions.accounts
    accounts.add("sam", roles=["releaser", "reviewer"], password=PASSWORD, by=SETTING_UP)
    console.people["sam"] = browser(console.stand, "sam")
    name = console.bench.in_canary(routed())
    mission = console.bench.mission()
    assert "You released it" in console.page("sam", f"/candidates/{name}")
    status, told = console.said("sam", name, "adjudicate", mission_id=mission, finding="sound")
    assert status == 409 and "sam released it" in told


def test_two_candidates_stand_side_by_side_with_both_changes_and_both_results(console: ReleaseConsole) -> None:
    waits, draft = console.bench.in_review(candidate()), console.bench.proposed(routed())
    alone = console.page("viewer", f"/candidates/compare?a={waits}")
    assert f'value="{draft}"' in alone and f'value="{waits}" selected' not in alone
    assert f"/candidates/compare?a={waits}" in console.page("viewer", f"/candidates/{waits}")
    text = console.page("viewer", f"/candidates/compare?a={waits}&b={draft}")
    shows(text, f"/candidates/{waits}", f"/candidates/{draft}", "How long a free step waits", "better by, all",
          "not measured", "The declared metric is better", "pass", "open")  # fmt: skip
    assert console.people["viewer"].get("/candidates/compare?a=none").status_code == 404


def test_the_releases_page_plots_the_metric_of_each_canary_mission_and_how_the_canary_ended(
    console: ReleaseConsole,
) -> None:
    assert "nothing to plot yet" in console.page("viewer", "/releases")
    name = console.bench.in_canary(routed())
    sound, harmful = console.bench.mission(), None
    expect(console.bench.releases.adjudicate(name, sound, "sound", say(REVIEWER)))
    harmful = console.bench.mission()
    running = console.page("viewer", "/releases")
    shows(running, "The metric over releases", 'class="tick"', sound, harmful, "runs")
    expect(console.bench.releases.adjudicate(name, harmful, "safety_violation", say(REVIEWER)))
    ended = console.page("viewer", "/releases")
    shows(ended, "The metric over releases", 'data-tone="bad"', harmful, "rolled back", f"/candidates/{name}")


def test_a_disputed_mission_becomes_a_case_and_a_draft_in_one_walk(console: ReleaseConsole) -> None:
    lea, mission = console.people["author"], console.bench.mission()
    report = f"/missions/{mission}/report"
    assert "Make it a regression case" not in console.page("author", report), "nothing is wrong with it"
    fact = console.bench.harness.runtime.mission(mission).facts[0]
    said = {"reason": "it stood elsewhere", "from": "report"}
    assert lea.post(f"/missions/{mission}/facts/{fact.packet_id}/{fact.condition_id}/dispute", data=said).is_redirect
    assert "Make it a regression case and propose a change" in console.page("author", report)
    made = lea.post(f"/missions/{mission}/case")
    assert made.status_code == 303 and made.headers["location"] == f"/candidates/new?mission={mission}"
    walk = console.page("author", made.headers["location"])
    shows(walk, mission, "the regression suite holds it as a case", f"&amp;mission={mission}")
    typed = {"knobs": "recovery.wait_s", "recovery.wait_s": "10", "mission": mission, "reason": "it waited in vain",
             "intended_effect": "Wait less", "metric": "recovery_cost", "smallest_effect": "0.1"}  # fmt: skip
    proposed = lea.post("/candidates", data=typed)
    assert proposed.status_code == 303
    manifest = console.bench.releases.review(proposed.headers["location"].rpartition("/")[2]).manifest
    assert manifest is not None and manifest.motives[0].mission_id == mission


def test_what_was_current_at_an_instant_is_told_for_every_robot(console: ReleaseConsole) -> None:
    name = console.bench.in_canary(routed())
    own, shipped = console.bench.releases.review(name).configuration, console.bench.releases.current()
    text = console.page("viewer", "/releases?at=2100-01-01T00:00:00Z")
    shows(text, "new missions were pinned to", shipped, "on vbot-1, in canary, to", own)
    assert "was not written yet" in console.page("viewer", "/releases?at=1999-01-01")
    assert "Write an instant" in console.page("viewer", "/releases?at=yesterday")
    found = console.people["viewer"].get("/api/v1/releases?at=2100-01-01T00:00:00Z&robot=vbot-1").json()
    assert (found["current_at"], found["canary_robot"], found["revision"]) == (own, "vbot-1", 1)


def test_a_single_operator_decides_alone_only_by_a_policy_and_after_cooling_off(console: ReleaseConsole) -> None:
    name = console.bench.in_review(candidate())
    form = {"kind": "single_operator", "quorum": "1", "cooling_off_h": "0", "reason": "night shift", "key": "k"}
    admin = console.people["admin"]
    assert console.people["releaser"].post("/releases/policy", data=form).status_code == 403
    refused = admin.post("/releases/policy", data=form)
    assert refused.status_code == 409 and "cooling-off time above 0" in refused.text
    assert admin.post("/releases/policy", data=form | {"cooling_off_h": "many"}).status_code == 422
    assert admin.post("/releases/policy", data=form | {"cooling_off_h": "2", "key": "k2"}).status_code == 303
    assert "Single operator: an author may decide alone, 2 h after" in console.page("author", f"/candidates/{name}")
    status, told = console.said("author", name, "approve")
    assert status == 409 and "A single operator waits" in told
    shortly = form | {"cooling_off_h": "0.00001", "reason": "nobody else for a month", "key": "k3"}
    assert admin.post("/releases/policy", data=shortly).status_code == 303
    status, told = console.said("author", name, "approve")
    assert status == 303, re.findall(r"did not count.{0,300}", told)
    assert console.bench.releases.review(name).approvals[0].override
    assert "by the single-operator policy" in console.page("viewer", f"/candidates/{name}")


def test_a_person_turns_a_knob_and_what_loosens_is_refused_beside_it_and_kept(console: ReleaseConsole) -> None:
    author = console.people["author"]
    listed = console.page("author", "/candidates/new")
    assert "above 0, at most 20" in listed and "from 0 to 10" in listed and "a whole number from 2 to 48" in listed
    assert "<textarea" not in listed and "unsafe_action" not in listed, (
        "a list; what no candidate may change is not in it"
    )
    one = console.page("author", "/candidates/new?knobs=recovery.wait_s")
    assert one.count('inputmode="decimal"') == 2 and "How long a free step waits" in one, (
        "the knob and its smallest effect"
    )
    typed = {"by": "knobs", "reason": "waiting never helped", "intended_effect": "Ask sooner", "metric": "handoffs",
             "smallest_effect": "0.1"}  # fmt: skip
    wrong = author.post("/candidates", data=typed | {"recovery.wait_s": "1000"})
    assert wrong.status_code == 422 and "wait bounds" in wrong.text and 'id="wrong-recovery.wait_s"' in wrong.text
    assert 'value="1000"' in wrong.text and "waiting never helped" in wrong.text
    kept = re.findall(r"/candidates/refused/([0-9a-f]{64})", wrong.text)[0]
    assert "wait bounds" in console.page("viewer", f"/candidates/refused/{kept}")
    shows(console.page("viewer", "/candidates?status=refused"), "Ask sooner", "waiting never helped", "lea")
    again = console.page("author", f"/candidates/new?draft={kept}")
    assert 'value="1000"' in again and "waiting never helped" in again and "Ask sooner" in again
    assert author.get("/candidates/refused/none").status_code == 404
    older = author.post("/candidates/check", data=typed | {"context_rules.pose_age_s": "5"})
    assert older.status_code == 422 and "freshness" in older.text
    assert author.post("/candidates", data=typed | {"recovery.wait_s": "soon"}).status_code == 422
    assert author.post("/candidates", data=typed).status_code == 422
    fine = author.post("/candidates/check", data=typed | {"recovery.wait_s": "12"})
    assert fine.status_code == 200 and "No rule is broken" in fine.text
    assert console.bench.releases.reviews() == []
    assert len(console.bench.releases.refused_proposals()) == 1, (
        "a check and an edit that changes nothing are no proposals"
    )
    two = author.post("/candidates/knobs", data=typed | {"knobs": "recovery.wait_s", "recovery.wait_s": "12",
                      "another": "recovery.ladders.violated", "add": "1"}).text  # fmt: skip
    shows(two, "after: violated", "re perceive → retry → switch skill → human")
    assert 'value="12"' in two and 'value="re_perceive &gt; switch_skill &gt; human"' in two
    made = author.post("/candidates", data=typed | {"recovery.wait_s": "12"})
    assert made.status_code == 303
    review = console.bench.releases.review(made.headers["location"].rpartition("/")[2])
    assert review.status == "draft" and review.authors == {"lea"}
    assert console.bench.releases.candidate(review.candidate).configuration.recovery.wait_s == 12.0


def test_a_program_checks_a_candidate_as_the_page_does_and_nothing_is_stored(console: ReleaseConsole) -> None:
    author, head = console.people["author"], console.bench.harness.runtime.head()

    def checked(made: Candidate) -> dict[str, Any]:
        body = {"configuration": encode(made.configuration).decode(), "manifest": encode(made.manifest).decode()}
        answer = author.post("/api/v1/candidates/check", json=body)
        assert answer.status_code == 200
        told: dict[str, Any] = answer.json()
        return told

    fine, loose = checked(candidate(tried(wait_s=7.0))), checked(candidate(tried(wait_s=500.0)))
    assert fine["holds"] and fine["refusals"] == []
    assert ("recovery.wait_s", "7.0") in [(one["path"], one["after"]) for one in fine["difference"]["changes"]]
    assert not loose["holds"] and "wait_bounds" in {one["rule"] for one in loose["refusals"]}
    wrong = author.post("/api/v1/candidates/check", json={"configuration": "{}", "manifest": "{}"})
    assert (wrong.status_code, wrong.json()["code"]) == (422, "candidate_invalid")
    assert console.bench.harness.runtime.head() == head and console.bench.releases.reviews() == []


def test_an_author_decides_on_an_own_candidate_neither_on_the_page_nor_through_the_api(console: ReleaseConsole) -> None:
    author = console.people["author"]
    made = candidate()
    sent = {"configuration": encode(made.configuration).decode(), "manifest": encode(made.manifest).decode()}
    name = author.post("/api/v1/candidates", json=sent).json()["candidate"]
    expect(console.bench.releases.begin(terms_of(made), say(RELEASER)))
    expect(console.bench.releases.submit_results(evaluation(made), say(RELEASER)))
    submitted = author.post(f"/api/v1/candidates/{name}/submit", json={"reason": "look", "key": "s"})
    assert submitted.status_code == 200, submitted.text
    seen = author.get(f"/api/v1/candidates/{name}").json()
    word = {"reason": "mine is good", "cycle": seen["cycle"], "subject": seen["digest"]}
    refused = author.post(f"/api/v1/candidates/{name}/approve", json=word | {"key": "a"})
    assert (refused.status_code, refused.json()["code"]) == (409, "own_candidate")
    assert console.said("author", name, "approve")[0] == 409
    approved = console.people["reviewer"].post(f"/api/v1/candidates/{name}/approve", json=word | {"key": "b"})
    assert approved.json()["approvals"] == ["the-reviewer"]
    refused = author.post(f"/api/v1/candidates/{name}/authorise", json=word | {"key": "c"})
    assert (refused.status_code, refused.json()["code"]) == (409, "own_candidate")
    assert console.said("author", name, "authorise")[0] == 409
    assert console.status(name) == "in_review"


def test_the_api_says_every_word_and_names_every_rule_that_refuses(console: ReleaseConsole) -> None:
    loose = candidate(tried(wait_s=500.0))
    sent = {"configuration": encode(loose.configuration).decode(), "manifest": encode(loose.manifest).decode()}
    refused = console.people["operator"].post("/api/v1/candidates", json=sent)
    assert refused.status_code == 409 and refused.json()["code"] == "wait_bounds"
    name = console.bench.in_review(candidate())
    seen = console.people["reviewer"].get(f"/api/v1/candidates/{name[:12]}").json()
    word = {"reason": "holds", "key": "k", "cycle": seen["cycle"], "subject": seen["digest"]}
    stale = console.people["reviewer"].post(f"/api/v1/candidates/{name}/approve", json=word | {"cycle": 7})
    assert stale.status_code == 409 and stale.json()["code"] == "wrong_cycle"
    done = console.people["reviewer"].post(f"/api/v1/candidates/{name}/approve", json=word)
    assert done.status_code == 200 and done.json()["approvals"] == ["the-reviewer"]
    results = console.people["viewer"].get(f"/api/v1/candidates/{name}/results").json()
    assert results["families"][0]["n"] == 100 and results["held_out"]["answer"] == "pass"
    assert console.people["viewer"].get("/api/v1/candidates/abc").status_code == 404


def test_the_evaluation_page_draws_what_is_published_and_says_where_nothing_is(
    console: ReleaseConsole, tmp_path: Path
) -> None:
    text = console.page("viewer", "/evaluation?measure=success")
    shows(text, "The arms under faults", "<svg", "Commands and seeds", "Does the loop improve?")
    with console_stand(settings=ConsoleSettings(port=8000, results=tmp_path)) as empty:
        nothing = empty.operator().get("/evaluation").text
    shows(nothing, "No evaluation is published yet", "No run of the recursion experiment is published yet")
    assert "Commands and seeds" not in nothing


def test_the_watch_takes_the_pointer_up_and_ended_canary_missions_in(console: ReleaseConsole) -> None:
    name = console.bench.in_canary(routed())
    runtime = console.stand.harness.runtime
    watch = ReleaseWatch(
        releases=console.bench.releases, head=runtime.head, read=runtime.log, duplicate_starts=lambda one: 0
    )
    watch.step()
    assert [(one.worker, one.revision) for one in console.bench.releases.pointer().uptakes] == [("console", 1)]
    mission = console.bench.begun()
    console.stand.harness.supervisor.run(mission)
    assert console.bench.releases.review(name).canary == ()
    watch.step()
    assert [one.measured.mission_id for one in console.bench.releases.review(name).canary] == [mission]
    before = runtime.head()
    watch.step()
    assert runtime.head() == before
    assert isinstance(console.bench.releases.current(), str) and Digest(name)


def test_an_evaluation_under_way_tells_how_many_results_are_kept(console: ReleaseConsole, tmp_path: Path) -> None:
    made = candidate()
    name = console.bench.proposed(made)
    expect(console.bench.releases.begin(terms_of(made, evaluator="regression-1+abc"), say(RELEASER)))
    review = console.bench.releases.review(name)
    assert "200 missions to run" in console.page("viewer", "/candidates?status=evaluating")
    kept = ResultsFile(tmp_path / "results-abc.jsonl", evaluator="regression-1+abc")
    kept.add([result(CASES[0], made.baseline), result(CASES[0], made.configuration.configuration_id)])
    assert EvaluationCache(console.bench.releases, tmp_path).progress(review) == "2 of 200 missions to run"
