"""A command is stored without what its commit's events and records say, and is read back as it was given."""

from typing import Any, get_args

import msgspec
import pytest

from harness.contracts import commands, handoff_commands
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.events import MissionPaused, VetoRaised
from harness.contracts.handoff_events import HandoffClaimed
from harness.contracts.ids import MissionId, sha256
from harness.contracts.ports import Record
from harness.contracts.stored_commands import (
    command_json,
    command_record,
    stored_command,
    with_command,
    without_command,
)
from harness.contracts.values import decode, digest, encode
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from rsi_reviews.events import CandidateEvent, PointerEvent
from rsi_reviews.refused_proposals import ProposalRefused
from rsi_reviews.suite_growth import CaseAdded
from tests.builders.gate import NOW, creation

ADA = Actor(name="ada", role="operator")
WHY = "a visitor stands in the second corridor"


def read(record: Record, events: list[Any], union: Any, *, records: tuple[Record, ...] = (), tokens: Any = ()) -> Any:
    bodies = [with_command(encode(events[0]), record.digest), *(encode(event) for event in events[1:])]
    known = {one.digest: one.body for one in records}
    return decode(command_json(stored_command(record.body), bodies, known, tokens), union)


def test_a_command_comes_back_as_it_was_given_and_long_texts_are_named() -> None:
    paused = commands.PauseMission(actor=ADA, reason=WHY)
    events = [MissionPaused(actor=ADA, reason=WHY)]
    record = command_record(paused, events)
    assert sha256(record.body) == record.digest
    assert WHY.encode() not in record.body
    assert read(record, events, commands.MissionCommand) == paused


def test_a_contract_is_named_in_the_event_that_holds_it() -> None:
    create = creation(MissionId("msn_1"))
    decision = DECIDER.decide(Mission(), create, NOW)
    events = list(decision.events)  # type: ignore[union-attr]
    record = command_record(create, events)
    assert len(record.body) < len(encode(create)) / 4
    assert read(record, events, commands.MissionCommand) == create


def test_a_claim_token_and_a_key_are_stored_as_digests() -> None:
    take = handoff_commands.TakeClaim(actor=ADA, claim="the window of ada")
    events = [HandoffClaimed(actor=ADA, claim="the window of ada", at_s=1.0, until_at_s=61.0)]
    record = command_record(take, events)
    assert b"the window of ada" not in record.body
    assert sha256(b"the window of ada").encode() in record.body
    assert read(record, events, commands.HandoffCommand, tokens=["another", "the window of ada"]) == take
    with pytest.raises(LookupError):
        read(record, events, commands.HandoffCommand, tokens=["another"])


def test_a_value_that_is_a_record_of_the_commit_is_named_by_its_digest() -> None:
    create = creation(MissionId("msn_1"))
    policy = Record(digest=digest(create.policy), kind="policy", body=encode(create.policy))
    event = VetoRaised(layer="site", reason="unrelated")
    record = command_record(create, [event], (policy,))
    assert policy.digest.encode() in record.body and policy.body not in record.body
    assert read(record, [event], commands.MissionCommand, records=(policy,)) == create


def test_another_value_of_an_event_of_the_same_name_is_not_taken_for_the_commands() -> None:
    paused = commands.PauseMission(actor=ADA, reason=WHY)
    events = [MissionPaused(actor=ADA, reason=WHY.upper())]
    assert read(command_record(paused, events), events, commands.MissionCommand) == paused


def test_an_event_is_the_same_with_and_without_the_digest_of_its_command() -> None:
    event = VetoRaised(layer="site", reason='ends as one: ,"command":"' + "0" * 64 + '"}')
    body = encode(event)
    assert without_command(body) == body
    told = with_command(body, sha256(b"command"))
    assert without_command(told) == body
    assert msgspec.json.decode(told)["command"] == sha256(b"command")


def test_no_event_has_a_member_of_that_name_itself() -> None:
    kinds = (*get_args(AnyEvent), *get_args(CandidateEvent), *get_args(PointerEvent), CaseAdded, ProposalRefused)
    assert [kind.__name__ for kind in kinds if "command" in kind.__struct_fields__] == []
