"""Nobody answered and nothing shows what the robot did: an alert of its own; what was shown to be done is none."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.alert_commands import RaiseAlert
from harness.contracts.handoff_events import NoAnswerTaken
from harness.contracts.reasons import recorded
from harness.projections.alert_causes import About, of_handoff

ABOUT = About(mission_id="msn_1", robot_id="vbot-1", goal="patrol", position=9, at_s=1.0, node="go")


@pytest.mark.parametrize("done", [True, False])
def test_an_action_that_is_not_shown_to_be_done_calls_a_person(done: bool) -> None:
    event = NoAnswerTaken(action="retreat", done=done, measured={}, reason=recorded("nobody can say"), at_s=1.0)
    told = of_handoff(event, ABOUT, "hof_1")
    if done:
        assert told == ()
    else:
        [(_, raised)] = told
        assert isinstance(raised, RaiseAlert) and raised.occurrence.priority == "critical"
        assert "retreat" in sentence(raised.occurrence.title) and "nobody can say" in sentence(raised.occurrence.text)
