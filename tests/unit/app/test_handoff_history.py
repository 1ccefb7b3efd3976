"""A handoff's history says of an escalation what it did here, and of nobody that was never configured."""

import pytest

from app.views.handoffs import history
from harness.contracts.actors import Actor
from harness.contracts.handoff_events import EscalationLevel, HandoffEscalated

ADA = Actor(name="ada", role="operator")


@pytest.mark.parametrize(
    ("level", "services", "said"),
    [
        ("sound", (), "open consoles played a sound"),
        ("next_person", (), "no service is configured"),
        ("outside", (), "no service is configured"),
        ("next_person", ("night desk",), "notified: night desk"),
        ("outside", ("night desk", "pager"), "notified: night desk, pager"),
    ],
)
def test_an_escalation_names_only_what_was_called(level: EscalationLevel, services: tuple[str, ...], said: str) -> None:
    (line,) = history([(7, 12.0, HandoffEscalated(level=level, at_s=12.0))], services)
    assert said in line.text
    assert level not in ("next_person", "outside") or level.replace("_", " ") not in line.text


def test_a_colleague_who_was_asked_early_is_said_with_who_asked() -> None:
    (line,) = history([(7, 12.0, HandoffEscalated(level="next_person", at_s=12.0, actor=ADA))], ("pager",))
    assert line.text == "nobody had taken it; notified: pager, asked by ada"
