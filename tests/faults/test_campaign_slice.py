"""A short, seeded slice of every campaign, and the adjudicator itself: it must find what it is there to find."""

import multiprocessing
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event

import msgspec
import pytest

from experiments.campaigns.adjudicate import judged
from experiments.campaigns.kills import KillPoint, killed_twice
from experiments.campaigns.ledgers import read_books
from experiments.campaigns.mission import PlayedMission, played
from experiments.campaigns.plan import DISTURBANCES, ROBOT_FAULTS, Disturbance, MissionPlan, mission_plan
from experiments.campaigns.publish import BEGIN, END, publish, with_figures
from experiments.campaigns.races import answer_rounds, append_rounds
from experiments.campaigns.simulate import CampaignWorkersLost, one_mission, seeds_of, spread
from experiments.campaigns.suspended_holders import suspensions
from experiments.campaigns.tally import Tally, counted, summary, tallied
from experiments.campaigns.truths import torn
from harness.contracts.actors import Actor
from harness.contracts.ids import Digest, StreamId
from harness.contracts.observations import Odometry, Pose, Trajectory
from harness.contracts.ports import StoredEvent
from harness.contracts.values import encode
from rsi_reviews.bounds import upper_bound
from rsi_reviews.events import PointerMoved

MISSIONS = 36
SEED = 11


@contextmanager
def undisturbed(*, faults: tuple[str, ...] = (), disturbances: tuple[Disturbance, ...] = ()) -> Iterator[PlayedMission]:
    with played(
        MissionPlan(seed=5, template="circuit", faults=faults, disturbances=disturbances, approvals=0)
    ) as mission:
        yield mission


def rewritten(mission: PlayedMission, kind: str, old: str, new: str) -> PlayedMission:
    """The same mission with a word exchanged in its events of one kind, as a gate without a rule would have left it."""

    def changed(event: StoredEvent) -> StoredEvent:
        if event.kind != kind:
            return event
        return msgspec.structs.replace(event, body=event.body.decode().replace(old, new).encode())

    log = tuple(map(changed, mission.log))
    assert log != mission.log
    return replace(mission, log=log)


@pytest.fixture(scope="module")
def tally() -> Tally:
    return tallied(map(one_mission, seeds_of(SEED, MISSIONS)))


@pytest.mark.ledger("R228", symbol="simulator.faults:FaultPlan.strikes")
def test_faulted_missions_leave_no_false_completion_no_second_start_and_no_unauthorised_commit(tally: Tally) -> None:
    assert tally.offences == []
    assert tally.missions == MISSIONS
    assert len([name for name in ROBOT_FAULTS if tally.struck[name]]) == len(ROBOT_FAULTS)
    assert tally.acts["commits"] > MISSIONS and tally.acts["starts"] > MISSIONS


def test_a_seed_replays_exactly(tally: Tally) -> None:
    def told(seed: int) -> list[bytes]:
        with played(mission_plan(seed)) as mission:
            return [event.body for event in mission.log]

    for seed in seeds_of(SEED, 3):
        assert told(seed) == told(seed)


def test_a_plan_depends_on_its_seed_alone_and_every_disturbance_is_drawn() -> None:
    plans = [mission_plan(seed) for seed in range(400)]
    assert plans == [mission_plan(seed) for seed in range(400)]
    drawn = Counter(one.name for plan in plans for one in plan.disturbances)
    assert set(drawn) == set(DISTURBANCES)
    assert all(plan.faults or plan.disturbances for plan in plans)


@pytest.mark.parametrize(
    ("kind", "old", "new", "found"),
    [
        ("VerdictRecorded", '"verdict":"satisfied"', '"verdict":"ambiguous"', "the verdict is ambiguous"),
        ("PacketRetained", '"k_ctx":1', '"k_ctx":7', "packet of version 7"),
        ("PacketRetained", '"terminal":"succeeded"', '"terminal":"failed"', "the execution ended failed"),
        ("PacketRetained", '"attempt":1', '"attempt":2', "the packet is about somebody else"),
        ("MissionCreated", '"configuration":"', '"configuration":"0', "made under another configuration"),
        ("GoalVerified", '"verdict":"satisfied"', '"verdict":"violated"', "success on a goal verdict violated"),
        ("LeaseAcquired", '"token":1', '"token":0', "with token 0 after 0"),
        ("MissionActivated", '"MissionActivated"', '"VetoRaised","layer":"person","reason":"wait"', "person vetoed"),
    ],
)
@pytest.mark.ledger("R230", symbol="experiments.campaigns.ledgers:_committed")
def test_the_adjudicator_finds_a_commit_that_nobody_should_have_made(kind: str, old: str, new: str, found: str) -> None:
    with undisturbed() as mission:
        assert judged(mission).offences == ()
        findings = judged(rewritten(mission, kind, old, new))
        assert any(found in sentence for sentence in (*findings.unauthorised, *findings.breaches)), findings


@pytest.mark.parametrize(
    ("kind", "old", "new", "found"),
    [
        (
            "RecoveryAuthorised",
            '"local_replan","cost":1',
            '"local_replan","cost":0',
            "no step of its commit paid for it",
        ),
        ("GraphRevised", '"responsible":"go"', '"responsible":"request"', "attempt 2: nobody authorised a further"),
    ],
)
def test_a_revision_authorises_the_next_attempt_of_the_stage_whose_step_paid_for_it(
    kind: str, old: str, new: str, found: str
) -> None:
    with played(mission_plan(59928997335293)) as mission:
        assert mission.struck["blocked-passage"] and judged(mission).offences == ()
        breaches = judged(rewritten(mission, kind, old, new)).breaches
        assert any(found in sentence for sentence in breaches), breaches


@pytest.mark.ledger("R233", symbol="harness.conformance.hostile.truth:truly_reached")
def test_a_biased_localiser_is_an_epistemic_false_completion_and_no_contract_one() -> None:
    with undisturbed(faults=("biased-localiser",)) as mission:
        findings = judged(mission)
        assert mission.mission.status == "succeeded"
        assert len(findings.epistemic_false) == 1
        assert findings.contract_false == ()


@pytest.mark.parametrize("seed", [75645611515689, 202486737382539, 271746488798648])
def test_a_dropout_at_the_edge_of_the_comparison_is_no_disagreement(seed: int) -> None:
    plan = MissionPlan(seed=seed, template="circuit", faults=("biased-localiser",), disturbances=(), approvals=0)
    with played(plan) as mission:
        findings = judged(mission)
        assert (len(findings.epistemic_false), findings.contract_false) == (1, ())


@pytest.mark.parametrize("seed", [208689769166820, 149266815679384])
def test_an_end_that_a_clock_which_stepped_back_has_not_reached_yet_hides_no_evidence(seed: int) -> None:
    with played(mission_plan(seed, template="circuit")) as mission:
        assert mission.struck["clock-step"]
        assert judged(mission).contract_false == ()
        assert mission.mission.status == "succeeded"


def test_seven_tenths_of_a_second_of_odometry_are_no_second_of_standstill() -> None:
    with played(mission_plan(280626095845264)) as mission:
        assert mission.struck["clock-step"]
        assert judged(mission).offences == ()


@pytest.mark.ledger("R233", symbol="experiments.campaigns.truths:contradicted")
def test_a_completion_against_its_own_evidence_is_a_contract_false_completion() -> None:
    with undisturbed() as mission:
        further = rewritten(mission, "ContractCompiled", '"target_m":[0.0,0.0]', '"target_m":[0.9,0.0]')
        findings = judged(further)
        assert len(findings.contract_false) == 1
        assert "the localiser itself says" in findings.contract_false[0]


def test_a_start_that_nobody_intended_and_one_that_came_twice_are_found() -> None:
    with undisturbed() as mission:
        starts = mission.starts
        assert starts
        twice = judged(replace(mission, starts=(*starts, starts[0])))
        assert len(twice.duplicate_starts) == 2
        loose = msgspec.structs.replace(starts[0], request_id="0" * 64, attempt=9)
        assert any("without an intent" in one for one in judged(replace(mission, starts=(*starts, loose))).breaches)


def test_an_act_that_never_took_place_is_a_contract_false_completion() -> None:
    with undisturbed() as mission:
        assert any("never did it" in one for one in judged(replace(mission, starts=())).contract_false)


def test_the_books_know_the_version_that_the_mission_has() -> None:
    with undisturbed(faults=("early-success",)) as mission:
        assert read_books(mission.log, mission.commits).k == mission.mission.k > 3


def test_the_books_read_events_of_releases_beside_a_mission_and_name_one_that_cannot_be_read() -> None:
    nothing = dict.fromkeys(("released", "canary", "trial", "robot_id"))
    shipped = PointerMoved(
        revision=1,
        cause="shipped",
        configuration=Digest("1" * 64),
        rollback=Digest("1" * 64),
        actor=Actor(name="harness", role="harness", channel="policy"),
        reason="begun",
        at_s=1.0,
        **nothing,
    )
    moved = StoredEvent(
        position=1,
        stream=StreamId("release/pointer"),
        version=1,
        kind="PointerMoved",
        body=encode(shipped),
        mission_s=1.0,
        recorded_s=1.0,
        previous=Digest("0" * 64),
        digest=Digest("2" * 64),
    )
    assert read_books([moved], [(0, 1)]).breaches == []
    broken = msgspec.structs.replace(moved, body=b'{"type":"PointerMoved"}')
    (found,) = read_books([broken], [(0, 1)]).breaches
    assert found.startswith("PointerMoved in the log cannot be read")


@pytest.mark.parametrize("name", ["request-lost", "reply-lost", "late-reply", "duplicated", "reordered"])
def test_messages_that_are_lost_late_or_doubled_do_no_harm(name: str) -> None:
    noise = Disturbance(name=name, at_s=3.0, for_s=20.0, share=0.5, size_s=1.0)  # type: ignore[arg-type]
    with undisturbed(disturbances=(noise,)) as mission:
        assert mission.struck[name] > 2
        assert judged(mission).offences == ()
        assert mission.mission.status == "succeeded"


@pytest.mark.ledger("R81", symbol="simulator.robot:SimulatedRobot.find")
def test_a_robot_that_dies_on_the_way_is_started_again_and_starts_nothing_twice() -> None:
    with undisturbed(disturbances=(Disturbance(name="robot-crash", at_s=12.0, for_s=4.0),)) as mission:
        assert mission.struck == {"robot-crash": 1}
        assert judged(mission).offences == ()
        assert mission.mission.status == "succeeded"


def test_sixteen_answers_at_once_are_one_answer() -> None:
    appended, answered = append_rounds(9), answer_rounds(2, seed=SEED)
    assert (appended.offences, answered.offences) == ((), ())
    assert (appended.effective, answered.effective) == (9, 2)


def test_a_holder_that_was_suspended_past_its_lease_is_refused() -> None:
    report = suspensions(2)
    assert (report.refused, report.offences) == (2, ())


def test_killed_at_a_commit_and_again_inside_the_recovery_nothing_is_lost_or_doubled() -> None:
    killed = killed_twice(KillPoint(faults=("early-success",), name="after:CommitRejected#1"))
    assert killed.first and killed.second
    assert killed.wrong == ()


def test_bounds_are_those_of_the_tables() -> None:
    assert upper_bound(0, 100_000) == pytest.approx(2.99569e-5, rel=1e-4)
    assert upper_bound(0, 59) == pytest.approx(0.0495, abs=1e-4)
    assert upper_bound(1, 100) == pytest.approx(0.046559, abs=1e-5)
    assert upper_bound(5, 50) == pytest.approx(0.198833, abs=1e-5)
    assert upper_bound(7, 7) == 1.0
    with pytest.raises(ValueError, match="3 of 2"):
        upper_bound(3, 2)


def test_a_tally_does_not_depend_on_the_order_of_its_parts(tally: Tally) -> None:
    parts = [one_mission(seed) for seed in seeds_of(SEED, 4)]
    assert summary(tallied(parts)) == summary(tallied(reversed(parts)))
    assert counted(tally, "contract_false") == {"count": 0, "upper_bound": upper_bound(0, MISSIONS)}


def test_figures_are_written_between_their_marks_and_nowhere_else(tally: Tally) -> None:
    made = {"command": "python -m experiments.campaigns run --only damage", "code": "0" * 64}
    result = {
        **summary(tally),
        "kill_campaign": {"points": 2, "kills": 2, "second_kills": 1, "ends": {"awaiting_human": 2}, "offences": []},
        "races": {"rounds": 3, "responders": 16, "effective": 3, "offences": ["two winners"]},
        "suspended_holders": {"rounds": 2, "refused": 2, "offences": []},
        "damage": {"cases": 5, "skipped": ["read-only folder"], "offences": []},
        "planted_bugs": {"total": 1, "caught": 1, "seen": {"a bug": "what it did"}},
        "made_by": {"damage": made},
    }
    written = with_figures(f"before\n{BEGIN}\nold\n{END}\nafter\n", result)
    assert written.startswith(f"before\n{BEGIN}\n") and written.endswith(f"{END}\nafter\n")
    assert "\nold\n" not in written and f"| stale-pose | {tally.struck['stale-pose']} |" in written
    assert "not to be brought about here: read-only folder, no offence" in written
    assert "3 with a winner, 1 offences" in written
    assert f"| damage | `{made['command']}` | `000000000000` |" in written
    assert with_figures(written, result) == written
    with pytest.raises(ValueError, match="no place for figures"):
        with_figures("a page without marks", result)


def test_a_campaign_that_was_run_alone_shows_its_figures_and_no_other() -> None:
    page = with_figures(f"{BEGIN}{END}", {"damage": {"cases": 5, "skipped": [], "offences": []}})
    assert "| damaged folders and disks | 5 cases, no offence |" in page
    assert "simulated missions" not in page and "planted" not in page


def test_figures_of_another_campaign_stay_where_one_is_run_again(tmp_path: Path) -> None:
    page, results = tmp_path / "reliability.md", tmp_path / "reliability.json"
    page.write_text(f"{BEGIN}{END}")
    for name in ("races", "damage"):
        figures = {"rounds": 3, "responders": 16, "effective": 3, "cases": 5, "skipped": [], "offences": []}
        made = {name: {"command": f"run --only {name}", "code": "0" * 64}}
        publish({name: figures, "made_by": made}, page=page, results=results)
    kept = msgspec.json.decode(results.read_bytes())
    assert set(kept) == {"races", "damage", "made_by"} and set(kept["made_by"]) == {"races", "damage"}
    for name in ("simulation", "races"):
        made = {name: {"command": f"run --only {name}", "code": "0" * 64}}
        publish({"command": f"run --only {name}", "made_by": made}, page=page, results=results)
    assert msgspec.json.decode(results.read_bytes())["command"] == "run --only simulation"


def lost(seeds: list[int]) -> Tally:
    """Work that kills its worker, as code that cannot be imported does."""
    os._exit(3)


def stuck(seeds: list[int]) -> Tally:
    """Work that never ends."""
    Event().wait()
    return Tally()


def test_a_campaign_ends_with_a_sentence_where_its_workers_die_or_fall_silent() -> None:
    before = set(multiprocessing.active_children())
    with pytest.raises(CampaignWorkersLost, match="A worker process died"):
        list(spread([[1], [2]], processes=2, work=lost))
    with pytest.raises(CampaignWorkersLost, match="No worker answered for 3 s"):
        list(spread([[1], [2]], processes=1, work=stuck, silent_s=3.0))
    left = set(multiprocessing.active_children()) - before
    for worker in left:
        worker.join(10.0)
    assert not any(worker.is_alive() for worker in left)


def pose(at_s: float, x_m: float) -> Pose:
    return Pose(seq=1, at_s=at_s, source="localiser", frame="map", map_version="1", x_m=x_m, y_m=0.0, yaw_rad=0.0)


def odometry(at_s: float, x_m: float) -> Odometry:
    return Odometry(
        seq=1, at_s=at_s, source="odometry", frame="odom", x_m=x_m, y_m=0.0, yaw_rad=0.0, v_mps=0.0, w_radps=0.0
    )


def test_the_adjudicator_tells_a_torn_track_from_one_with_a_dropout() -> None:
    moving = tuple(odometry(0.05 * tick, 0.025 * min(tick, 60)) for tick in range(80))
    sound = tuple(pose(0.1 * tick, 0.05 * min(tick, 30)) for tick in range(40) if not 8 < tick < 15)
    frozen = tuple(pose(0.1 * tick, 0.05 * min(tick, 20)) for tick in range(40))
    assert torn(Trajectory(poses=sound, odometry=moving)) == ""
    assert torn(Trajectory(poses=frozen, odometry=moving)).startswith("localiser and odometry differ by 0.50 m")
    assert torn(Trajectory(poses=sound[-6:], odometry=moving)) == "a source is missing before standstill"
