"""A robot of one's own by its address: checked by the kit, admitted, and sent on a mission of its own site.

The robot is docs/examples/robot.py, as a stranger would start it; its simulated time passes only when it is asked to.
"""

import json
import shutil
import time
from contextlib import closing
from pathlib import Path

import pytest

from harness.adapters.providers.http.addressed import addressed_over_http
from harness.adapters.providers.http.robot import HttpRobot
from harness.bootstrap import read_harness
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import MissionId, ProviderId, RequestId
from harness.contracts.protocol import InvocationIdentity, StartRequest
from harness.settings import HarnessSettings
from tests.builders.shops import ROBOT, TOKEN, Shop, free_port, regen, running
from tests.saying import raises_saying


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    """The shop, with its robot checked and admitted."""
    made = Shop(tmp_path_factory.mktemp("sites") / "shop")
    code, answer, said = made.admit()
    assert code == 0, (answer, said)
    assert len([row for row in answer["providers"][0]["rows"] if row["outcome"] == "met"]) == 22
    return made


def test_an_admitted_robot_runs_a_mission_of_its_own_site_to_a_verified_goal(shop: Shop) -> None:
    with running(shop.port):
        code, outcome, said = shop.go("go-to-place")
    assert code == 0, said
    assert (outcome["status"], outcome["goal_verdict"], outcome["robot_id"]) == ("succeeded", "satisfied", ROBOT)
    (way,) = outcome["segments"]
    assert way["measured_distance_m"] < 0.4
    with read_harness(HarnessSettings(data_folder=shop.folder / "var", site_folder=shop.folder)) as runtime:
        mission = runtime.mission(MissionId(outcome["mission_id"]))
        assert mission.nodes["go"].provider_id == "driver"  # type: ignore[index]
        lease = runtime.lease(f"{ROBOT}/mobile_base")  # type: ignore[arg-type]
        assert (lease.status, lease.token) == ("free", 1)


def test_the_result_of_the_check_is_in_the_log_with_its_digest_and_the_card(shop: Shop) -> None:
    with read_harness(HarnessSettings(data_folder=shop.folder / "var", site_folder=shop.folder)) as runtime:
        found = runtime.fold(f"admission/{ROBOT}").providers[ProviderId("driver")]  # type: ignore[arg-type]
        assert found.provider.ok and found.address == shop.address and found.actor.name
        rows = json.loads(runtime.blob(found.result))[0]["findings"]
    assert {row["row"] for row in rows} == set(found.provider.met)


def test_a_changed_card_asks_for_a_new_check_and_starts_nothing(shop: Shop) -> None:
    with running(shop.port, "--version", "2.0"):
        code, outcome, said = shop.go("go-to-place")
        journal = shop.starts()
    assert code == 3 and outcome["status"] == "awaiting_human", said
    assert "The card of driver changed since it was checked (1.0, now 2.0)" in said and "check it again" in said
    assert not journal, "nothing was started"


def test_a_card_that_changes_under_way_gets_no_further_start(shop: Shop) -> None:
    with closing(HttpRobot(shop.address, TOKEN)) as client, running(shop.port):
        robot = addressed_over_http(client, name="robot-1", refusal=lambda card: None, speed_limit_mps=0.3)
        (provider,) = robot.providers()
        cap = next(one for one in provider.card.parameters if one.name == "speed_cap_mps")
        assert cap.maximum == 0.3, "the site's limit is lower than the robot's"
    changed = raises_saying(ProviderFailed, match=r"changed since it was checked \(1.0, now 1.1\)")
    with running(shop.port, "--version", "1.1"), closing(client):
        with changed:
            provider.start(request())
        assert not shop.starts()


def test_evidence_comes_from_the_second_program_alone_and_it_must_be_at_the_same_robot(shop: Shop) -> None:
    """spot_ros#53: what executes is not what is looked at. Here the second program sees another body, which stands."""
    port = free_port()
    here, there = (HttpRobot(f"http://127.0.0.1:{one}", TOKEN) for one in (shop.port, port))
    with closing(here), closing(there), running(shop.port):
        with running(port):
            robot = addressed_over_http(
                here, name="robot-1", refusal=lambda card: None, witness=lambda robot, clock: there
            )
            here.advance(here.clock().at_s + 2.0)
            there.advance(there.clock().at_s + 1.0)
            assert robot.observations(0) == there.observations(0) != here.observations(0)
            assert robot.status().at_s == there.status().at_s
            assert [one.card.provider_id for one in robot.providers()] == ["driver"]
        another = raises_saying(ProviderFailed, match="robot-9 answers at the address of robot-1")
        with running(port, "--name", "robot-9"), another:
            addressed_over_http(here, name="robot-1", refusal=lambda card: None, witness=lambda robot, clock: there)


@pytest.mark.ask("spot_ros#53")
def test_a_body_that_the_second_program_does_not_see_arrive_has_not_arrived(shop: Shop, tmp_path: Path) -> None:
    folder, port = shutil.copytree(shop.folder, tmp_path / "shop"), free_port()
    with (folder / "robots.yaml").open("a") as file:
        file.write(f"    evidence: {{address: http://127.0.0.1:{port}, token: {{environment: ROBOT_TOKEN}}}}\n")
    words = ("mission", "run", "go-to-place", "--site", str(folder), "--speed", "0")
    with running(shop.port):
        code, _, told = regen(*words)
        assert code == 1 and "did not answer" in told, "without its evidence the robot is not connected"
        with running(port):
            code, outcome, told = regen(*words)
    assert code != 0 and outcome["status"] != "succeeded", told


def test_a_robot_that_restarts_with_an_old_clock_is_judged_on_that_clock_and_the_next_mission_runs(
    shop: Shop, tmp_path: Path
) -> None:
    """Its clock fell back by a day: a mission and its evidence are of one clock, the robot's own."""
    folder = shutil.copytree(shop.folder, tmp_path / "shop")
    words = ("mission", "run", "go-to-place", "--site", str(folder), "--speed", "0")
    outcomes = []
    for options in ((), ("--clock", str(time.time() - 86_400.0)), ()):
        with running(shop.port, *options):
            code, outcome, told = regen(*words)
            moved = len(shop.starts())
        outcomes.append((code, outcome["status"] if outcome else told, moved))
    assert outcomes == [(0, "succeeded", 1), (0, "succeeded", 1), (0, "succeeded", 1)]


def request() -> StartRequest:
    identity = InvocationIdentity(
        mission_id=MissionId("m"),
        node_id="go",  # type: ignore[arg-type]
        attempt=1,
        request_id=RequestId("r"),
        provider_id=ProviderId("driver"),
    )
    return StartRequest(
        identity=identity,
        capability="navigate",
        parameters={},
        k_ctx=0,
        configuration="0" * 64,  # type: ignore[arg-type]
        deadline_s=time.time() + 60,
        fencing={"mobile_base": 1},
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--name", "robot-9"), "robot-9 answers at the address of robot-1"),
        (("--token", "another"), "The token is missing or wrong"),
        (None, "did not answer"),
    ],
)
def test_a_robot_that_is_off_another_one_or_locked_is_named_and_nothing_is_sent(
    shop: Shop, options: tuple[str, ...] | None, said: str
) -> None:
    if options is None:
        code, _, told = shop.go("go-to-place")
    else:
        with running(shop.port, *options):
            code, _, told = shop.go("go-to-place")
    assert code == 1 and "No robot of the site could be connected" in told and said in told
    assert TOKEN not in told


def test_providers_that_move_are_tried_only_where_motion_is_allowed_and_somebody_confirmed(tmp_path: Path) -> None:
    one = Shop(tmp_path / "shop")
    with running(one.port):
        code, _, said = one.check()
        assert code == 2 and "These providers move the robot: driver" in said and "--allow-motion" in said
        code, _, said = one.check("--allow-motion")
        assert code == 2 and "Nobody said that robot-1 stands clear" in said
        code, _, said = one.check("--allow-motion", "--stands-clear", "robot-2")
        assert code == 2, "another robot's name confirms nothing"
        code, answer, _ = one.check("--still")
        assert (code, answer["providers"]) == (1, []), "nothing was tried, so nothing was admitted"
        assert not one.starts(), "nothing moved"
        code, outcome, said = one.go("go-to-place")
    assert code == 3 and "driver was never checked at this address" in said
    assert outcome["status"] == "awaiting_human"


def test_secrets_stand_in_no_file_and_no_answer(shop: Shop) -> None:
    for file in shop.folder.rglob("*"):
        if file.is_file():
            assert TOKEN.encode() not in file.read_bytes(), file
