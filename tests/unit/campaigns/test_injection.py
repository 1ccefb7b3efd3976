"""Texts that give orders, wherever text comes in from outside: no decision becomes another one."""

from experiments.campaigns.injection import PLACES, decisions, injections, texts


def test_the_corpus_has_at_least_two_hundred_texts_of_their_own() -> None:
    assert len(set(texts())) == len(texts()) >= 200


def test_no_text_changes_a_decision_in_any_place() -> None:
    found = injections(every=117)
    assert found.changed == ()
    assert (found.trials, set(found.places)) == (2 * len(PLACES), set(PLACES))


def test_the_mission_that_is_compared_recovers_and_ends() -> None:
    found = decisions()
    assert ("recovery" in {one[0] for one in found}) and found[-1] == ("end", "succeeded")
