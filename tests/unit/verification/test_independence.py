"""Levels of independence under rules 2: by origin, and never better than what an answer rests on (D17)."""

import pytest

from harness.contracts.ids import ConditionId
from harness.contracts.verifier_inputs import Origins
from harness.verification.finding import FACTS, RECEIPTS, SUPERVISOR
from harness.verification.independence import Lineage, derived_independence

ROBOT = dict.fromkeys(("localiser", "odometry", "camera", "lidar"), "robot vbot-1")
FORGED = {"wheels": "10.0.0.7", "camera": "10.0.0.7", "microphone": "10.0.0.7"}


def level(*sources: str, provider: tuple[str, ...] = ("wheels",), origins: Origins, facts: tuple[int, ...] = ()) -> int:
    lineage = Lineage({ConditionId(f"c{index}"): one for index, one in enumerate(facts)})
    return derived_independence(sources, provider=provider, origins=origins, lineage=lineage)


@pytest.mark.parametrize("sources", [(), (RECEIPTS,), (SUPERVISOR,), (FACTS,), (FACTS, SUPERVISOR)])
def test_a_word_and_the_harnesss_own_records_show_nothing_of_the_world(sources: tuple[str, ...]) -> None:
    assert level(*sources, origins=Origins(sources=ROBOT, provider=("robot vbot-1",))) == 0


@pytest.mark.ledger("R108", symbol="harness.verification.independence:derived_independence")
def test_sources_behind_one_address_are_at_most_level_1_however_many_agree() -> None:
    behind = Origins(sources=FORGED, provider=("10.0.0.7",))
    assert level("camera", "microphone", RECEIPTS, origins=behind) == 1
    elsewhere = Origins(sources=FORGED | {"microphone": "10.0.0.9"}, provider=("10.0.0.7",))
    assert level("camera", "microphone", origins=elsewhere) == 1
    assert level("microphone", origins=elsewhere) == 2


def test_what_a_provider_reads_counts_as_its_own_address() -> None:
    """An analyser beside the harness that reads the robot's camera is not judged apart by the same robot's lidar."""
    reading = Origins(sources=ROBOT, provider=("harness", "robot vbot-1"))
    assert level("lidar", provider=("camera",), origins=reading) == 1


def test_a_source_that_the_site_vouches_for_is_of_its_own_origin() -> None:
    vouched = Origins(sources=FORGED | {"camera": "vouched camera"}, provider=("10.0.0.7",))
    assert level("camera", origins=vouched) == 2
    assert level("wheels", origins=vouched) == 1, "the provider's own sensor stays its own"


def test_an_unknown_origin_or_provider_is_at_most_level_1() -> None:
    assert level("camera", origins=Origins(provider=("10.0.0.7",))) == 1
    assert level("camera", origins=Origins(sources=FORGED)) == 1
    known = Origins(sources={"camera": "a"}, provider=("b",))
    assert derived_independence(("camera",), provider=None, origins=known, lineage=Lineage()) == 1


@pytest.mark.parametrize(
    ("sources", "facts", "found"),
    [((SUPERVISOR,), (1, 2), 1), ((FACTS,), (1, 0), 0), (("microphone", FACTS), (1,), 1), ((RECEIPTS, FACTS), (2,), 0)],
)
def test_what_is_derived_is_no_better_than_what_it_rests_on(
    sources: tuple[str, ...], facts: tuple[int, ...], found: int
) -> None:
    apart = Origins(sources={"microphone": "10.0.0.9"}, provider=("10.0.0.7",))
    assert level(*sources, origins=apart, facts=facts) == found
