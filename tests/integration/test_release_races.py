"""Sixteen persons at one release: a slice of `python -m experiments.campaigns run --only releases`."""

from experiments.campaigns.release_races import release_races


def test_one_decision_is_taken_and_the_pointer_moves_once() -> None:
    report = release_races(9)
    assert report.offences == ()
    assert (report.rounds, report.effective, report.responders) == (9, 9, 16)
