"""The return of the inspection ends turned to the arrival heading; a robot that does not turn is found out."""

import math

import pytest
from msgspec.structs import replace

from harness.contracts.ids import NodeId
from harness.contracts.protocol import InvocationReport, StartRequest
from harness.provider_protocol.delegation import DelegatingProvider
from tests.builders.connections import staged

RETURN = NodeId("return")


class Unturned(DelegatingProvider):
    """A navigator that forgets the turn."""

    def start(self, request: StartRequest) -> InvocationReport:
        kept = {name: value for name, value in request.parameters.items() if name != "heading_rad"}
        return self.inner.start(replace(request, parameters=kept))


@pytest.mark.ledger("R203", symbol="harness.verification.predicates.facing:facing")
def test_the_return_ends_with_a_turn_that_the_lidar_confirms_and_a_body_at_rest() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin("warehouse-inspection"))
        assert ran.mission.status == "succeeded", ran.mission.reason
        results = {one.condition_id: one for one in ran.mission.of(RETURN).verdicts[-1].results}
        turned, still = results["return.facing"], results["return.static"]
        assert (turned.verdict, still.verdict) == ("satisfied", "satisfied")
        assert turned.sources == ("lidar",) and turned.measured["off_rad"] <= turned.bounds["off_rad"] == 0.1745
        packet = ran.mission.of(RETURN).packets[-1]
        true = min((one for one in ran.truth if one.kind == "pose"), key=lambda one: abs(one.at_s - packet.collected_s))
        assert abs(math.remainder(true.yaw_rad, math.tau)) < math.radians(10.0)
        assert abs(turned.measured["heading_rad"] - true.yaw_rad) < math.radians(3.0)


def test_a_return_without_its_turn_is_not_accepted() -> None:
    with staged(wrap=lambda one: Unturned(one) if one.card.capability == "navigate" else one) as stage:
        ran = stage.run(stage.begin("warehouse-inspection"))
        assert ran.mission.status == "awaiting_human"
        results = {one.condition_id: one for one in ran.mission.of(RETURN).verdicts[0].results}
        assert (results["return.facing"].verdict, results["return.arrival"].verdict) == ("violated", "satisfied")
