"""From a result to a failure class: unsafe first, else how the execution ended, else the verdict."""

from typing import get_args

import pytest

from harness.contracts.configuration import FailureClass
from harness.contracts.protocol import InvocationStatus
from harness.contracts.verdicts import Verdict
from harness.recovery.classify import classify


@pytest.mark.ledger("R122", symbol="harness.recovery.classify:classify")
@pytest.mark.parametrize(
    ("verdict", "failure"),
    [
        ("unsafe", "unsafe_action"),
        ("stale", "stale_evidence"),
        ("violated", "violated"),
        ("ambiguous", "ambiguous"),
        ("satisfied", None),
    ],
)
def test_every_verdict_but_satisfied_is_a_failure_of_its_class(verdict: Verdict, failure: FailureClass | None) -> None:
    rule = "" if failure is None else "not_satisfied"
    assert classify(verdict=verdict, terminal="succeeded", rule=rule) == failure


@pytest.mark.parametrize("word", get_args(FailureClass))
def test_a_failure_word_that_names_a_class_is_that_class(word: FailureClass) -> None:
    assert classify(verdict="violated", terminal="failed", failure_word=word, rule="not_satisfied") == word


@pytest.mark.parametrize(
    ("word", "failure"),
    [
        ("robot_restarted", "interrupted"),
        ("deadline", "timeout"),
        ("Blocked passage", "no_progress"),
        ("fencing-refused", "resource_conflict"),
        ("provider_unreachable", "provider_unavailable"),
        ("collision", "unsafe_action"),
        ("passage_not_seen", "target_not_found"),
        ("poses_disagree", "ambiguous"),
        ("playback_differs", "interrupted"),
        ("store_unavailable", "provider_unavailable"),
        ("localisation_lost", "precondition_unmet"),
    ],
)
def test_how_the_execution_ended_goes_before_the_verdict(word: str, failure: FailureClass) -> None:
    assert classify(verdict="ambiguous", terminal="failed", failure_word=word, rule="not_satisfied") == failure


def test_unsafe_goes_before_everything() -> None:
    assert classify(verdict="unsafe", terminal="failed", failure_word="timeout", rule="vetoed") == "unsafe_action"
    assert classify(verdict="unsafe", terminal="outcome_unknown") == "unsafe_action"


@pytest.mark.parametrize(
    ("terminal", "failure"), [("outcome_unknown", "outcome_unknown"), ("stopping", "cancel_unacknowledged")]
)
def test_an_open_ending_is_its_own_class(terminal: InvocationStatus, failure: FailureClass) -> None:
    assert classify(verdict=None, terminal=terminal, failure_word="timeout") == failure


def test_a_word_beside_success_is_not_how_the_execution_ended() -> None:
    assert classify(verdict="violated", terminal="succeeded", failure_word="no_progress") == "violated"


def test_a_failure_without_a_known_word_is_judged_by_its_evidence_and_without_evidence_interrupted() -> None:
    assert classify(verdict="violated", terminal="failed", failure_word="gremlins", rule="not_satisfied") == "violated"
    assert classify(verdict=None, terminal="failed") == "interrupted"
    assert classify(verdict=None, terminal="cancelled") == "interrupted"
    assert classify(verdict="satisfied", terminal="failed", rule="execution_failed") == "interrupted"


def test_a_satisfied_verdict_that_the_gate_refused_is_its_own_class() -> None:
    assert classify(verdict="satisfied", terminal="succeeded", rule="wrong_identity") == "commit_rejected"
    assert classify(verdict="satisfied", terminal="succeeded", rule="obsolete_version") == "stale_evidence"
    assert classify(verdict="violated", terminal="succeeded", rule="obsolete_version") == "stale_evidence"


def test_nothing_failed_is_no_failure() -> None:
    assert classify(verdict="satisfied", terminal="succeeded") is None
    assert classify(verdict=None, terminal=None) is None
