"""What gets on record at all: refused by rule before anything runs, or kept with its manifest and its authors."""

from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Refused
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest
from harness.contracts.reasons import plain
from harness.contracts.stored_commands import without_command
from harness.contracts.values import digest
from rsi_reviews.contracts import Author
from rsi_reviews.events import CandidateProposed
from tests.builders.releases import (
    LAUNCHER,
    MINER,
    REVIEWER,
    bench,
    candidate,
    expect,
    manifest,
    rule_of,
    say,
    terms_of,
    tried,
)
from tests.saying import raises_saying


def widened() -> Configuration:
    tree = msgspec.json.decode(msgspec.json.encode(baseline()))
    circuit = next(template for template in tree["templates"] if template["name"] == "circuit")
    circuit["nodes"][1]["success_conditions"][0]["effect"]["tolerance_m"] = 2.0
    return msgspec.convert(tree, Configuration)


@pytest.mark.ledger("R162", symbol="rsi_reviews.proposal_rules:propose")
def test_a_loosening_leaves_no_trace_and_is_refused_with_its_path() -> None:
    with bench() as on:
        refused = on.releases.propose(candidate(widened(), component="templates"), say(LAUNCHER))
        assert rule_of(refused) == "tolerance"
        assert isinstance(refused, Refused) and "tolerance_m" in plain(refused.reason)
        assert on.releases.reviews() == []


def test_all_refusals_can_be_asked_for_without_proposing() -> None:
    with bench() as on:
        made = candidate(replace(widened(), recovery=tried().recovery), component="templates")
        assert [one.rule for one in on.releases.refusals(made)] == ["other_component", "tolerance"]


@pytest.mark.ledger("R156", symbol="rsi_reviews.proposal_rules:propose")
def test_manifest_and_its_digest_are_on_record_before_anything_runs() -> None:
    with bench() as on:
        name = on.proposed(candidate())
        (stored,) = on.releases.events(name)
        event = msgspec.json.decode(without_command(stored.body), type=CandidateProposed)
        assert (event.manifest, event.manifest_digest) == (manifest(), digest(manifest()))
        assert event.sections == ("recovery",)
        assert on.releases.candidate(name) == candidate()


def test_the_same_proposal_again_is_the_same_receipt() -> None:
    with bench() as on:
        first, again = (on.releases.propose(candidate(), say(LAUNCHER, key="one")) for _ in range(2))
        assert len(expect(first).events) == 1 and expect(again).events == ()
        other = on.releases.propose(candidate(), say(LAUNCHER, reason="for another reason", key="one"))
        assert rule_of(other) == "key_reused"
        assert rule_of(on.releases.propose(candidate(), say(LAUNCHER))) == "exists"


def test_a_candidate_against_another_baseline_is_refused() -> None:
    with bench() as on:
        foreign = Digest("a" * 64)
        assert (
            rule_of(on.releases.propose(candidate(baseline=foreign, rollback=foreign), say(LAUNCHER)))
            == "other_baseline"
        )


def authors(**stated: Any) -> set[str]:
    with bench() as on:
        name = on.proposed(candidate(**stated))
        expect(on.releases.begin(terms_of(candidate(**stated), suite_edited_by=("eva",)), say(LAUNCHER)))
        return set(on.releases.review(name).authors)


def test_authors_are_all_who_wrote_proposed_launched_or_edited_its_suite() -> None:
    assert authors() == {MINER, "lea", "eva"}
    assert authors(author=Author(name="pia", kind="person")) == {"pia", "lea", "eva"}


def test_an_optimiser_is_an_author_but_no_person() -> None:
    with bench() as on:
        name = on.proposed(candidate())
        expect(on.releases.begin(terms_of(candidate(), launched_by=(MINER, "lea")), say(LAUNCHER)))
        assert {hand.name for hand in on.releases.review(name).hands if hand.person} == {"lea"}
        assert {hand.name for hand in on.releases.review(name).hands if not hand.person} == {MINER}


def test_who_wrote_what_a_candidate_edits_or_repeats_stays_its_author() -> None:
    with bench() as on:
        first = on.proposed(candidate(author=Author(name="pia", kind="person")))
        edited = candidate(tried(wait_s=12.0), author=Author(name="otto", kind="person"))
        expect(on.releases.propose(edited, say(REVIEWER), supersedes=first))
        assert {"pia", "lea", "otto", "rob"} <= on.releases.review(edited.candidate_id).authors
        renamed = candidate(reason="The very same change.", author=Author(name="uma", kind="person"))
        expect(on.releases.propose(renamed, say(REVIEWER)))
        assert "pia" in on.releases.review(renamed.candidate_id).authors


def test_a_candidate_is_found_by_the_beginning_of_its_name_if_only_one_has_it() -> None:
    with bench() as on:
        name = on.proposed(candidate())
        assert on.releases.review(name[:10]).candidate == name
        for unknown in ("", "zz"):
            with raises_saying(UnknownName, match="candidate"):
                on.releases.review(unknown)
