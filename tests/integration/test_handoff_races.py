"""Many answers at once, and crashes between the decision and the dispatch: counted on events and physical starts."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from experiments.campaigns.rivals import RIVALS, rival_rounds
from harness.contracts.actors import Actor
from harness.contracts.commands import RaiseVeto, StopMission
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import ResourceId, leased
from tests.builders.missions_run import ROBOT
from tests.builders.waiting import BOB, Waiting, waiting


@pytest.fixture
def asked(tmp_path: Path) -> Iterator[Waiting]:
    with waiting(log=tmp_path / "log.db") as made:
        yield made.asked()


def at_once(*acts: Callable[[], Any]) -> list[Any]:
    """What each got, all let loose at the same moment."""
    barrier, got = threading.Barrier(len(acts)), dict[int, Any]()

    def one(number: int) -> None:
        barrier.wait(60.0)
        got[number] = acts[number]()

    threads = [threading.Thread(target=one, args=(number,)) for number in range(len(acts))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    return [got[number] for number in range(len(acts))]


def moved(asked: Waiting, before: int) -> int:
    return sum(start.moves for start in asked.starts[before:])


def test_an_answer_against_its_rivals_ends_the_question_once() -> None:
    always_end = {"reject", "expire", "supersede"}
    report = rival_rounds(3 * len(RIVALS))
    assert report.offences == ()
    assert 3 * len(always_end) <= report.effective <= 3 * len(RIVALS)


def test_an_approval_against_a_stop_starts_what_was_approved_or_nothing(asked: Waiting) -> None:
    before = len(asked.starts)
    stop = StopMission(actor=BOB, reason="enough")
    decision, _ = at_once(asked.decide, lambda: asked.runtime.submit(asked.mission_id, stop))
    asked.run()
    approved = asked.kinds.count("HandoffApproved")
    assert approved == isinstance(decision, Accepted)
    assert moved(asked, before) <= approved <= 1
    assert asked.mission.status in ("cancelled", "failed")
    assert not asked.handoff.waits


def test_an_approval_against_a_new_veto_never_sends_what_was_vetoed(asked: Waiting) -> None:
    asked.runtime.submit(asked.mission_id, RaiseVeto(layer="site", reason="people in the hall"))
    before = len(asked.starts)
    decision = asked.decide()
    assert isinstance(decision, Refused) and decision.rule in ("obsolete_version", "vetoed")
    asked.look()
    again = asked.decide()
    assert isinstance(again, Refused)
    assert moved(asked, before) == 0 and "HandoffApproved" not in asked.kinds


def test_a_crash_between_decision_and_dispatch_is_queried_and_sent_once(asked: Waiting) -> None:
    before = len(asked.starts)
    asked.link.down = True
    assert isinstance(asked.decide(), Accepted)
    assert asked.handoff.status == "approved" and moved(asked, before) == 0
    asked.link.down = False
    asked.restart()
    asked.run()
    assert moved(asked, before) == 1
    assert len({start.request_id for start in asked.starts}) == len(asked.starts)


def test_a_crash_while_it_was_sent_is_unknown_and_a_person_is_asked_never_sent_again(asked: Waiting) -> None:
    before = len(asked.starts)
    asked.link.losing = True
    assert isinstance(asked.decide(), Accepted)
    assert asked.handoff.status == "dispatched"
    asked.link.losing = False
    asked.restart()
    asked.run()
    assert moved(asked, before) == 0
    assert asked.handoff.status == "unknown"
    assert asked.mission.status == "awaiting_human"
    assert asked.mission.handoff_id != asked.handoff_id


def test_a_holder_suspended_past_its_lease_starts_nothing_twice(asked: Waiting) -> None:
    before = len(asked.starts)
    asked.decide()
    assert moved(asked, before) == 1
    asked.harness.clock.wait_until(asked.harness.clock.now().mission_s + 240.0)
    asked.supervisor.step(asked.mission_id)
    lease = asked.runtime.lease(leased(ROBOT, ResourceId("mobile_base")))
    assert lease.status == "quarantined"
    asked.run()
    assert moved(asked, before) == 1


def test_two_persons_and_a_look_at_once_leave_one_story(asked: Waiting) -> None:
    people = [Actor(name=f"person-{number}", role="operator") for number in range(6)]
    before = len(asked.starts)
    answers = at_once(
        *(lambda who=who: asked.decide(actor=who, key=who.name) for who in people),  # type: ignore[misc]
        lambda: asked.look(people[0]),
        lambda: asked.claim(people[1], "t"),
    )
    taken = [one for one in answers[:6] if isinstance(one, Accepted) and one.events]
    assert len(taken) == asked.kinds.count("HandoffApproved") <= 1
    asked.run()
    assert moved(asked, before) == len(taken)
