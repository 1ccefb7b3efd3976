"""Pictures that were claimed falsely stop no honest inspection: of another robot, or of the same one once mended."""

from msgspec.structs import replace

from harness.bootstrap import Harness, simulated
from harness.contracts.decisions import Accepted
from harness.contracts.ids import RobotId
from harness.contracts.observations import Image
from harness.contracts.ports import Robot
from harness.contracts.protocol import Observations
from harness.contracts.reasons import plain
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.connections import CrewRobot
from tests.builders.missions_run import OPERATOR

LIAR, HONEST = RobotId("vbot-1"), RobotId("vbot-2")


def headings_mirrored(seen: Observations) -> Observations:
    """Every picture is claimed for the heading on the other side."""
    samples = (replace(one, yaw_rad=-one.yaw_rad) if isinstance(one, Image) else one for one in seen.samples)
    return replace(seen, samples=tuple(samples))


def inspected(harness: Harness, robot_id: RobotId, *, seed: int) -> Mission:
    """One inspection, to its end or to a question."""
    start = Start(actor=OPERATOR, robot_id=robot_id, template="warehouse-inspection", seed=seed)
    assert isinstance(harness.runtime.start(start), Accepted)
    return harness.supervisor.run(harness.runtime.missions()[0].mission_id)


def test_pictures_that_were_claimed_falsely_stop_no_honest_inspection() -> None:
    crew: list[CrewRobot] = []

    def wire(robot: Robot) -> Robot:
        crew.append(CrewRobot(robot, lambda provider: provider))  # type: ignore[arg-type]
        return crew[-1]

    settings = HarnessSettings(speed=0, fidelity="kinematic", robots=(LIAR, HONEST))
    with simulated(settings, simulator=SIMULATOR, seed=3, wire=wire) as harness:
        crew[0].retouch = headings_mirrored
        lied = inspected(harness, LIAR, seed=3)
        assert lied.status == "awaiting_human" and "image_of_another_heading" in plain(lied.reason)
        assert inspected(harness, HONEST, seed=4).status == "succeeded"

        crew[0].retouch = lambda seen: seen
        assert inspected(harness, LIAR, seed=5).status == "succeeded"
