"""A robot process that ends takes no more requests: nobody can adopt it in its last moment."""

import pytest

from harness.contracts.errors import ProviderUnreachable
from simulator.robot import SimulatedRobot
from simulator.service import Pace
from simulator.world import WorldSettings


def standing() -> Pace:
    return Pace(SimulatedRobot(WorldSettings(fidelity="kinematic")), speed=0.0)


def test_a_robot_that_was_asked_just_now_does_not_retire() -> None:
    pace = standing()
    with pace.turn():
        pass
    assert not pace.retire(after_s=60.0)
    with pace.turn():
        pass


def test_a_retired_robot_refuses_the_request_that_would_have_adopted_it() -> None:
    pace = standing()
    assert pace.retire(after_s=0.0)
    with pytest.raises(ProviderUnreachable), pace.turn():
        pass
