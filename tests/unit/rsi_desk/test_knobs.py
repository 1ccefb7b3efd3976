"""Each knob goes exactly as far as the rules let a candidate go, and every ladder that is offered could be proposed."""

import msgspec
import pytest

from harness.contracts.configuration import Configuration
from harness.contracts.values import decode
from rsi_reviews.knobs import Knob, knobs, ladders_from, turned, value_text
from rsi_reviews.restrictions import LOCKED_LADDERS, loosened
from rsi_reviews.runnable import unrunnable
from tests.builders.releases import baseline

H0 = baseline()
NUMBERS = tuple(one for one in knobs(H0) if not one.is_ladder)
BEYOND = 1e-3


def broken(knob: Knob, value: float) -> bool:
    """Whether a candidate with this value would be refused, by its types or by a rule."""
    text = f"{int(value)}" if knob.whole else repr(value)
    try:
        made = decode(turned(H0, {knob.path: text}).encode(), Configuration)
    except msgspec.ValidationError:
        return True
    return bool(loosened(H0, made) or unrunnable(H0, made))


@pytest.mark.parametrize("knob", NUMBERS, ids=lambda one: one.path)
def test_a_knob_may_reach_its_bounds_and_nothing_beyond_them(knob: Knob) -> None:
    assert knob.most is not None
    step = 1.0 if knob.whole else BEYOND
    assert not broken(knob, knob.most)
    assert broken(knob, knob.most + step)
    assert broken(knob, knob.least if knob.above else knob.least - step)
    assert not broken(knob, knob.least + step if knob.above else knob.least)


def test_every_ladder_that_is_offered_could_be_proposed_and_no_locked_one_is_a_knob() -> None:
    ladders = [one for one in knobs(H0) if one.is_ladder]
    assert not {one.path.rpartition(".")[2] for one in ladders} & set(LOCKED_LADDERS)
    for failure in ("violated", "no_progress", "timeout"):
        path = f"recovery.ladders.{failure}"
        for ladder in ladders_from(H0, failure)[:6]:
            made = decode(turned(H0, {path: value_text(ladder)}).encode(), Configuration)
            assert made.recovery.ladders[failure] == ladder and loosened(H0, made) == ()


def test_a_value_that_stays_changes_nothing_and_text_stays_text() -> None:
    same = {one.path: value_text(one.now) for one in knobs(H0)}
    assert decode(turned(H0, same).encode(), Configuration) == H0
    with pytest.raises(msgspec.ValidationError, match=r"wait_s"):
        decode(turned(H0, {"recovery.wait_s": "soon"}).encode(), Configuration)
