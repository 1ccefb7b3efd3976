"""Runs a mission in which one effect can only be declared, and lists what its log accepts on a provider's word."""

from collections.abc import Iterator

from experiments.campaigns.kills import commits_of
from experiments.campaigns.ledgers import read_books
from harness.bootstrap import simulated
from harness.contracts.actors import Actor
from harness.contracts.ids import MissionId, RobotId
from harness.extra_templates import begin
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

DECLARING = "camera-report"
"""The template whose description nothing but the describer shows."""


def declared_offences(*, seed: int) -> Iterator[str]:
    """What the books of that mission show, and that it did not end in part as it should."""
    settings = HarnessSettings(fidelity="kinematic", speed=0)
    with simulated(settings, simulator=SIMULATOR, seed=seed) as harness:
        request = Start(
            actor=Actor(name="campaign", role="operator"),
            robot_id=RobotId(next(iter(harness.robots))),
            template=DECLARING,
            seed=seed,
        )
        begin(harness.runtime, request)
        mission_id: MissionId = next(harness.runtime.newest_missions()).mission_id
        mission = harness.supervisor.run(mission_id)
        log = harness.runtime.events(mission_id)
    yield from read_books(log, commits_of(log)).unauthorised
    if mission.status != "partly_verified":
        yield f"a mission with a declared effect ended {mission.status}"
