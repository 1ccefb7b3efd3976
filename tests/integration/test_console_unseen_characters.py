"""No page shows a character that nobody sees, wherever the text came from; people cannot put one in."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from app.i18n.visible_text import UNSEEN
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.errors import GoalNotUnderstood
from harness.contracts.events import MissionCreated
from harness.contracts.ids import RobotId
from harness.runtime import Start
from tests.builders.console_with_roles import ConsoleWithRoles, routes
from tests.builders.consoles import Stand, console_stand

NASTY = "Please look at the office storage area \x1b[2J\x07 \u202eegarots\u2066 \u200bnow\x9b31m"
TURNED = "lea\u202e"
ENDLESS = {"/live", "/api/v1/events"}


@pytest.fixture(scope="module")
def console() -> Iterator[ConsoleWithRoles]:
    """A mission whose goal, and the name of whoever asked, came past the pages: from an older log or a program."""
    with console_stand() as stand:
        start = Start(
            actor=Actor(name=TURNED, role="operator"),
            robot_id=RobotId("vbot-1"),
            goal=NASTY,
            labels={"faults": "interrupted:persistent", "note": NASTY},
        )
        with pytest.raises(GoalNotUnderstood) as asked:
            stand.harness.runtime.start(start)
        nearest = asked.value.question.nearest
        assert nearest is not None
        begun = stand.harness.runtime.start(replace(start, confirm_reading=nearest.digest))
        assert isinstance(begun, Accepted), begun
        mission_id = next(event.mission_id for event in begun.events if isinstance(event, MissionCreated))
        handoff_id = stand.harness.supervisor.run(mission_id).handoff_id
        assert handoff_id is not None
        yield ConsoleWithRoles(stand, {"operator": stand.operator()}, mission_id, handoff_id, "none")


def test_no_page_of_the_application_holds_one(console: ConsoleWithRoles) -> None:
    operator, shown = console.people["operator"], 0
    for method, path in routes(console.stand):
        if method != "GET" or path in ENDLESS or path.startswith("/api/"):
            continue
        answer = operator.get(console.address(path))
        if answer.headers.get("content-type", "").startswith("text/"):
            found = UNSEEN.search(answer.text)
            assert found is None, (path, found)
            shown += "\u27e8U+202E\u27e9" in answer.text
    assert shown > 8, "the goal is shown on many pages, with its codes"


def test_the_report_on_paper_is_written_whatever_the_goal_holds(console: ConsoleWithRoles) -> None:
    answer = console.people["operator"].get(f"/missions/{console.mission_id}/report.pdf")
    assert (answer.status_code, answer.content[:5]) == (200, b"%PDF-")


@pytest.mark.parametrize("goal", [NASTY, "go \u202e", "go \x1b]0;x\x07"])
def test_nobody_puts_one_in_by_page_or_api(console: ConsoleWithRoles, goal: str) -> None:
    stand: Stand = console.stand
    head = stand.harness.runtime.head()
    form = {"template": "circuit", "robot_id": "vbot-1", "goal": goal}
    page = console.people["operator"].post("/missions", data=form)
    assert page.status_code == 422
    assert "invisible character" in page.text
    assert UNSEEN.search(page.text) is None
    answer = console.people["operator"].post("/api/v1/missions", json={"template": "circuit", "goal": goal})
    assert answer.status_code == 422
    assert "control or an invisible character" in answer.json()["detail"]
    reason = console.people["operator"].post(
        f"/api/v1/missions/{console.mission_id}/stop", json={"reason": f"because {goal}"}
    )
    assert reason.status_code == 422
    assert stand.harness.runtime.head() == head
