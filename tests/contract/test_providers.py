"""The provider protocol's lifecycle, the same assertions over a robot in this process and one behind HTTP."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from harness.adapters.providers.http.process import RobotProcess, RobotSettings
from harness.contracts.errors import FencingRefused, ProviderFailed
from harness.contracts.ids import RequestId
from harness.contracts.values import decode
from harness.settings import ROBOT_COMMAND
from simulator.truth import Truth
from tests.saying import raises_saying
from tests.unit.simulation.builders import MISSION, Bench, along, bench

BRAKED_MPS = 0.01


@pytest.fixture(params=["kinematic", "mujoco", "http"])
def made(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    """A robot with a mission begun, one second old."""
    if request.param == "http":
        yield from served(tmp_path / "vbot-1")
    else:
        yield bench(request.param)


def served(folder: Path) -> Iterator[Bench]:
    """A robot process of kinematic fidelity in lockstep."""
    process = RobotProcess(
        RobotSettings(command=ROBOT_COMMAND, folder=str(folder), speed=0.0, fidelity="kinematic", linger_s=0.2)
    )
    robot = process.robot
    truth_file = folder / "truth" / f"{MISSION}.jsonl"
    made = Bench(robot, robot.advance, robot.configure, lambda: truths(truth_file))
    try:
        made.configure(MISSION, 5, ())
        made.wait(1.0)
        yield made
    finally:
        robot.close()
        process.terminate()


def truths(file: Path) -> list[Truth]:
    """Every whole line of a file that a robot may be writing to."""
    return [decode(line, Truth) for line in file.read_bytes().split(b"\n")[:-1]]


def speeds(made: Bench, after_s: float) -> list[float]:
    return [abs(truth.v_mps) for truth in made.truth() if truth.at_s >= after_s]


def test_every_card_fills_its_twelve_fields(made: Bench) -> None:
    cards = {provider.card.provider_id: provider.card for provider in made.robot.providers()}
    assert set(cards) == {"route-follower", "careful-local-planner", "panorama-camera", "observer"}
    for card in cards.values():
        assert card.version
        assert card.embodiments
        assert card.parameters
        assert card.latency.base_s > 0
        assert card.cancel.within_s > 0
        assert card.failure_words
        assert card.evidence
    movers = [card for card in cards.values() if card.moves]
    assert all("mobile_base" in card.resources and card.side_effects and card.preconditions for card in movers)


@pytest.mark.ledger("R81", symbol="simulator.robot:SimulatedRobot.find")
def test_repeating_a_start_returns_the_same_execution_and_starts_nothing(made: Bench) -> None:
    request = made.request("route-follower", along("A-B"))
    provider = made.provider("route-follower")
    first = provider.start(request)
    made.wait(1.0)
    again = provider.start(request)
    assert again.handle == first.handle
    assert again.status == "running"
    assert len(made.robot.starts()) == 1


def test_the_same_request_id_with_other_parameters_is_refused(made: Bench) -> None:
    made.start("route-follower", along("A-B"))
    with raises_saying(ProviderFailed, match="other contents"):
        made.start("route-follower", along("circuit"))
    assert len(made.robot.starts()) == 1


def test_an_invocation_is_found_by_its_request_and_a_stranger_is_not(made: Bench) -> None:
    report = made.start("route-follower", along("A-B"))
    provider = made.provider("route-follower")
    found = provider.find(report.identity.request_id)
    assert found is not None
    assert found.handle == report.handle
    assert provider.find(RequestId("f" * 64)) is None
    with raises_saying(ProviderFailed, match="No invocation has the handle"):
        provider.report("route-follower:nothing")


def test_a_report_echoes_the_identity_it_was_asked_for(made: Bench) -> None:
    request = made.request("observer", {"duration_s": 1.0})
    report = made.watch(made.provider("observer").start(request))
    assert report.identity == request.identity
    assert report.status == "succeeded"


@pytest.mark.ledger("R80", symbol="simulator.invocations:RunningSkill.report")
def test_progress_is_structured_and_rises(made: Bench) -> None:
    report = made.start("route-follower", along("A-B"))
    assert report.status == "accepted"
    earlier = made.watch(report, until_s=5.0)
    later = made.watch(earlier, until_s=5.0)
    assert earlier.status == later.status == "running"
    assert 0.0 < earlier.progress.share < later.progress.share < 1.0
    assert earlier.progress.remaining_m is not None
    assert later.progress.remaining_m is not None
    assert earlier.progress.remaining_m - later.progress.remaining_m == pytest.approx(2.5, abs=0.3)


@pytest.mark.ledger("R91", symbol="simulator.invocations:RunningSkill._stand")
def test_a_stop_is_acknowledged_only_once_the_body_stands(made: Bench) -> None:
    report = made.watch(made.start("route-follower", along("A-B")), until_s=5.0)
    provider = made.provider("route-follower")
    stopped = provider.stop(report.handle)
    assert stopped.status == "stopping"
    made.wait(0.1)
    assert provider.report(report.handle).status == "stopping"
    ended = made.watch(stopped, poll_s=0.05)
    made.wait(1.5)
    assert ended.status == "cancelled"
    assert max(speeds(made, ended.at_s)) < BRAKED_MPS
    assert provider.stop(report.handle).status == "cancelled"


@pytest.mark.ledger("R90", symbol="simulator.robot:SimulatedRobot._mover")
def test_a_second_mover_is_refused_while_the_first_has_the_base(made: Bench) -> None:
    report = made.watch(made.start("route-follower", along("A-B")), until_s=2.0)
    with raises_saying(ProviderFailed, match="still holds the base"):
        made.start("panorama-camera", {"frames": 8.0}, node="pano")
    made.watch(made.provider("route-follower").stop(report.handle))
    assert made.start("careful-local-planner", along("A-B"), attempt=2).status == "accepted"


def test_an_older_fencing_token_is_refused_and_starts_nothing(made: Bench) -> None:
    made.watch(made.provider("route-follower").stop(made.start("route-follower", along("A-B")).handle))
    made.tokens["mobile_base"] = 6
    with raises_saying(FencingRefused, match="older than 7"):
        made.start("route-follower", along("A-B"), attempt=2)
    made.tokens["mobile_base"] = 8
    assert made.start("route-follower", along("A-B"), attempt=2).status == "accepted"
    assert len(made.robot.starts()) == 2


def test_a_start_without_a_lease_or_off_the_card_is_refused(made: Bench) -> None:
    with raises_saying(ProviderFailed, match="speed_cap_mps"):
        made.start("route-follower", {**along("A-B"), "speed_cap_mps": 3.0})
    with raises_saying(ProviderFailed, match="frame"):
        made.start("route-follower", {**along("A-B"), "frame": "odom"})
    assert made.robot.starts() == type(made.robot.starts())()


def test_without_keepalives_the_body_stands_within_two_seconds_and_a_resume_goes_on(made: Bench) -> None:
    report = made.watch(made.start("route-follower", along("A-B")), until_s=6.0)
    provider = made.provider("route-follower")
    lost_s = made.at_s
    made.wait(4.0)
    assert max(speeds(made, lost_s)) > 0.4
    assert max(speeds(made, lost_s + 2.0)) < BRAKED_MPS
    held = provider.report(report.handle)
    assert (held.status, held.failure) == ("blocked", "keepalive_lost")
    assert provider.resume(report.handle).status == "running"
    ended = made.watch(provider.report(report.handle))
    assert ended.status == "succeeded"
    assert len(made.robot.starts()) == 1


def test_a_deadline_ends_a_leg_as_timeout_standing(made: Bench) -> None:
    request = made.request("route-follower", along("A-B"))
    hurried = type(request)(**{name: getattr(request, name) for name in request.__struct_fields__} | {
        "deadline_s": made.at_s + 5.0
    })  # fmt: skip
    report = made.watch(made.provider("route-follower").start(hurried))
    assert (report.status, report.failure) == ("failed", "timeout")
    assert report.at_s - hurried.deadline_s < 2.0
    made.wait(1.5)
    assert max(speeds(made, report.at_s)) < BRAKED_MPS


def test_a_pause_that_a_panorama_suffers_does_not_cost_a_frame(made: Bench) -> None:
    report = made.watch(made.start("panorama-camera", {"frames": 3.0}, node="pano"), until_s=3.0)
    provider = made.provider("panorama-camera")
    made.wait(4.0)
    assert provider.report(report.handle).status == "blocked"
    provider.resume(report.handle)
    ended = made.watch(provider.report(report.handle))
    assert ended.status == "succeeded"
    assert len(ended.blobs) == 3


def test_samples_and_bytes_reach_the_reader(made: Bench) -> None:
    made.wait(2.0)
    scan = made.samples("lidar")[-1]
    body = made.robot.blob(scan.blob)  # type: ignore[union-attr]
    assert len(body) == 12 * scan.points  # type: ignore[union-attr]
    assert {"localiser", "odometry", "imu", "lidar"} <= {sample.source for sample in made.robot.observations(0).samples}
