"""Callers killed at random under load: a short slice of the campaign, and the judge that must see what it is for."""

from collections import Counter
from pathlib import Path

import msgspec
import pytest

from experiments.campaigns.hammer import HammerReport, hammer
from experiments.campaigns.hammer_asks import Answer, CallerJournal, HammerRequest, Kind, read_journal
from experiments.campaigns.hammer_judge import Keys, misplaced
from experiments.campaigns.ledgers import exclusive_leases
from experiments.campaigns.publish import BEGIN, END, with_figures
from harness.contracts.decider import Codec
from harness.contracts.ids import InvocationId, MissionId, ResourceId, StreamId, sha256
from harness.contracts.lease_events import LeaseAcquired, LeaseEvent, LeaseReleased
from harness.contracts.ports import StoredEvent

DECISIONS, CALLERS, SEEDS = 250, 2, (3, 4, 5, 6)
BASE = ResourceId("vbot-1/mobile_base")
CODEC: Codec[LeaseEvent] = Codec(LeaseEvent)


def standing(key: str, *events: tuple[str, int]) -> Keys:
    keys = Keys()
    for kind, position in events:
        keys.note(key, kind, position)
    return keys


def taken(by: str, token: int) -> LeaseAcquired:
    return LeaseAcquired(
        resource=BASE, mission_id=MissionId("mis_1"), invocation_id=InvocationId(by), token=token, expires_s=1.0
    )


def log_of(*events: LeaseEvent) -> list[StoredEvent]:
    stream = StreamId(f"lease/{BASE}")
    return [
        StoredEvent(
            position=number,
            stream=stream,
            version=number,
            kind=new.kind,
            body=new.body,
            mission_s=0.0,
            recorded_s=0.0,
            previous=sha256(b""),
            digest=sha256(b""),
        )
        for number, new in enumerate(map(CODEC.encode, events), start=1)
    ]


def hammered(seed: int) -> HammerReport:
    """A slice without offence. Where a kill strikes is up to the machine: none may fall into a decision."""
    report = hammer(DECISIONS, seed=seed, callers=CALLERS, between_s=(0.3, 0.9))
    assert report.offences == ()
    assert (report.lost, report.doubled) == (0, 0)
    assert report.decisions >= DECISIONS and report.in_question >= report.stood
    return report


def test_callers_that_are_killed_under_load_lose_no_decision_and_double_none() -> None:
    report = next(one for one in map(hammered, SEEDS) if one.stood and one.kills >= CALLERS and one.refusals)
    assert report.events > report.decisions and report.streams > report.snapshots > 0
    page = with_figures(f"{BEGIN}{END}", {"hammer": msgspec.to_builtins(report)})
    assert f"| {report.decisions} acknowledged by {CALLERS} callers, {report.refusals} refused |" in page
    assert f"| 0 lost, 0 doubled, {report.streams} states from zero, no offence |" in page


@pytest.mark.parametrize(
    ("kind", "answer", "events", "found"),
    [
        ("veto", "done", [], "is lost: 0 of 1 stand"),
        ("answer", "done", [("HandoffApproved", 4)], "is lost: 1 of 2 stand"),
        ("veto", "", [("VetoRaised", 4), ("VetoRaised", 9)], "stands twice"),
        ("answer", "", [("HandoffApproved", 4)], "1 of 2 stand"),
        ("lease", "refused", [("LeaseAcquired", 4)], "was refused and stands"),
        ("answer", "done", [("HandoffApproved", 4), ("LeaseAcquired", 6)], "with others' between"),
    ],
)
def test_a_decision_that_is_lost_doubled_halved_or_torn_is_found(
    kind: Kind, answer: Answer, events: list[tuple[str, int]], found: str
) -> None:
    sentences = list(misplaced(HammerRequest(key="c0-1", kind=kind), standing("c0-1", *events), answer))
    assert len(sentences) == 1 and found in sentences[0]


def test_a_decision_that_stands_as_its_caller_was_told_is_no_offence() -> None:
    keys = standing("c0-1", ("HandoffApproved", 4), ("LeaseAcquired", 5))
    for answer in ("done", ""):
        assert list(misplaced(HammerRequest(key="c0-1", kind="answer"), keys, answer)) == []
    assert list(misplaced(HammerRequest(key="c0-2", kind="answer"), keys, "")) == []


def test_a_journal_tells_what_was_asked_what_was_answered_and_what_was_left_open(tmp_path: Path) -> None:
    file = tmp_path / "caller-0.jsonl"
    first, second = HammerRequest(key="c0-0", kind="mission"), HammerRequest(key="c0-1", kind="veto", slot=2)
    with CallerJournal(file) as journal:
        journal.asks(first)
        journal.hears(first.key, "done")
        journal.asks(second)
    assert read_journal(file).open == second
    with CallerJournal(file) as journal:
        journal.asks(second)
        journal.hears(second.key, "refused")
    with file.open("ab") as torn:
        torn.write(b'{"ask":{"key":"c0-2"')
    said = read_journal(file)
    assert (said.asks, said.open) == ((first, second), None)
    assert said.again == frozenset({second.key})
    assert Counter(said.answers.values()) == Counter({"done": 1, "refused": 1})


def test_a_resource_that_two_hold_at_once_is_found_in_a_whole_log() -> None:
    released = LeaseReleased(invocation_id=InvocationId("inv_1"), reason="at rest")
    assert list(exclusive_leases(log_of(taken("inv_1", 1), released, taken("inv_2", 2)))) == []
    (both,) = exclusive_leases(log_of(taken("inv_1", 1), taken("inv_2", 2)))
    assert "was given to inv_2 while inv_1 had it" in both
    (stale,) = exclusive_leases(log_of(taken("inv_1", 1), released, taken("inv_2", 1)))
    assert "with token 1 after 1" in stale
