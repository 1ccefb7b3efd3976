"""An alert's states after ISA-18.2: one cause is one alert, whatever happens and whoever looks after it."""

from functools import reduce

import pytest

from harness.contracts.actors import Actor
from harness.contracts.alert_commands import (
    AcknowledgeAlert,
    AlertCommand,
    AssignAlert,
    ClearAlert,
    RaiseAlert,
    RestoreAlert,
    ShelveAlert,
    SuppressAlert,
)
from harness.contracts.alert_events import LONGEST_SHELF_S, Occurrence, Priority
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.values import Moment
from harness.gate.alerts import DECIDER, decide
from harness.projections.alerts import Alert, status

ADA = Actor(name="ada", role="operator")
T0 = 1_000.0


def at(now_s: float) -> Moment:
    return Moment(mission_s=now_s, wall_s=now_s)


def happened(*, source: int = 0, condition: str = "", priority: Priority = "high") -> RaiseAlert:
    """Something about one cause."""
    occurrence = Occurrence(
        cause="robot/vbot-1/link", kind="robot_lost", priority=priority, title="vbot-1 does not answer", text="silent",
        condition=condition, source=source,
    )  # fmt: skip
    return RaiseAlert(occurrence=occurrence, at_s=T0)


def after(*commands: AlertCommand, now_s: float = T0) -> Alert:
    """The alert after commands that must all be accepted."""

    def step(alert: Alert, command: AlertCommand) -> Alert:
        decision = decide(alert, command, at(now_s))
        assert isinstance(decision, Accepted), decision
        return DECIDER.fold(alert, decision.events)

    return reduce(step, commands, Alert())


def acknowledged(seen: int = 1) -> AcknowledgeAlert:
    return AcknowledgeAlert(actor=ADA, seen=seen)


OVER = ClearAlert(condition="silent", reason="it answers", at_s=T0)
SILENT = happened(condition="silent")


@pytest.mark.parametrize(
    ("commands", "state"),
    [
        ((SILENT,), "unacknowledged"),
        ((SILENT, acknowledged()), "acknowledged"),
        ((SILENT, OVER), "returned"),
        ((SILENT, OVER, acknowledged()), "normal"),
        ((SILENT, acknowledged(), OVER), "normal"),
        ((SILENT, acknowledged(), OVER, SILENT), "unacknowledged"),
        ((happened(source=3),), "unacknowledged"),
        ((happened(source=3), acknowledged()), "normal"),
        ((SILENT, SuppressAlert(actor=ADA, reason="in the workshop")), "suppressed"),
        ((SILENT, SuppressAlert(actor=ADA, reason="x"), RestoreAlert(actor=ADA)), "unacknowledged"),
    ],
)
def test_every_way_leads_to_the_state_that_the_standard_names(commands: tuple[AlertCommand, ...], state: str) -> None:
    assert status(after(*commands), T0) == state


def test_a_shelved_alert_comes_back_by_itself() -> None:
    alert = after(SILENT, ShelveAlert(actor=ADA, reason="known", for_s=60.0))
    assert status(alert, T0 + 59.0) == "shelved"
    assert status(alert, T0 + 60.0) == "unacknowledged"


def test_nobody_shelves_for_longer_than_a_day() -> None:
    decision = decide(after(SILENT), ShelveAlert(actor=ADA, reason="known", for_s=LONGEST_SHELF_S + 1), at(T0))
    assert isinstance(decision, Refused)
    assert decision.rule == "too_long"


def test_what_happens_while_it_is_put_away_counts_and_stays_put_away() -> None:
    alert = after(SILENT, SuppressAlert(actor=ADA, reason="in the workshop"), happened(source=9))
    assert (status(alert, T0), alert.count) == ("suppressed", 2)


def test_several_events_of_one_cause_are_one_alert_with_a_count_and_the_highest_priority() -> None:
    alert = after(happened(source=4, priority="critical"), happened(source=5), happened(source=6, priority="low"))
    assert (alert.count, alert.total, alert.priority) == (3, 3, "critical")


def test_an_event_of_the_log_that_is_told_twice_counts_once() -> None:
    alert = after(happened(source=4), happened(source=5), happened(source=4), happened(source=5))
    assert alert.total == 2


def test_a_condition_that_lasts_is_one_occurrence() -> None:
    assert after(SILENT, SILENT, SILENT).total == 1


def test_an_acknowledgement_of_what_was_shown_does_not_cover_what_came_after() -> None:
    alert = after(happened(source=4), happened(source=5))
    decision = decide(alert, acknowledged(seen=1), at(T0))
    assert isinstance(decision, Refused)
    assert decision.rule == "happened_again"
    assert isinstance(decide(alert, acknowledged(seen=2), at(T0)), Accepted)


def test_after_a_normal_state_the_count_begins_again_and_the_total_goes_on() -> None:
    alert = after(SILENT, acknowledged(), OVER, SILENT)
    assert (alert.count, alert.total) == (1, 2)


def test_an_alert_is_over_when_nothing_of_it_lasts_any_more() -> None:
    both = after(SILENT, happened(condition="starting"), OVER)
    assert both.standing == ("starting",)
    assert status(both, T0) == "unacknowledged"


def test_nothing_can_be_done_about_an_alert_that_was_never_raised() -> None:
    for command in (acknowledged(), OVER, AssignAlert(actor=ADA, assignee="eve"), RestoreAlert(actor=ADA)):
        assert isinstance(decide(Alert(), command, at(T0)), Refused)


def test_whoever_looks_after_it_is_told_and_can_be_taken_back() -> None:
    alert = after(SILENT, AssignAlert(actor=ADA, assignee="eve"))
    assert alert.assignee == "eve"
    assert after(SILENT, AssignAlert(actor=ADA, assignee="eve"), AssignAlert(actor=ADA, assignee="")).assignee == ""
