"""Nobody answers where the zone authorised a way to a safe place: it is gone, once, or something else is done."""

import json
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from experiments.campaigns.races import opened_gates, together
from harness.auditing.replay import replay_mission
from harness.contracts.commands import AcquireLease, AnswerMission, PauseMission, RaiseVeto, RejectHandoff, StopMission
from harness.contracts.control import CONTROL, BeginTeleoperation, PostureOrdered, PostureShown, SetAutonomy
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.handoff_commands import ExtendDeadline
from harness.contracts.handoff_events import NoAnswerTaken
from harness.contracts.ids import (
    InvocationId,
    MissionId,
    PlaceId,
    RequestId,
    ResourceId,
    handoff_stream,
    lease_stream,
    leased,
    mission_stream,
)
from harness.contracts.observations import Pose
from harness.contracts.place_events import RemovePlace, place_stream
from harness.contracts.protocol import Observations
from harness.contracts.reasons import Reason, because, plain
from harness.contracts.retreat_events import RETREAT, SendRetreat, StopRetreat
from harness.gate.commit import CommandEnvelope, Gate
from harness.gate.control import DECIDER as CONTROL_DECIDER
from harness.gate.decide import DECIDER as MISSION
from simulator.faults import FaultPlan, parse_faults
from tests.builders.connections import CrewRobot
from tests.builders.missions_run import ROBOT
from tests.builders.retreating import LATE_S, from_dock_m, newest, retreating_site, sent, step, unanswered
from tests.builders.waiting import BOB, Waiting

BASE = leased(ROBOT, ResourceId("mobile_base"))


def taken(asked: Waiting) -> NoAnswerTaken:
    """What was written down of the no-answer action; fails unless that happened exactly once."""
    told = [event for event in asked.told if isinstance(event, NoAnswerTaken)]
    assert len(told) == 1, asked.kinds
    return told[0]


@pytest.mark.ledger("R174", symbol="harness.supervisor.minimal_risk:sending")
def test_without_an_answer_the_robot_goes_the_authorised_way_and_its_arrival_is_measured() -> None:
    with unanswered() as asked:
        assert asked.handoff.opened is not None
        assert (asked.handoff.opened.no_answer, asked.handoff.opened.safe_place) == ("retreat", "Anchor A")
        before_m, accepted = from_dock_m(asked), len(asked.mission.facts)
        asked.pass_s(LATE_S)
        asked.run()
        assert (asked.handoff.status, asked.mission.status) == ("expired", "safe_stopped")
        assert before_m > 1.5 and from_dock_m(asked) < 0.4
        assert [(start.moves, start.attempt) for start in sent(asked)] == [(True, 1)]
        told, ended = taken(asked), newest(asked).ended
        assert (told.action, told.done) == ("retreat", True)
        assert told.measured["distance_m"] <= told.measured["bound_m"] == 0.4
        assert ended is not None and (ended.outcome, ended.declared) == ("reached", "succeeded")
        assert asked.runtime.lease(BASE).status == "free"
        assert len(asked.mission.facts) == accepted and RETREAT not in asked.mission.nodes


def test_the_mission_learns_nothing_of_the_retreat_but_that_nobody_answered() -> None:
    with unanswered() as asked:
        version = asked.mission.version
        asked.pass_s(LATE_S)
        asked.run()
        later = [type(MISSION.codec.decode(one)).__name__ for one in asked.runtime.events(asked.mission_id, version)]
        assert later == ["HandoffAnswered", "FailureReported", "MissionEnded"]
        assert replay_mission(asked.runtime, asked.mission_id).differences == ()


def test_the_expiry_the_intent_and_its_lease_are_one_commit_before_anything_is_sent() -> None:
    with unanswered() as asked:
        asked.pass_s(LATE_S)
        assert newest(asked).open and sent(asked) == []
        lease = asked.runtime.lease(BASE)
        assert (lease.status, lease.invocation_id) == ("held", newest(asked).intent.invocation_id)
        kinds = {"HandoffExpired", "MissionEnded", "RetreatIntended", "LeaseAcquired"}
        tail = [one.kind for one in asked.runtime.log(asked.runtime.head().position - 6)]
        assert tail[-6:] == ["HandoffExpired", "HandoffAnswered", "FailureReported", "MissionEnded", *tail[-2:]]
        assert kinds < set(tail)


def test_a_way_that_is_blocked_ends_short_and_the_robot_lies_down_there_instead() -> None:
    with unanswered(healed=False) as asked:
        asked.pass_s(LATE_S)
        asked.run()
        told, ended = taken(asked), newest(asked).ended
        assert ended is not None and ended.outcome == "short" and ended.measured["distance_m"] > 0.4
        assert (told.action, told.done) == ("lie_down", True) and told.reason.facts["outcome"] == "short"
        assert asked.robot.status().posture == "lying"
        assert len(sent(asked)) == 1 and asked.runtime.lease(BASE).status == "free"


HINDRANCES = ["pause", "manual", "veto", "hardware stop", "lost", "wheel", "lease", "off the way", "no such place"]


@pytest.mark.parametrize("what", HINDRANCES)
def test_where_it_must_not_move_nothing_is_sent_and_the_robot_does_otherwise(what: str) -> None:
    with unanswered() as asked:
        hinder(asked, what)
        asked.harness.clock.wait_until(asked.harness.clock.now().mission_s + 4.0)
        asked.pass_s(LATE_S)
        asked.run()
        assert (asked.handoff.status, asked.mission.status) == ("expired", "safe_stopped")
        assert sent(asked) == []
        told = taken(asked)
        assert (told.action, told.done) == ("lie_down", True)
        assert told.reason.code == "no_retreat_instead" and "lying" in str(told.reason.facts["instead"])


def hinder(asked: Waiting, what: str) -> None:
    """Something that forbids the motion, as it would come about."""
    match what:
        case "veto":
            asked.runtime.submit(asked.mission_id, RaiseVeto(layer="site", reason="people in the hall"))
        case "pause":
            asked.runtime.submit(asked.mission_id, PauseMission(actor=BOB, reason="lunch"))
        case "manual":
            asked.runtime.submit(asked.mission_id, SetAutonomy(autonomy="manual", actor=BOB, reason="I look first"))
        case "hardware stop":
            asked.robot.press_hardware_stop(engaged=True)
        case "lost":
            asked.robot.configure(MissionId("lost"), 3, parse_faults(["lost-localisation:persistent"]))
        case "wheel":
            drives = BeginTeleoperation(
                robot_id=ROBOT, session=RequestId("pad"), token=9, actor=BOB, device="pad", reason="by hand"
            )
            asked.runtime.commit([CommandEnvelope(CONTROL, drives, None)])
        case "lease":
            held = AcquireLease(
                resource=BASE,
                mission_id=MissionId(""),
                invocation_id=InvocationId("inv_other"),
                token=asked.runtime.lease(BASE).token + 1,
                expires_s=asked.harness.clock.now().mission_s + 1e6,
            )
            asked.runtime.commit([CommandEnvelope(lease_stream(BASE), held, None)])
        case "off the way":
            asked.robot.world.body.state.x_m = 3.0
            asked.robot.world.body.state.y_m = 0.0
        case _:
            gone = RemovePlace(place_id=PlaceId("anchor_a"), basis=0, actor=BOB, reason="the dock was moved")
            asked.runtime.commit([CommandEnvelope(place_stream(asked.runtime.site.name), gone, None)])


def test_a_person_stops_a_retreat_and_its_stop_is_acknowledged() -> None:
    with unanswered() as asked:
        asked.pass_s(LATE_S)
        step(asked, 6)
        assert asked.robot.status().posture == "moving"
        stopped = StopRetreat(robot_id=ROBOT, actor=BOB, reason="somebody is in the way")
        assert isinstance(asked.runtime.commit([CommandEnvelope(CONTROL, stopped, None)]), Accepted)
        asked.run()
        ended, told = newest(asked).ended, taken(asked)
        assert ended is not None and (ended.outcome, ended.declared) == ("short", "cancelled")
        assert "bob stopped it: somebody is in the way" in sentence(told.reason) and told.action == "lie_down"
        assert asked.runtime.lease(BASE).status == "free"


@pytest.mark.parametrize("what", ["hardware stop", "lost"])
def test_a_robot_that_must_stand_on_its_way_is_stopped(what: str) -> None:
    with unanswered() as asked:
        asked.pass_s(LATE_S)
        step(asked, 6)
        hinder(asked, what)
        asked.run()
        ended = newest(asked).ended
        assert ended is not None and ended.outcome == "short"
        assert newest(asked).stop is not None and from_dock_m(asked) > 0.4
        assert len(sent(asked)) == 1


def test_a_link_that_loses_the_start_is_never_answered_with_another_start() -> None:
    with unanswered() as asked:
        asked.pass_s(LATE_S)
        asked.link.losing, before = True, asked.link.sent
        asked.run()
        assert asked.link.sent == before + 1
        ended, told = newest(asked).ended, taken(asked)
        assert ended is not None and ended.outcome == "unknown"
        assert (told.action, told.done) == ("retreat", False)
        assert sent(asked) == [] and asked.runtime.lease(BASE).status == "quarantined"


def test_a_frozen_localiser_never_shows_an_arrival() -> None:
    with unanswered() as asked:
        asked.robot.configure(asked.mission_id, 3, ())
        asked.robot.world.faults = FaultPlan(asked.mission_id, parse_faults(["frozen-localiser"]), began_s=0.0)
        asked.pass_s(LATE_S)
        asked.run()
        ended = newest(asked).ended
        assert ended is not None and ended.declared == "succeeded"
        assert ended.outcome == "short" and taken(asked).action == "lie_down"


def test_poses_at_the_place_that_odometry_belies_show_no_arrival() -> None:
    def at_the_dock(seen: Observations) -> Observations:
        told = (replace(one, x_m=0.0, y_m=0.0) if isinstance(one, Pose) else one for one in seen.samples)
        return replace(seen, samples=tuple(told))

    with unanswered() as asked:
        robot = asked.harness.robots[ROBOT]
        assert isinstance(robot, CrewRobot)
        asked.pass_s(LATE_S)
        step(asked, 6)
        robot.retouch = at_the_dock
        asked.run()
        ended = newest(asked).ended
        assert ended is not None and ended.measured["distance_m"] == 0.0
        assert ended.outcome == "short" and "localiser_and_odometry_differ" in plain(ended.reason)


def test_a_robot_that_stands_at_its_safe_place_already_is_not_sent_anywhere() -> None:
    with unanswered() as asked:
        asked.robot.world.body.state.x_m = asked.robot.world.body.state.y_m = 0.05
        asked.harness.clock.wait_until(asked.harness.clock.now().mission_s + 4.0)
        asked.pass_s(LATE_S)
        told = taken(asked)
        assert (told.action, told.done) == ("retreat", True) and told.reason.code == "already_there"
        assert sent(asked) == []


# crashes -------------------------------------------------------------------------------------------------------------


@pytest.mark.ledger("R174", symbol="harness.supervisor.safe_return:Returning._left_open")
@pytest.mark.parametrize(("steps", "starts"), [(0, 0), (1, 1), (8, 1)])
def test_a_harness_that_stops_in_between_leaves_an_unknown_end_and_never_sends_again(steps: int, starts: int) -> None:
    with unanswered() as asked:
        asked.pass_s(LATE_S)
        step(asked, steps)
        assert len(sent(asked)) == starts
        asked.restart()
        asked.harness.clock.wait_until(asked.harness.clock.now().mission_s + 3.0)
        step(asked, 3)
        ended, told = newest(asked).ended, taken(asked)
        assert ended is not None and ended.outcome == "unknown"
        assert (told.action, told.done) == ("retreat", False)
        assert asked.runtime.lease(BASE).status == "quarantined"
        asked.restart()
        step(asked, 3)
        asked.supervisor.finish_unanswered(ROBOT)
        assert len(sent(asked)) == starts and asked.kinds.count("NoAnswerTaken") == 1
        assert asked.robot.status().posture == "standing"
        freed = asked.supervisor.free(BASE, actor=BOB, reason="I looked at it")
        assert isinstance(freed, Accepted) and asked.runtime.lease(BASE).status == "free"


@pytest.mark.parametrize(
    ("point", "outcome"),
    [("after:start#3", "unknown"), ("before:RetreatEnded", "unknown"), ("before:NoAnswerTaken", "reached")],
)
def test_a_process_that_is_killed_on_the_way_starts_nothing_twice(tmp_path: Path, point: str, outcome: str) -> None:
    log = str(tmp_path / "log.db")
    program = [sys.executable, "-m", "tests.builders.killed_retreat"]
    killed = subprocess.run([*program, "expire", log, point], capture_output=True, timeout=200, check=False)
    assert killed.returncode == -signal.SIGKILL, killed.stderr[-500:]
    after = subprocess.run([*program, "resume", log], capture_output=True, timeout=200, check=True)
    shown = json.loads(after.stdout)
    assert (shown["starts"], shown["outcome"]) == (1, outcome)
    assert shown["done"] == [outcome == "reached"] and shown["mission"] == "safe_stopped"


# races ---------------------------------------------------------------------------------------------------------------


def test_an_answer_that_lands_inside_the_expirys_commit_wins_and_nothing_is_sent(tmp_path: Path) -> None:
    with unanswered(log=tmp_path / "log.db") as asked, ExitStack() as stack:
        other = opened_gates(stack, tmp_path, wall_s=(asked.wall_s,))[0]
        answered: list[Any] = []

        def meanwhile(command: object) -> Refused | None:
            if isinstance(command, SendRetreat) and not answered:
                answered.append(other.commit(rejection(asked)))
            return None

        asked.obey(meanwhile)
        asked.pass_s(LATE_S)
        asked.run()
        assert isinstance(answered[0], Accepted)
        assert (asked.handoff.status, asked.kinds.count("HandoffExpired")) == ("rejected", 0)
        assert sent(asked) == [] and "RetreatIntended" not in {one.kind for one in asked.runtime.stream(CONTROL)}


def test_more_time_that_is_given_inside_the_expirys_commit_keeps_the_question_and_nothing_is_sent(
    tmp_path: Path,
) -> None:
    with unanswered(log=tmp_path / "log.db") as asked, ExitStack() as stack:
        other = opened_gates(stack, tmp_path, wall_s=(asked.wall_s,))[0]
        given: list[Any] = []

        def meanwhile(command: object) -> Refused | None:
            if isinstance(command, SendRetreat) and not given:
                extended = ExtendDeadline(actor=BOB, reason="two corridors away")
                given.append(other.commit([CommandEnvelope(handoff_stream(asked.handoff_id), extended, None)]))
            return None

        asked.obey(meanwhile)
        asked.pass_s(LATE_S)
        assert isinstance(given[0], Accepted)
        assert (asked.handoff.status, asked.mission.status) == ("open", "awaiting_human")
        assert sent(asked) == [] and asked.runtime.lease(BASE).status == "free"


def test_answers_against_the_expiry_that_starts_a_retreat_leave_exactly_one_winner(tmp_path: Path) -> None:
    for number in range(3):
        folder = tmp_path / str(number)
        folder.mkdir()
        with unanswered(log=folder / "log.db") as asked, ExitStack() as stack:
            gates = opened_gates(stack, folder, wall_s=(asked.wall_s,))
            asked.turn_to(asked.wall_s + LATE_S)

            def act(responder: int, asked: Waiting = asked, gates: list[Gate] = gates) -> Any:
                if responder % 4 == 0:
                    return asked.supervisor.step(asked.mission_id)
                return gates[responder].commit(rejection(asked))

            together(act)
            asked.run()
            ends = [kind for kind in asked.kinds if kind in ("HandoffRejected", "HandoffExpired")]
            assert len(ends) == 1
            assert len(sent(asked)) == (ends == ["HandoffExpired"])


def rejection(asked: Waiting) -> list[CommandEnvelope]:
    """A person's no, with the mission's end."""
    opened = asked.handoff.opened
    assert opened is not None
    refused = RejectHandoff(actor=BOB, reason="no", key="k", cycle=opened.cycle, subject=opened.subject)
    ended = AnswerMission(handoff_id=opened.handoff_id, decision="rejected", actor=BOB, reason="no")
    return [
        CommandEnvelope(handoff_stream(opened.handoff_id), refused, None),
        CommandEnvelope(mission_stream(opened.mission_id), ended, None),
    ]


# on a person's word --------------------------------------------------------------------------------------------------


def test_a_person_sends_a_robot_without_a_mission_to_its_safe_place() -> None:
    with unanswered() as asked:
        stopped(asked)
        asked.restart()
        decision = asked.harness.teleoperation.to_safety(ROBOT, actor=BOB, reason="the hall is needed")
        assert isinstance(decision, Accepted), decision
        again = asked.harness.teleoperation.to_safety(ROBOT, actor=BOB, reason="once more")
        assert isinstance(again, Refused) and again.rule == "retreat_under_way"
        for _ in range(200):
            if newest(asked).ended is None:
                asked.harness.clock.wait_until(asked.supervisor.step_retreat(ROBOT))
        intent, ended = newest(asked).intent, newest(asked).ended
        assert (intent.handoff_id, intent.actor, intent.reason) == (None, BOB, "the hall is needed")
        assert ended is not None and ended.outcome == "reached" and from_dock_m(asked) < 0.4
        assert len(sent(asked)) == 1 and asked.runtime.lease(BASE).status == "free"


def test_where_the_zone_has_no_safe_place_it_lies_down_and_the_log_says_why() -> None:
    bare = retreating_site()
    zones = tuple(replace(zone, no_answer="hold", retreat=None) for zone in bare.zones)
    with unanswered(site=replace(bare, zones=zones)) as asked:
        stopped(asked)
        assert isinstance(asked.harness.teleoperation.to_safety(ROBOT, actor=BOB, reason="enough"), Accepted)
        assert sent(asked) == [] and asked.robot.status().posture == "lying"
        told = [CONTROL_DECIDER.codec.decode(one) for one in asked.runtime.stream(CONTROL)]
        assert isinstance(told[-1], PostureShown) and told[-1].done, "lying is measured"
        assert isinstance(told[-2], PostureOrdered) and isinstance(told[-2].reason, Reason)
        assert told[-2].reason.facts["why"] == because("zone_without_safe_place", zone="office")


def stopped(asked: Waiting) -> None:
    """The mission is over by a person's stop."""
    asked.runtime.submit(asked.mission_id, StopMission(actor=BOB, reason="enough"))
    asked.run()
    assert asked.mission.ended
