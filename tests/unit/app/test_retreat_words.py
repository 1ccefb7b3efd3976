"""What persons read of a retreat: where it goes and what else, then declared and measured, never accepted."""

import pytest
from msgspec.structs import replace

from app.views.handoffs import no_answer
from app.views.report import no_answer_taken
from app.views.safe_returns import OLD_S, LastRetreat, last_retreat
from harness.contracts.handoff_events import HandoffOpened
from harness.contracts.reasons import recorded
from harness.contracts.retreat_events import RetreatEnded
from harness.projections.control import Retreating
from harness.projections.handoffs import NoAnswerAction
from tests.builders.retreating import LATE_S, newest, unanswered


@pytest.fixture(scope="module")
def told() -> tuple[HandoffOpened, Retreating]:
    """A question that expired, and the retreat that followed."""
    with unanswered() as asked:
        asked.pass_s(LATE_S)
        asked.run()
        assert asked.handoff.opened is not None
        return asked.handoff.opened, newest(asked)


def test_the_page_says_where_the_robot_goes_and_what_it_does_where_it_cannot(
    told: tuple[HandoffOpened, Retreating],
) -> None:
    opened, _ = told
    assert "goes to Anchor A" in no_answer(opened) and "lies down" in no_answer(opened)
    assert "stays where it cannot" in no_answer(replace(opened, otherwise="hold"))
    old = replace(opened, safe_place="", otherwise="", no_answer="hold")
    assert no_answer(old) == "the robot stays where it is"


def shown(retreat: Retreating, *, began_s: float = 0.0, now_s: float = 1010.0) -> LastRetreat | None:
    """What the robot's page has of a retreat whose end was recorded at 1000."""
    return last_retreat(retreat, ended_at_s=1000.0, mission_began_s=began_s, now_s=now_s)


def retreat_sentence(retreat: Retreating) -> str:
    found = shown(retreat)
    assert found is not None
    return found.text


def test_an_end_is_told_as_declared_and_measured(told: tuple[HandoffOpened, Retreating]) -> None:
    _, retreat = told
    said, ended = retreat_sentence(retreat), retreat.ended
    assert "measured 0." in said and "declared succeeded" in said and "No facts are accepted" in said
    assert isinstance(ended, RetreatEnded)
    short = replace(
        retreat, ended=replace(ended, outcome="short", reason=recorded("2.00 m from Anchor A by measurement"))
    )
    assert "arrival not confirmed. 2.00 m" in retreat_sentence(short)
    unknown = replace(retreat, ended=replace(ended, outcome="unknown", reason=recorded("nobody looked")))
    assert "how it ended is unknown, and it is not sent again" in retreat_sentence(unknown)
    assert "authorised on 2026-11-20 by surveyor of site-1" in retreat_sentence(replace(retreat, ended=None))
    assert last_retreat(None, ended_at_s=0.0, mission_began_s=0.0, now_s=0.0) is None


def test_an_end_stays_on_the_page_for_a_day_or_until_the_robots_next_mission(
    told: tuple[HandoffOpened, Retreating],
) -> None:
    _, retreat = told
    assert shown(retreat, now_s=1000.0 + OLD_S - 1) is not None
    assert shown(retreat, now_s=1000.0 + OLD_S) is None
    assert shown(retreat, began_s=999.0) is not None, "the mission that it followed began before"
    assert shown(retreat, began_s=1001.0) is None
    open_still = shown(replace(retreat, ended=None), began_s=1001.0, now_s=1000.0 + 2 * OLD_S)
    assert open_still is not None and open_still.moving, "one that is under way is never old"


@pytest.mark.parametrize(("done", "said"), [(True, "shown to be done"), (False, "not shown to be done")])
def test_the_report_says_what_the_robot_did_without_an_answer(done: bool, said: str) -> None:
    reason = recorded("the robot declares itself lying")
    told = no_answer_taken(NoAnswerAction(action="lie_down", done=done, reason=reason, at_s=1.0))
    assert told == f"without an answer: lie down where it is, {said}. the robot declares itself lying"
