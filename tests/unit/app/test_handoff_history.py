"""The history of a handoff says what happened: how long nobody took it, who asked, and who was notified."""

import msgspec
import pytest

from app.views.handoffs import history, notified_of
from harness.contracts.actors import Actor
from harness.contracts.alert_events import AlertNotified, Occurrence
from harness.contracts.handoff_events import EscalationLevel, HandoffEscalated, HandoffExpired, HandoffOpened
from harness.projections.alerts import Alert

AT_S = 1000.0


@pytest.fixture
def opened() -> HandoffOpened:
    body = {
        "handoff_id": "handoff_1",
        "mission_id": "mission_1",
        "robot_id": "vbot-1",
        "node_id": "dock",
        "k": 0,
        "cycle": 1,
        "failure": "no_progress",
        "reason": "it stands",
        "risk": "low",
        "proposal": None,
        "subject": "0" * 64,
        "snapshot": {
            "at_s": 0.0,
            "taken_at_s": AT_S,
            "x_m": 0.0,
            "y_m": 0.0,
            "yaw_rad": 0.0,
            "static": True,
            "results": "0" * 64,
            "image": None,
        },
        "evidence": "0" * 64,
        "no_answer": "hold",
        "opened_at_s": AT_S,
        "deadline_at_s": AT_S + 300.0,
    }
    return msgspec.convert(body, HandoffOpened)


def alert(mission_id: str, *notes: AlertNotified) -> Alert:
    newest = Occurrence(cause="c", kind="handoff", priority="high", title="t", text="t", mission_id=mission_id)
    return Alert(newest=newest, notified=notes)


def note(service: str, at_s: float, *, failed: bool = False) -> AlertNotified:
    return AlertNotified(service=service, outcome="failed" if failed else "sent", tries=1, reason="", at_s=at_s)


@pytest.mark.parametrize(
    ("level", "text"),
    [
        ("sound", "announced in the open consoles"),
        ("next_person", "nobody took it for a minute"),
        ("outside", "nobody took it for three minutes"),
    ],
)
def test_a_level_of_escalation_says_how_long_nobody_took_it_and_claims_no_message(
    level: EscalationLevel, text: str
) -> None:
    (line,) = history([(7, AT_S, HandoffEscalated(level=level, at_s=AT_S))])
    assert line.text == text


def test_a_person_who_asked_a_colleague_is_named() -> None:
    asked = HandoffEscalated(level="outside", at_s=AT_S, actor=Actor(name="ada", role="operator"))
    assert [one.text for one in history([(7, AT_S, asked)])] == ["ada asked a colleague"]


def test_only_notifications_that_a_service_accepted_while_the_question_stood_are_listed(opened: HandoffOpened) -> None:
    told = [(7, AT_S + 60.0, HandoffExpired(at_s=AT_S + 60.0))]
    alerts = [
        alert(opened.mission_id, note("before", AT_S - 5.0), note("ops", AT_S + 5.0), note("after", AT_S + 90.0)),
        alert(opened.mission_id, note("broken", AT_S + 5.0, failed=True)),
        alert("mission_of_others", note("elsewhere", AT_S + 5.0)),
    ]
    assert [one.service for one in notified_of(alerts, opened, told)] == ["ops"]
    assert notified_of([], opened, told) == ()
