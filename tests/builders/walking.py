"""Builds a circuit that a robot walks under supervision, with the lease on its base and its physical starts."""

from harness.bootstrap import Harness
from harness.contracts.ids import MissionId, ResourceId
from harness.projections.leases import Lease
from harness.projections.mission import Mission
from tests.builders.connections import Stage
from tests.builders.missions_run import Ran

BASE = ResourceId("vbot-1/mobile_base")


def base(harness: Harness) -> Lease:
    return harness.runtime.lease(BASE)


def under_way(mission: Mission) -> bool:
    """The circuit has begun and continues."""
    return mission.invocation is not None and mission.invocation.intent.node_id == "circuit"


def walking(stage: Stage, *, seconds: float = 6.0) -> MissionId:
    """A circuit that began some seconds ago."""
    mission_id = stage.begin("circuit")
    mission = stage.until(mission_id, under_way)
    since_s = mission.invocation.intent.dispatched_s if mission.invocation else 0.0
    stage.until(mission_id, lambda _: stage.harness.clock.now().mission_s > since_s + seconds)
    return mission_id


def starts(ran: Ran) -> list[str]:
    return [start.request_id for start in ran.harness.starts(ran.mission.mission_id)]
