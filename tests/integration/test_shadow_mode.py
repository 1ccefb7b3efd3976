"""Shadow mode from its entry points: a robot's own stack decides; the harness watches, compares, and sends nothing."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from harness.addressed_robots import observed_robot
from harness.contracts.actors import Actor
from harness.contracts.commands import AcquireLease
from harness.contracts.control import CONTROL, BeginTeleoperation, OrderPosture
from harness.contracts.decisions import Refused
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import InvocationId, MissionId, RequestId, lease_stream, leased, sha256
from harness.contracts.shadow import StackGoalJudged
from harness.gate.commit import CommandEnvelope
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.site_robots import robots_of
from harness.workspace.reading import open_workspace
from tests.builders.shadow_sites import ROBOT, ShadowSite, shadow_site, write_site
from tests.builders.shops import regen
from tests.fakes.own_stack import OwnStack, serving
from tests.saying import raises_saying

READ = {"GET /robot", "GET /observations", "GET /stack/goals"}
ADA = Actor(name="ada", role="operator")


@pytest.fixture
def site(tmp_path: Path) -> Iterator[ShadowSite]:
    with shadow_site(tmp_path / "shop", OwnStack()) as found:
        yield found


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ShadowSite]:
    """A site that nothing changes: whatever is asked of it is refused."""
    with shadow_site(tmp_path_factory.mktemp("sites") / "shop", OwnStack()) as found:
        yield found


def drives(site: ShadowSite, goal_id: str, x_m: float, *, to_m: float | None = None, says: str = "succeeded") -> None:
    """The stack gets a goal at `x_m`, the robot drives to `to_m`, and the stack says how that ended."""
    site.stack.given(goal_id, x_m, 0.0)
    site.reads()
    site.stack.goes(x_m if to_m is None else to_m, 0.0, 5.0)
    site.stack.says(goal_id, says)
    site.stack.stands(3.0)
    site.reads()


def listed(site: ShadowSite) -> Any:
    (robot,) = site.operator().get("/api/v1/shadow").json()
    return robot


def test_a_goal_that_was_reached_is_declared_measured_and_accepted(site: ShadowSite) -> None:
    site.reads()
    drives(site, "g1", 4.0)
    robot = listed(site)
    (goal,) = robot["goals"]
    assert (goal["declared"], goal["accepted"]) == ("succeeded", "accepted")
    assert goal["finding"]["distance_m"] == pytest.approx(0.0, abs=0.01)
    assert robot["counts"]["agrees"] == 1 and robot["counts"]["disagrees"] == 0
    page = site.operator().get("/shadow").text
    assert "g1" in page and "succeeded" in page and "0.00 m from the target" in page and "reached" in page


def test_a_stack_that_says_done_without_moving_is_contradicted(site: ShadowSite) -> None:
    site.reads()
    drives(site, "g1", 4.0, to_m=0.0)
    robot = listed(site)
    (goal,) = robot["goals"]
    assert (goal["declared"], goal["accepted"]) == ("succeeded", "refused")
    assert goal["finding"]["distance_m"] == pytest.approx(4.0, abs=0.01)
    assert (robot["counts"]["disagrees"], robot["counts"]["false_successes"]) == (1, 1)
    assert "disagrees" in site.operator().get("/shadow?only=disagrees").text
    assert "g1" not in site.operator().get("/shadow?only=agrees").text
    drives(site, "g2", 6.0)
    assert listed(site)["goals"][0]["accepted"] == "accepted", "the next goal is judged for itself"


def test_a_goal_that_the_stack_gave_up_though_it_was_reached_is_a_disagreement(site: ShadowSite) -> None:
    site.reads()
    drives(site, "g1", 4.0, says="failed")
    counts = listed(site)["counts"]
    assert (counts["disagrees"], counts["missed"], counts["false_successes"]) == (1, 1, 0)


def test_missing_evidence_is_neither_success_nor_its_contrary(site: ShadowSite) -> None:
    site.reads()
    site.stack.odometry = False
    drives(site, "one-source", 4.0)
    site.stack.odometry = True
    site.stack.stands(2.0)
    site.stack.says("nowhere", "active")
    site.reads()
    site.stack.says("nowhere", "succeeded")
    site.stack.stands(3.0)
    site.reads()
    found = {one["goal"]["goal_id"]: one for one in listed(site)["goals"]}
    assert found["one-source"]["accepted"] == found["nowhere"]["accepted"] == "undecided"
    assert found["one-source"]["finding"]["lacks"] == ["second_source"]
    assert found["nowhere"]["finding"]["lacks"] == ["target", "arrival"]


def test_a_target_that_changes_with_the_last_word_is_no_target(site: ShadowSite) -> None:
    site.reads()
    site.stack.given("g1", 4.0, 0.0)
    site.reads()
    site.stack.stands(2.0)
    site.stack.says("g1", "succeeded", target_m=[0.0, 0.0], frame="map")
    site.stack.stands(3.0)
    site.reads()
    (goal,) = listed(site)["goals"]
    assert goal["accepted"] == "undecided" and "target" in goal["finding"]["lacks"]


def test_a_stack_that_vanishes_ends_the_waiting_and_the_next_goal_is_watched(site: ShadowSite) -> None:
    site.reads()
    site.stack.given("g1", 4.0, 0.0)
    site.reads()
    site.stack.away = True
    site.reads()
    assert site.goals.under_way, "a moment of silence is none"
    assert "did not answer" in site.operator().get("/shadow").text or site.watch.condition.trouble is not None
    site.clock.wall_s += 60.0
    site.reads()
    (lost,) = listed(site)["goals"]
    assert lost["declared"] is None and lost["accepted"] is None
    assert lost["lost"]["code"] == "stack_vanished" and listed(site)["counts"]["lost"] == 1
    site.stack.away = False
    drives(site, "g2", 4.0)
    assert listed(site)["goals"][0]["accepted"] == "accepted"


def test_what_was_declared_in_the_silence_is_judged_by_the_samples_of_then(site: ShadowSite) -> None:
    site.reads()
    site.stack.given("g1", 4.0, 0.0)
    site.reads()
    site.stack.away = True
    site.clock.wall_s += 60.0
    site.reads()
    site.stack.goes(4.0, 0.0, 5.0)
    site.stack.says("g1", "succeeded")
    site.stack.stands(3.0)
    site.stack.away = False
    site.reads()
    (goal,) = listed(site)["goals"]
    assert goal["accepted"] == "accepted" and goal["lost"] is None
    assert listed(site)["counts"]["lost"] == 0


def test_a_stack_that_restarts_with_an_old_clock_is_judged_by_nothing_of_before(site: ShadowSite) -> None:
    site.stack.stands(2.0)
    site.reads()
    site.stack.given("g1", 4.0, 0.0)
    site.stack.goes(4.0, 0.0, 5.0)
    site.reads()
    site.stack.stands(3.0)
    site.reads()
    there_s = site.stack.now_s
    site.stack.restarts(now_s=there_s - 3600.0)
    site.reads()
    (lost,) = listed(site)["goals"]
    assert lost["lost"]["code"] == "stack_restarted" and lost["declared"] is None
    site.stack.given("g1", 4.0, 0.0)
    site.reads()
    site.stack.says("g1", "succeeded", at_s=there_s - 1.0)
    site.clock.wall_s += 60.0
    site.stack.stands(0.2)
    site.reads()
    site.clock.wall_s += 60.0
    site.reads()
    newest = listed(site)["goals"][0]
    assert newest["run"] == "run-2"
    assert newest["accepted"] == "undecided", "samples of another time show nothing"
    drives(site, "g2", 6.0)
    assert listed(site)["goals"][0]["accepted"] == "accepted"


def test_a_clock_that_falls_back_in_one_run_ends_the_waiting(site: ShadowSite) -> None:
    site.stack.stands(2.0)
    site.stack.given("g1", 4.0, 0.0)
    site.reads()
    site.stack.now_s -= 600.0
    site.reads()
    (lost,) = listed(site)["goals"]
    assert lost["lost"]["code"] == "stack_clock_back"


def test_what_ended_before_anybody_watched_is_left_alone(site: ShadowSite) -> None:
    site.stack.given("before", 4.0, 0.0)
    site.stack.says("before", "succeeded")
    site.stack.given("now", 5.0, 0.0)
    site.reads()
    assert [one["goal"]["goal_id"] for one in listed(site)["goals"]] == ["now"]


def test_a_harness_that_is_started_again_goes_on_and_counts_nothing_twice(tmp_path: Path) -> None:
    stack = OwnStack()
    with shadow_site(tmp_path / "shop", stack) as site:
        site.reads()
        drives(site, "g1", 4.0)
        stack.given("g2", 8.0, 0.0)
        site.reads()
    stack.goes(8.0, 0.0, 5.0)
    stack.says("g2", "succeeded")
    stack.stands(3.0)
    with shadow_site(tmp_path / "shop", stack) as again:
        again.reads()
        again.reads()
        counts = listed(again)["counts"]
    assert (counts["noted"], counts["declared"], counts["agrees"], counts["lost"]) == (2, 2, 2, 0)


def test_another_robot_at_the_address_is_not_watched(site: ShadowSite) -> None:
    site.stack.name = "robot-9"
    drives(site, "g1", 4.0)
    assert site.watch.condition.trouble is not None
    assert site.watch.condition.trouble.code == "another_robot_answers"
    assert not site.goals.goals


def test_it_stands_on_the_fleet_page_with_the_goal_of_its_own_stack(site: ShadowSite) -> None:
    client = site.operator()
    (row,) = client.get("/api/v1/fleet").json()
    assert (row["mode"], row["charge"], row["x_m"]) == ("observed", None, None), "nothing is known before it was read"
    assert "never answered" in client.get("/fleet").text
    site.stack.stands(1.0)
    site.reads()
    site.stack.given("g1", 4.0, 0.0)
    site.stack.goes(2.0, 0.0, 2.0)
    site.reads()
    (row,) = client.get("/api/v1/fleet").json()
    assert (row["robot_id"], row["mode"], row["charge"]) == ("robot-1", "observed", 0.8)
    assert (row["x_m"], row["y_m"]) == (pytest.approx(2.0), pytest.approx(0.0)) and row["mission_id"] is None
    page = client.get("/fleet?mode=observed").text
    assert "g1" in page and "a goal of its own stack" in page and "/shadow#shadow-robot-1" in page
    assert "/robots/robot-1" not in page
    assert "No robot is as chosen here" in client.get("/fleet?mode=automatic").text
    site.stack.away = True
    site.reads()
    (row,) = client.get("/api/v1/fleet").json()
    assert row["link"] == "lost" and "answer" in row["trouble"]


def test_nothing_but_readings_is_ever_sent(site: ShadowSite) -> None:
    site.reads()
    drives(site, "g1", 4.0)
    client = site.operator()
    for path in ("/robots", "/shadow", "/fleet", "/", "/api/v1/robots", "/api/v1/fleet", "/api/v1/shadow"):
        assert client.get(path).status_code == 200
    client.post("/api/v1/robots/stop", json={"reason": "a drill"})
    client.post("/api/v1/robots/robot-1/stop", json={"reason": "a drill"})
    assert set(site.stack.asked) == READ


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/missions", {"template": "drive", "robot_id": "robot-1"}),
        ("/missions", {"goal": "go home", "robot_id": "robot-1"}),
        ("/missions", {"template": "drive"}),
        ("/robots/robot-1/stop", {}),
        ("/robots/robot-1/safe", {"reason": "x"}),
        ("/robots/robot-1/posture", {"posture": "lying", "reason": "x"}),
        ("/robots/robot-1/teleoperation", {"reason": "x"}),
        ("/robots/robot-1/teleoperation/turn", {"session": "s", "v_mps": 0.1, "w_radps": 0.0}),
    ],
)
def test_the_api_refuses_to_command_it_with_a_code(shared: ShadowSite, path: str, body: dict[str, Any]) -> None:
    answer = shared.operator().post(f"/api/v1{path}", json=body)
    assert answer.status_code == 409, answer.text
    problem = answer.json()
    assert problem["code"] == "robot_only_observed" and "shadow mode" in problem["detail"]
    assert "authority: observe" in problem["do"]


@pytest.mark.parametrize("path", ["stop", "safe", "stand", "drive", "pause", "resume", "autonomy", "release"])
def test_no_form_of_the_console_commands_it(shared: ShadowSite, path: str) -> None:
    answer = shared.operator().post(f"/robots/robot-1/{path}", data={"reason": "x", "autonomy": "autonomous"})
    assert answer.status_code == 409 and "shadow mode" in answer.text


def test_the_console_offers_no_button_for_it(site: ShadowSite) -> None:
    site.reads()
    drives(site, "g1", 4.0)
    client = site.operator()
    for path in ("/", "/shadow", "/robots", "/missions/new"):
        page = client.get(path, follow_redirects=True).text
        assert "/robots/robot-1/" not in page and 'value="robot-1"' not in page, path
    assert "In shadow mode" in client.get("/robots").text


def test_the_gate_lets_nobody_command_it(shared: ShadowSite) -> None:
    runtime = shared.harness.runtime
    base = leased(ROBOT, "mobile_base")
    lease = AcquireLease(
        resource=base, mission_id=MissionId("msn_1"), invocation_id=InvocationId("inv_1"), token=1, expires_s=1e12
    )
    hand = BeginTeleoperation(
        robot_id=ROBOT, session=RequestId(sha256(b"s")), token=1, actor=ADA, device="a test", reason="x"
    )
    lies = OrderPosture(robot_id=ROBOT, posture="lying", actor=ADA, reason="x")
    for stream, command in ((lease_stream(base), lease), (CONTROL, hand), (CONTROL, lies)):
        decision = runtime.commit([CommandEnvelope(stream, command, ROBOT)])
        assert isinstance(decision, Refused) and decision.rule == "robot_only_observed"
    start = Start(actor=ADA, robot_id=ROBOT, template=runtime.beside[0].name)
    decision = runtime.start(start)
    assert isinstance(decision, Refused) and decision.rule == "robot_only_observed"
    assert runtime.missions() == []


def test_its_verdicts_are_events_of_their_own_and_no_mission(site: ShadowSite) -> None:
    site.reads()
    drives(site, "g1", 4.0)
    client = site.operator()
    assert client.get("/api/v1/missions").json() == []
    runtime = site.harness.runtime
    stored = runtime.stream(runtime.streams("shadow/")[0])
    assert [one.kind for one in stored] == ["StackGoalNoted", "StackGoalJudged"]
    runtime.verify()
    assert not runtime.streams("mission/") and not runtime.streams("lease/")
    (goal,) = site.goals.goals.values()
    assert goal.evidence is not None and runtime.has_blob(goal.evidence)
    assert StackGoalJudged.__name__ == stored[-1].kind


def test_the_command_line_reads_it_and_refuses_to_command_it(site: ShadowSite) -> None:
    site.reads()
    drives(site, "g1", 4.0)
    drives(site, "g2", 8.0, to_m=4.0)
    code, found, _ = regen("shadow", "--site", str(site.folder))
    assert code == 1, "a declared success was none"
    (robot,) = found["robots"]
    assert [one["agreement"] for one in robot["goals"]] == ["disagrees", "agrees"]
    code, found, _ = regen("shadow", "--site", str(site.folder), "--only", "agrees")
    assert [one["goal"]["goal_id"] for one in found["robots"][0]["goals"]] == ["g1"]
    code, _, said = regen("shadow", "--site", str(site.folder), "--only", "nonsense")
    assert code == 2 and "agrees" in said


def test_regen_mission_run_refuses_it(tmp_path: Path) -> None:
    with shadow_site(tmp_path / "shop", OwnStack()) as site:
        folder = site.folder
        stack = site.stack
        template = site.harness.runtime.beside[0].name
    code, _, said = regen("mission", "run", template, "--site", str(folder), "--robot", "robot-1")
    assert code != 0 and "shadow mode" in said
    assert not [one for one in stack.asked if one.startswith("POST")]


def test_the_check_of_a_robot_in_shadow_mode_only_reads_it(site: ShadowSite) -> None:
    site.stack.given("g1", 4.0, 0.0)
    site.stack.goes(4.0, 0.0, 3.0)
    words = ("provider", "check", "robot-1", "--site", str(site.folder))
    code, answer, _ = regen(*words)
    assert (code, answer["ok"]) == (0, True), answer
    assert {row["row"] for row in answer["rows"]} >= {
        "identity",
        "evidence",
        "order",
        "once_over",
        "targets",
        "one_clock",
    }
    site.stack.says("g2", "active")
    site.stack.says("g1", "succeeded")
    site.stack.says("g1", "active")
    code, answer, _ = regen(*words)
    found = {row["row"] for row in answer["rows"] if row["outcome"] == "not met"}
    assert (code, found) == (1, {"once_over", "targets"})
    code, _, said = regen(*words, "--allow-motion", "--stands-clear", "robot-1")
    assert code == 1 and "shadow mode" in said
    assert set(site.stack.asked) == READ


def test_a_robot_that_says_nothing_of_a_stack_is_named(site: ShadowSite) -> None:
    site.stack.tells = False
    site.reads()
    assert site.watch.condition.trouble is not None and not site.goals.goals
    site.clock.wall_s += 60.0
    assert "There is nothing of that name" in site.operator().get("/shadow").text


def test_an_entry_that_is_observed_and_driven_by_hand_is_refused_with_its_line(tmp_path: Path) -> None:
    folder = write_site(tmp_path / "shop", "http://127.0.0.1:9", teleoperation=True)
    code, answer, said = regen("check", str(folder))
    assert code != 0 and "robots.yaml" in f"{answer} {said}" and "shadow mode" in f"{answer} {said}"


def test_evidence_by_another_path_is_told_apart_from_the_declaration(tmp_path: Path) -> None:
    witness = OwnStack()
    with serving(witness) as seen, serving(OwnStack()) as address:
        evidence = {"address": seen, "token": {"file": "robot.token"}}
        write_site(tmp_path / "shop", address, evidence=evidence)
        workspace = open_workspace(tmp_path / "shop")
        witness.goes(2.0, 0.0, 1.0)
        (entry,) = robots_of(HarnessSettings(site_folder=workspace.folder), workspace, None).observed
        with observed_robot(entry, workspace) as robot:
            assert len(robot.observations(0).samples) == len(witness.samples)
            assert robot.stack_goals(0).changes == ()
            witness.name = "robot-9"
            with raises_saying(ProviderFailed, match="robot-9 answers at the address of robot-1"):
                robot.status()
