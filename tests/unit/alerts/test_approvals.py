"""A question that only waits for a yes is no trouble: its alert says so, less urgent than one after a failure."""

import pytest

from app.views.handoffs import asking
from harness.contracts.alert_commands import RaiseAlert
from harness.contracts.configuration import FailureClass
from harness.contracts.events import HandoffRequested
from harness.contracts.ids import HandoffId, NodeId
from harness.contracts.reasons import Reason, because
from harness.contracts.routine_approvals import is_routine
from harness.projections.alert_causes import About, of_mission

CANARY = because(
    "next_step",
    failure=because(
        "failure_explained",
        failure="precondition_unmet",
        why=because("approval_required", why=because("configuration_in_canary", configuration="7ac5782ab050")),
    ),
)
BLOCKED = because("next_step", failure=because("failure_explained", failure="no_progress", why="it stood still"))


@pytest.mark.parametrize(
    ("failure", "reason", "routine"),
    [
        ("precondition_unmet", CANARY, True),
        ("no_progress", CANARY, False),
        ("precondition_unmet", BLOCKED, False),
        ("precondition_unmet", "in canary, said by an older release", False),
    ],
)
def test_only_a_start_that_a_rule_asks_about_is_routine(
    failure: FailureClass, reason: Reason | str, routine: bool
) -> None:
    assert is_routine(failure, reason) is routine
    event = HandoffRequested(handoff_id=HandoffId("hof_1"), node_id=NodeId("go"), failure=failure, reason=reason)
    about = About(mission_id="msn_1", robot_id="vbot-1", goal="patrol", position=3, at_s=1.0, failure=failure)
    ((_, asked),) = of_mission(event, about)
    assert isinstance(asked, RaiseAlert)
    assert asked.occurrence.priority == ("medium" if routine else "high")


def test_the_title_says_that_a_yes_is_asked_for() -> None:
    assert str(asking("vbot-1", "Go", waits=True, routine=True)) == "vbot-1 waits for your yes before “Go”"
    assert str(asking("vbot-1", "Go", waits=True)) == "vbot-1 cannot finish “Go” and asks you"
