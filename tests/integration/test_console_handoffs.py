"""A person's answer through the console: bound to what the page showed, once, by the rules of the gate."""

import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest
from fastapi.testclient import TestClient
from msgspec.structs import replace

from app.auth.commit_authority import authority
from app.i18n.reasons.rendering import sentence
from app.views.handoff_question import ShownRecord
from harness.contracts.actors import Actor
from harness.contracts.commands import RejectHandoff
from harness.contracts.control import CONTROL, LimitAutonomy
from harness.contracts.decisions import Refused
from harness.contracts.ids import Digest, HandoffId, handoff_stream, sha256
from harness.contracts.values import decode, encode
from harness.gate.commit import CommandEnvelope
from harness.projections.mission import Mission
from tests.builders.consoles import Stand, console_stand
from tests.builders.people import PASSWORD, SETTING_UP, browser, everybody, store_of

FIELDS = ("cycle", "subject", "evidence", "key")


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def waiting(stand: Stand) -> tuple[Mission, HandoffId]:
    return stand.handed_off()


def shown(client: TestClient, handoff_id: str) -> dict[str, str]:
    """The binding that the person's page carries."""
    text = client.get(f"/handoffs/{handoff_id}").text
    return {name: re.findall(rf'name="{name}"\s+value="([^"]*)"', text)[0] for name in FIELDS}


def digest_shown(client: TestClient, handoff_id: str, headers: dict[str, str] | None = None) -> str:
    """The digest of what the page shows, as its form carries it."""
    text = client.get(f"/handoffs/{handoff_id}", headers=headers).text
    return str(re.findall(r'name="shown"\s+value="([^"]*)"', text)[0])


def starts(stand: Stand, mission: Mission) -> int:
    return len(stand.harness.starts(mission.mission_id))


def test_the_page_says_first_what_happens_without_an_answer_and_shows_the_question(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    text = stand.operator().get(f"/handoffs/{waiting[1]}").text
    order = [
        "If nobody answers",
        "What you would approve",
        "Hold to approve",
        "Why it stopped",
        "Tried, and what it cost",
    ]
    assert [text.index(part) for part in order] == sorted(text.index(part) for part in order)
    assert "data-countdown" in text
    assert "Interrupted" in text or "interrupted" in text
    assert text.count('class="meter"') >= 7


def test_an_approval_starts_the_robot_once_and_the_page_follows_it(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    mission, handoff_id = waiting
    operator = stand.operator()
    assert operator.post(f"/handoffs/{handoff_id}/look").status_code == 303
    before = starts(stand, mission)
    form = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen on camera"}
    answer = operator.post(f"/handoffs/{handoff_id}/decision", data=form)
    assert (answer.status_code, answer.headers.get("location")) == (303, f"/handoffs/{handoff_id}")
    stand.harness.supervisor.step(mission.mission_id)
    assert starts(stand, mission) == before + 1
    page = operator.get(f"/handoffs/{handoff_id}").text
    assert "seen on camera" in page
    assert "dispatched" in page
    assert "Hold to approve" not in page


def test_a_start_that_only_a_rule_asks_about_is_one_yes_without_a_text_and_no_trouble(stand: Stand) -> None:
    runtime, operator = stand.harness.runtime, stand.operator()
    visit = LimitAutonomy(autonomy="approve_each_motion", actor=Actor(name="ada", role="operator"), reason="a visit")
    runtime.decide([(CONTROL, visit)])
    mission = stand.run()
    handoff_id = mission.handoff_id
    assert handoff_id is not None
    page = operator.get(f"/handoffs/{handoff_id}").text
    assert "vbot-1 waits for your yes before" in page and "cannot finish" not in page
    assert "waits for your yes" in operator.get("/handoffs").text
    operator.post(f"/handoffs/{handoff_id}/look")
    unsaid = {"reason": "", "unsaid": "approved before it starts"}
    reject = {**shown(operator, handoff_id), "decision": "reject", **unsaid}
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=reject).status_code == 422, "a no says why"
    before = starts(stand, mission)
    approve = {
        **shown(operator, handoff_id),
        "decision": "approve",
        "reason": "",
        "unsaid": "approved before it starts",
    }
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=approve).status_code == 303
    stand.harness.supervisor.step(mission.mission_id)
    assert starts(stand, mission) == before + 1
    answer = runtime.handoff(handoff_id).answer
    assert answer is not None and answer.reason == "approved before it starts"


def test_the_same_answer_again_is_the_same_receipt_and_starts_nothing(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    mission, handoff_id = waiting
    operator = stand.operator()
    operator.post(f"/handoffs/{handoff_id}/look")
    form = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen on camera"}
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 303
    begun = starts(stand, mission)
    once = stand.harness.runtime.handoff(handoff_id).version
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 303
    assert stand.harness.runtime.handoff(handoff_id).version == once
    assert starts(stand, mission) == begun


def test_another_answer_after_the_first_is_told_who_decided(stand: Stand, waiting: tuple[Mission, HandoffId]) -> None:
    _, handoff_id = waiting
    first, second = stand.operator(), stand.operator()
    seen_by_first, seen_by_second = shown(first, handoff_id), shown(second, handoff_id)
    rejected = {**seen_by_first, "decision": "reject", "reason": "not safe"}
    assert first.post(f"/handoffs/{handoff_id}/decision", data=rejected).status_code == 303
    late = second.post(
        f"/handoffs/{handoff_id}/decision",
        data={**seen_by_second, "decision": "approve", "reason": "path is clear now"},
    )
    assert late.status_code == 409
    assert "operator" in late.text
    assert "not safe" in late.text


@pytest.mark.ledger("R174", symbol="harness.supervisor.handoffs:HandoffService._ends")
def test_a_rejection_ends_the_mission_safely(stand: Stand, waiting: tuple[Mission, HandoffId]) -> None:
    mission, handoff_id = waiting
    operator = stand.operator()
    form = {**shown(operator, handoff_id), "decision": "reject", "reason": "not safe"}
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 303
    assert stand.harness.supervisor.run(mission.mission_id).status == "safe_stopped"
    assert "not safe" in sentence(operator.get(f"/handoffs/{handoff_id}").text)


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [("subject", "0" * 64, "not what you saw"), ("evidence", "0" * 64, "not what you saw"), ("cycle", "9", "changed")],
)
def test_an_answer_to_something_else_is_refused_with_the_reason_and_a_fresh_page(
    stand: Stand, waiting: tuple[Mission, HandoffId], field: str, value: str, told: str
) -> None:
    mission, handoff_id = waiting
    operator = stand.operator()
    operator.post(f"/handoffs/{handoff_id}/look")
    before = starts(stand, mission)
    form = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen on camera", field: value}
    answer = operator.post(f"/handoffs/{handoff_id}/decision", data=form)
    assert answer.status_code == 409
    assert told in answer.text
    assert "seen on camera</textarea>" in answer.text
    assert shown(operator, handoff_id)["key"] not in answer.text
    assert stand.harness.runtime.handoff(handoff_id).status == "open"
    assert starts(stand, mission) == before


def test_looking_again_makes_a_new_cycle_that_an_older_page_cannot_answer(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    _, handoff_id = waiting
    operator = stand.operator()
    old = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen on camera"}
    assert operator.post(f"/handoffs/{handoff_id}/look").status_code == 303
    assert int(shown(operator, handoff_id)["cycle"]) == int(old["cycle"]) + 1
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=old).status_code == 409


@pytest.mark.parametrize("reason", ["", "   ", "x" * 201])
def test_an_answer_without_a_reason_is_not_taken(stand: Stand, waiting: tuple[Mission, HandoffId], reason: str) -> None:
    _, handoff_id = waiting
    operator = stand.operator()
    form = {**shown(operator, handoff_id), "decision": "reject", "reason": reason}
    answer = operator.post(f"/handoffs/{handoff_id}/decision", data=form)
    assert answer.status_code == 422
    assert 'id="errors"' in answer.text
    assert stand.harness.runtime.handoff(handoff_id).status == "open"


@pytest.mark.parametrize("missing", FIELDS)
def test_an_answer_that_is_bound_to_nothing_is_not_taken(
    stand: Stand, waiting: tuple[Mission, HandoffId], missing: str
) -> None:
    _, handoff_id = waiting
    operator = stand.operator()
    form = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen on camera"}
    del form[missing]
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 422
    assert stand.harness.runtime.handoff(handoff_id).status == "open"


def test_the_api_answers_by_the_same_rules(stand: Stand, waiting: tuple[Mission, HandoffId]) -> None:
    mission, handoff_id = waiting
    owner = stand.owner()
    (found,) = owner.get("/api/v1/handoffs?status=open").json()
    assert found["handoff_id"] == handoff_id
    fresh = owner.post(f"/api/v1/handoffs/{handoff_id}/look").json()
    body = {
        "decision": "approve",
        "reason": "seen on camera",
        "key": "k-1",
        "cycle": fresh["cycle"],
        "subject": "0" * 64,
        "evidence": fresh["opened"]["evidence"],
    }
    refused = owner.post(f"/api/v1/handoffs/{handoff_id}/decision", json=body)
    assert (refused.status_code, refused.json()["code"]) == (409, "wrong_digest")
    body["subject"] = fresh["opened"]["subject"]
    taken = owner.post(f"/api/v1/handoffs/{handoff_id}/decision", json=body)
    assert taken.status_code == 200
    assert taken.json()["answer"]["reason"] == "seen on camera"
    assert stand.harness.runtime.mission(mission.mission_id).status == "active"


def test_what_was_on_the_screen_is_kept_and_another_screen_is_refused(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    _, handoff_id = waiting
    operator = stand.operator()
    operator.post(f"/handoffs/{handoff_id}/look")
    form = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen on camera"}
    seen = operator.get(f"/handoffs/{handoff_id}/shown").text
    digest = digest_shown(operator, handoff_id)
    opened = stand.harness.runtime.handoff(handoff_id).opened
    other = operator.post(f"/handoffs/{handoff_id}/decision", data={**form, "shown": "0" * 64})
    assert other.status_code == 409 and "on your screen" in other.text
    assert operator.post(f"/handoffs/{handoff_id}/decision", data={**form, "shown": digest}).status_code == 303
    answer = stand.harness.runtime.handoff(handoff_id).answer
    assert answer is not None and answer.shown == digest
    body = stand.harness.runtime.blob(answer.shown)
    kept = decode(body, ShownRecord)
    assert sha256(body) == digest
    assert opened is not None and kept.opened == opened and kept.opened.proposal is not None
    assert kept.action == encode(kept.opened.proposal).decode()
    assert {name for name, _, limit in kept.budgets if limit} >= {"stage", "mission"} and kept.tries
    for part in ("Why it stopped", "What you would approve", "of 8"):
        assert part in seen


@pytest.mark.ask("langgraph#8039")
def test_every_language_carries_the_same_digest_of_what_was_shown_and_another_proposal_another(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    _, handoff_id = waiting
    operator = stand.operator()
    operator.post(f"/handoffs/{handoff_id}/look")
    english = digest_shown(operator, handoff_id)
    chinese = {"Accept-Language": "zh-CN,zh;q=0.9"}
    assert "Why it stopped" not in operator.get(f"/handoffs/{handoff_id}", headers=chinese).text
    assert digest_shown(operator, handoff_id, headers=chinese) == english
    form = shown(operator, handoff_id)
    chosen = {**form, "action": "verify_again", "reason": "look first"}
    assert operator.post(f"/handoffs/{handoff_id}/choose", data=chosen).status_code == 303
    changed = digest_shown(operator, handoff_id)
    assert changed != english
    answer = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen"}
    assert operator.post(f"/handoffs/{handoff_id}/decision", data={**answer, "shown": english}).status_code == 409
    taken = operator.post(f"/handoffs/{handoff_id}/decision", data={**answer, "shown": changed}, headers=chinese)
    assert taken.status_code == 303


@pytest.mark.ask("langgraph#8026")
def test_an_answer_to_an_older_question_is_shown_what_changed(stand: Stand, waiting: tuple[Mission, HandoffId]) -> None:
    _, handoff_id = waiting
    operator = stand.operator()
    operator.post(f"/handoffs/{handoff_id}/look")
    old = {**shown(operator, handoff_id), "decision": "approve", "reason": "seen on camera"}
    chosen = operator.post(f"/handoffs/{handoff_id}/choose", data={**old, "action": "verify_again"})
    assert chosen.status_code == 303
    refused = operator.post(f"/handoffs/{handoff_id}/decision", data=old)
    assert refused.status_code == 409
    rows = re.findall(
        r"<tr>\s*<td>([^<]*)</td>\s*<td class=\"wrap\">([^<]*)</td>\s*<td class=\"wrap\">([^<]*)</td>", refused.text
    )
    assert ("action: action", "retry", "verify_again") in rows
    body = {"decision": "approve", "reason": "r", "key": "k-9", "cycle": int(old["cycle"])}
    body |= {"subject": old["subject"], "evidence": old["evidence"]}
    problem = stand.owner().post(f"/api/v1/handoffs/{handoff_id}/decision", json=body)
    assert (problem.status_code, problem.json()["code"]) == (409, "wrong_cycle")
    assert {"name": "action: action", "was": "retry", "now": "verify_again"} in problem.json()["changes"]


@pytest.mark.ask("flotilla#889")
def test_a_claim_names_its_holder_to_others_and_follows_through_to_the_end(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    _, handoff_id = waiting
    accounts = stand.app.state.sessions.accounts
    for name, roles in (("owner", ["admin", "operator"]), ("ada", ["operator"])):
        accounts.add(name, roles=roles, password=PASSWORD, by=SETTING_UP)
    operator, owner = browser(stand, "ada"), browser(stand, "owner")
    assert owner.post(f"/api/v1/handoffs/{handoff_id}/claim", json={"claim": "t-1"}).json()["status"] == "claimed"
    text = operator.get(f"/handoffs/{handoff_id}").text
    assert "owner has claimed it" in text
    form = {**shown(operator, handoff_id), "decision": "reject", "reason": "not safe"}
    refused = operator.post(f"/handoffs/{handoff_id}/decision", data=form)
    assert refused.status_code == 409 and "owner has claimed it until" in refused.text
    take = {"claim": "t-1", "device": "desk 2", "key": "k-1", "reason": "by hand"}
    assert owner.post(f"/api/v1/handoffs/{handoff_id}/take-over", json=take).json()["status"] == "taken_over"
    assert "owner drives vbot-1 from desk 2" in sentence(operator.get(f"/handoffs/{handoff_id}").text)
    close = {"claim": "t-1", "key": "k-2", "reason": "I keep it"}
    assert owner.post(f"/api/v1/handoffs/{handoff_id}/close", json=close).json()["status"] == "closed"
    assert "handed off" in sentence(operator.get(f"/handoffs/{handoff_id}").text)


def test_the_list_finds_waiting_and_ended_questions_by_words_filters_and_pages(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    _, first = waiting
    operator = stand.operator()
    form = {**shown(operator, first), "decision": "reject", "reason": "zebra crossing"}
    operator.post(f"/handoffs/{first}/decision", data=form)
    _, second = stand.handed_off()

    def listed(query: str) -> set[str]:
        return set(re.findall(r'class="strong" href="/handoffs/([^"]*)"', operator.get(f"/handoffs{query}").text))

    assert listed("") == {first, second}
    assert listed("?status=waiting") == {second}
    assert listed("?status=ended") == listed("?q=zebra") == listed(f"?q={first}") == {first}
    assert listed("?failure=interrupted") == {first, second}
    assert listed("?robot=nobody") == set()
    assert operator.get("/handoffs?status=nowhere").status_code == 404
    pages = stand.owner().get("/api/v1/handoffs?limit=1")
    assert [one["handoff_id"] for one in pages.json()] == [second]
    assert [one["handoff_id"] for one in stand.owner().get(pages.links["next"]["url"]).json()] == [first]
    assert f'href="/handoffs/{first}"' in sentence(operator.get(f"/handoffs/{second}").text)


def test_a_role_taken_back_while_the_page_was_open_voids_the_answer(stand: Stand) -> None:
    people = everybody(stand)
    _, handoff_id = stand.handed_off()
    store = store_of(stand)
    operator = people["operator"]
    form = {**shown(operator, handoff_id), "decision": "reject", "reason": "not safe"}
    account = store.account("the-operator")
    assert account is not None
    still = authority(stand.app.state.sessions.accounts)
    word = RejectHandoff(
        actor=Actor(name="the-operator", role="operator"),
        reason="not safe",
        key="k",
        cycle=1,
        subject=Digest(form["subject"]),
    )
    assert still(word) is None
    store.change_account(replace(account, roles=("viewer",)))
    refused = still(word)
    assert isinstance(refused, Refused) and refused.rule == "role_revoked"
    decided = stand.harness.runtime.commit([CommandEnvelope(handoff_stream(handoff_id), word, None)])
    assert isinstance(decided, Refused) and decided.rule == "role_revoked"
    assert stand.harness.runtime.handoff(handoff_id).status == "open"


def test_two_approvals_at_once_on_fresh_evidence_start_the_action_once(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    """Both people looked again and saw the same; one answer counts, and the other learns that it came second."""
    _, handoff_id = waiting
    accounts = stand.app.state.sessions.accounts
    for name, roles in (("root", ["admin"]), ("ada", ["operator"]), ("bob", ["operator"])):
        accounts.add(name, roles=roles, password=PASSWORD, by=SETTING_UP)
    people = [browser(stand, name) for name in ("ada", "bob")]
    assert people[0].post(f"/handoffs/{handoff_id}/look").status_code == 303
    forms = [
        {**shown(one, handoff_id), "decision": "approve", "reason": "seen on camera", "key": f"key-{number}"}
        for number, one in enumerate(people)
    ]
    assert forms[0]["subject"] == forms[1]["subject"]
    before = starts(stand, waiting[0])
    barrier = Barrier(2)

    def approve(number: int) -> int:
        barrier.wait(60.0)
        return people[number].post(f"/handoffs/{handoff_id}/decision", data=forms[number]).status_code

    with ThreadPoolExecutor(2) as pool:
        statuses = sorted(pool.map(approve, range(2)))
    assert statuses == [303, 409], statuses
    approved = [
        event
        for event in stand.harness.runtime.log(0, 10_000)
        if event.stream == f"handoff/{handoff_id}" and event.kind.startswith("HandoffApproved")
    ]
    assert len(approved) == 1
    assert starts(stand, waiting[0]) - before <= 1


def test_a_slower_start_is_proposed_from_the_page_and_is_what_the_approval_sends(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    mission, handoff_id = waiting
    operator = stand.operator()
    page = operator.get(f"/handoffs/{handoff_id}").text
    assert "Slower: at most 0.25 m/s" in page and "Wait 30 s, then do it" in page
    chosen = {"action": "retry", "speed_cap_mps": "0.25", "cycle": shown(operator, handoff_id)["cycle"]}
    assert operator.post(f"/handoffs/{handoff_id}/choose", data=chosen).status_code == 303
    later = operator.get(f"/handoffs/{handoff_id}").text.partition('name="wait_s" value="30.0"')[2]
    assert 'name="speed_cap_mps" value="0.25"' in later.partition("</form>")[0], "waiting too keeps the speed"
    form = {**shown(operator, handoff_id), "decision": "approve", "reason": "narrow there"}
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 303
    invocation = stand.harness.runtime.mission(mission.mission_id).invocation
    assert invocation is not None and invocation.intent.parameters["speed_cap_mps"] == 0.25


def test_waiting_at_another_place_is_proposed_from_the_page_and_begins_with_the_way_there(stand: Stand) -> None:
    mission = stand.run(faults="blocked-passage:persistent")
    handoff_id, operator = mission.handoff_id, stand.operator()
    assert handoff_id is not None
    page = operator.get(f"/handoffs/{handoff_id}").text
    assert "Wait 60 s at Anchor A, then go on" in page
    chosen = {"action": "local_replan", "wait_s": "60", "waiting_place": "anchor_a"}
    cycle = shown(operator, handoff_id)["cycle"]
    assert operator.post(f"/handoffs/{handoff_id}/choose", data={**chosen, "cycle": cycle}).status_code == 303
    page = operator.get(f"/handoffs/{handoff_id}").text
    assert "Wait 60 s at Anchor A, then go on, once" in page
    form = {**shown(operator, handoff_id), "decision": "approve", "reason": "let them clear it"}
    assert operator.post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 303
    invocation = stand.harness.runtime.mission(mission.mission_id).invocation
    assert invocation is not None and invocation.intent.node_id == "aside-1"


def test_a_refused_form_keeps_what_was_typed_in_it_and_no_other_form_does(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    operator, handoff_id = stand.operator(), waiting[1]
    binding = shown(operator, handoff_id)
    chosen = {"action": "verify_again", "wait_s": "500", "cycle": binding["cycle"]}
    answer = operator.post(f"/handoffs/{handoff_id}/choose", data=chosen)
    assert answer.status_code == 422
    assert "0 to 90 seconds" in answer.text and 'value="500"' in answer.text
    taken = operator.post(f"/handoffs/{handoff_id}/take-over", data={"device": "desk 2", "claim": "t", "key": "k"})
    assert taken.status_code == 422
    assert 'value="desk 2"' in taken.text and 'value="500"' not in taken.text


def test_a_mission_is_paused_and_resumed_on_the_page_of_its_question(
    stand: Stand, waiting: tuple[Mission, HandoffId]
) -> None:
    operator, (mission, handoff_id) = stand.operator(), waiting
    assert operator.post(f"/handoffs/{handoff_id}/pause", data={}).status_code == 422
    paused = operator.post(f"/handoffs/{handoff_id}/pause", data={"reason": "visitors"})
    assert (paused.status_code, paused.headers["location"]) == (303, f"/handoffs/{handoff_id}")
    page = operator.get(f"/handoffs/{handoff_id}").text
    assert "The mission is paused." in page and f'action="/handoffs/{handoff_id}/resume"' in page
    head = operator.get(f"/missions/{mission.mission_id}/head").text
    assert re.search(rf'href="/robots/{mission.robot_id}#this-mission"\s*>Resume</a>', head)
    resumed = operator.post(f"/handoffs/{handoff_id}/resume", data={"reason": "they left"})
    assert resumed.status_code == 303
    assert stand.harness.runtime.mission(mission.mission_id).status == "awaiting_human"
    assert "The mission is paused." not in operator.get(f"/handoffs/{handoff_id}").text
