"""Logs and sites of earlier releases know no retreat: they read as they did."""

import msgspec

from harness.contracts.control import ControlEvent
from harness.contracts.handoff_events import HandoffEvent, HandoffOpened
from harness.contracts.places import Zone
from harness.contracts.values import decode, encode
from harness.gate.control import DECIDER
from harness.projections.control import SiteControl
from tests.builders.waiting import waiting


def test_a_question_of_an_earlier_log_names_no_safe_place() -> None:
    with waiting() as made:
        opened = made.asked().told[0]
    assert isinstance(opened, HandoffOpened)
    body = msgspec.json.decode(encode(opened))
    del body["safe_place"], body["otherwise"]
    read = decode(encode(body), HandoffEvent)  # type: ignore[arg-type]
    assert isinstance(read, HandoffOpened)
    assert (read.safe_place, read.otherwise, read.no_answer) == ("", "", opened.no_answer)


def test_the_control_stream_of_an_earlier_log_folds_to_no_retreat() -> None:
    old = b'{"kind":"PostureOrdered","robot_id":"r","posture":"lying","actor":{"name":"a","role":"x"},"reason":"x"}'
    state = DECIDER.fold(DECIDER.initial, [decode(old, ControlEvent)])  # type: ignore[arg-type]
    assert isinstance(state, SiteControl) and state.retreats == {} and state.version == 1


def test_a_zone_of_an_earlier_site_declares_no_retreat() -> None:
    old = b'{"name":"z","frame":"map","region_m":[],"no_answer":"hold","hold_limit_s":60.0}'
    assert decode(old, Zone).retreat is None
