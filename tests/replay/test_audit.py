"""`regen audit replay`: every decision is derived again from what was stored, and whatever was changed is named."""

import gzip
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import msgspec
import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.auditing.replay import ReplayReport, replay_all, replay_mission
from harness.bootstrap import read_harness
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.commands import ApproveHandoff, PauseMission, ResumeMission, StopMission
from harness.contracts.decisions import Accepted
from harness.contracts.errors import LogDamaged
from harness.contracts.handoff_commands import LookAgain
from harness.contracts.ids import Digest, MissionId, StreamId, mission_stream
from harness.contracts.memory import OutcomeSums
from harness.contracts.ports import State, StoredEvent
from harness.contracts.reasons import because
from harness.contracts.stored_commands import command_of
from harness.contracts.upcasting import name_of
from harness.projections.mission import Mission, all_required_settled
from harness.routing.history import SettingHistory
from harness.settings import HarnessSettings
from tests.builders.connections import Failing, Stage, only, staged, template
from tests.builders.missions_run import OPERATOR
from tests.builders.tampering import Body, rewritten
from tests.saying import raises_saying

FIRST_RELEASE = Path(__file__).parents[1] / "fixtures" / "logs" / "schema-1.db.gz"
"""A warehouse inspection that the first schema wrote; its blobs are not carried along, so no verdict can be derived."""


class Told:
    """A finished mission and its log."""

    def __init__(self, stage: Stage, mission_id: MissionId) -> None:
        self.stage, self.mission_id = stage, mission_id

    def stored(self, kind: str, place: int = 0) -> StoredEvent:
        return [event for event in self.stage.parts.store.read(0, 10_000) if name_of(event.kind) == kind][place]

    def body(self, kind: str, place: int = 0) -> Body:
        found: Body = msgspec.json.decode(self.stored(kind, place).body)
        return found

    def replayed(self, **changes: Any) -> ReplayReport:
        return replay_mission(rewritten(self.stage.parts, **changes), self.mission_id)


@pytest.fixture(scope="module")
def told() -> Iterator[Told]:
    """A circuit that was claimed too early once: tried again, accepted."""
    with staged() as stage:
        mission_id = stage.begin("circuit", "early-success")
        assert stage.run(mission_id).mission.status == "succeeded"
        yield Told(stage, mission_id)


@pytest.mark.ledger("R146", "R147", "R66", symbol="harness.auditing.replay:replay_mission")
@pytest.mark.ledger("R49", symbol="harness.auditing.roles:RoleReplay._checks")
def test_every_decision_of_an_honest_log_is_derived_again(told: Told) -> None:
    report = told.replayed()
    assert report.differences == ()
    counts = msgspec.to_builtins(report)
    derived = {name: counts[name] for name in ("plans", "routings", "skills", "verdicts", "recoveries", "goals")}
    assert derived == {"plans": 2, "routings": 3, "skills": 3, "verdicts": 3, "recoveries": 1, "goals": 1}
    assert report.decisions == 9 and report.leases == 4
    assert report.reconstructed == 0, "every command is read where it was stored"
    live = told.stage.runtime.mission(told.mission_id)
    assert report.k == live.k


class ForgedSnapshots:
    """Restores one mission as something that its log does not say, and keeps nothing."""

    def __init__(self, forged: Mission) -> None:
        self.forged = forged

    def restore(self, stream: StreamId, initial: State) -> tuple[State, int]:
        if stream == mission_stream(self.forged.mission_id):
            return cast(State, self.forged), self.forged.version
        return initial, 0

    def offer(self, stream: StreamId, version: int, state: object) -> None:
        """Nothing is kept."""


@pytest.mark.ledger("R147", symbol="harness.auditing.replay:replay_mission")
def test_a_live_state_that_does_not_follow_from_its_log_is_named(told: Told) -> None:
    live = told.stage.runtime.mission(told.mission_id)
    assert told.replayed(snapshots=ForgedSnapshots(live)).differences == ()
    report = told.replayed(snapshots=ForgedSnapshots(replace(live, relooks=live.relooks + 1)))
    difference = because("audited_state_differs")
    stream = mission_stream(told.mission_id)
    assert report.differences == (because("audit_difference_of_stream", stream=stream, difference=difference),)


def lines(report: ReplayReport) -> list[str]:
    """The differences as the command line prints them."""
    return [sentence(one) for one in report.differences]


def changed(body: Body, value: object, *path: object) -> Body:
    inside: Any = body
    for step in path[:-1]:
        inside = inside[step]
    inside[path[-1]] = value
    return body


CHANGES: dict[str, tuple[str, int, Callable[[Body], Body | None]]] = {
    "another node was planned": ("NodePlanned", 1, lambda e: changed(e, "it seemed right", "reason")),
    "a verdict was turned": ("VerdictRecorded", 1, lambda e: changed(e, "satisfied", "verdict", "verdict")),
    "a measured value was made smaller": (
        "VerdictRecorded",
        1,
        lambda e: changed(e, {"progress": 1.0}, "verdict", "results", 0, "measured"),
    ),
    "another provider was sent": ("DispatchIntended", 1, lambda e: changed(e, "careful-local-planner", "provider_id")),
    "the parameters were others": ("DispatchIntended", 1, lambda e: changed(e, 0.4, "parameters", "speed_cap_mps")),
    "the intent is of another version": ("DispatchIntended", 2, lambda e: changed(e, 7, "k_ctx")),
    "a spend was made free": ("RecoveryAuthorised", 0, lambda e: changed(e, 0, "cost")),
    "another rung was taken": ("RecoveryAuthorised", 0, lambda e: changed(e, "local_replan", "action")),
    "the budget left was raised": ("RecoveryAuthorised", 0, lambda e: changed(e, 8, "left_mission")),
    "a fact was invented": ("NodeCommitted", 1, lambda e: changed(e, {"progress": 1.0}, "facts", 0, "measured")),
    "the refusing rule is another": ("CommitRejected", 0, lambda e: changed(e, "vetoed", "rule")),
    "a failure was renamed": ("FailureClassified", 0, lambda e: changed(e, "ambiguous", "failure")),
    "a rejection was taken out": ("CommitRejected", 0, lambda e: None),
    "the goal verdict was turned": ("GoalVerified", 0, lambda e: changed(e, "violated", "verdict", "verdict")),
    "the success report was rewritten": ("CompletionReported", 0, lambda e: changed(e, "Goal met twice", "text")),
    "a fencing token was reused": ("LeaseAcquired", 1, lambda e: changed(e, 1, "token")),
    "a release is of another invocation": ("LeaseReleased", 0, lambda e: changed(e, "inv_other", "invocation_id")),
    "the recovery policy is another version's": (
        "ContractCompiled",
        0,
        lambda e: changed(e, 1.0, "policy", "approval_share"),
    ),
    "the contract asks for less": (
        "ContractCompiled",
        0,
        lambda e: changed(e, 5.0, "contract", "nodes", 1, "success_conditions", 0, "effect", "tolerance_m"),
    ),
}


@pytest.mark.ledger("R146", symbol="harness.auditing.replay:_mission")
@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_event_is_named_with_its_position(told: Told, name: str) -> None:
    kind, place, change = CHANGES[name]
    position = told.stored(kind, place).position
    report = told.replayed(events={position: change})
    assert report.differences, name
    places = [line.removeprefix("position ").partition(",")[0] for line in lines(report) if "position" in line]
    assert position - 2 <= min(int(place) for place in places) <= position


RECORDS = {
    "C1": ("NodePlanned", 1, "context"),
    "C2": ("DispatchIntended", 1, "context"),
    "the routing question": ("DispatchIntended", 1, "question"),
    "the candidates": ("DispatchIntended", 1, "candidates"),
    "C4": ("RecoveryAuthorised", 0, "context"),
}


@pytest.mark.ledger("R77", "R147", symbol="harness.auditing.roles:RoleReplay._stored")
@pytest.mark.parametrize("name", RECORDS)
def test_a_changed_record_is_named_by_its_digest(told: Told, name: str) -> None:
    kind, place, field = RECORDS[name]
    digest = Digest(told.body(kind, place)[field])
    report = told.replayed(records={digest: lambda body: body | {"k": 77}})
    assert any(digest[:12] in line and "was changed" in line for line in lines(report))
    assert any(f"position {told.stored(kind, place).position}," in line for line in lines(report))


def test_a_changed_verifier_context_is_named(told: Told) -> None:
    digest = Digest(told.body("VerdictRecorded", 1)["verdict"]["context"])
    report = told.replayed(records={digest: lambda body: body | {"at_s": 0.0}})
    assert any(digest[:12] in line for line in lines(report))


@pytest.mark.ledger("R146", symbol="harness.auditing.roles:RoleReplay._routing")
def test_a_question_that_was_exchanged_together_with_its_digest_is_found_by_asking_again(told: Told) -> None:
    intent = told.body("DispatchIntended", 1)
    other = Digest(told.body("DispatchIntended", 0)["question"])
    assert intent["question"] != other
    position = told.stored("DispatchIntended", 1).position
    report = told.replayed(events={position: lambda e: e | {"question": other}})
    assert any("routing chose" in line for line in lines(report))


def test_all_missions_of_a_log_are_replayed() -> None:
    poor = template("warehouse-inspection", recovery_total=1)
    with staged(wrap=only("deliver_message", lambda one: Failing(one, word="refused"))) as stage:
        for name, faults in ((poor, ()), ("circuit", ("lost-localisation",)), ("circuit", ("frozen-localiser",))):
            stage.run(stage.begin(name, *faults))
        reports = list(replay_all(stage.runtime))
        assert [report.differences for report in reports] == [(), (), ()]
        assert sum(report.recoveries for report in reports) >= 4


def test_a_reopened_goal_is_derived_again() -> None:
    with staged() as stage:
        mission_id = stage.begin("warehouse-inspection")
        stage.until(mission_id, all_required_settled)
        stage.robot.world.body.state.x_m = 1.0
        stage.robot.world.body.state.y_m = 2.5
        for _ in range(12):
            stage.harness.clock.wait_until(stage.harness.clock.now().mission_s + 0.5)
        assert stage.run(mission_id).mission.graph_revision == 1
        report = replay_mission(stage.runtime, mission_id)
        assert report.differences == () and report.goals == 2


@pytest.mark.ledger("R146", symbol="harness.auditing.replay:_handoff")
@pytest.mark.ledger("R146", symbol="harness.auditing.legacy_neighbours:asked_of_handoff")
def test_persons_decisions_are_derived_again_with_their_handoff() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin("circuit", "frozen-localiser:persistent"))
        assert ran.mission.handoff_id is not None
        handoff = stage.runtime.handoff(ran.mission.handoff_id)
        assert handoff.opened is not None
        look = LookAgain(actor=OPERATOR)
        assert isinstance(stage.supervisor.answer(handoff.handoff_id, look), Accepted)
        opened = stage.runtime.handoff(handoff.handoff_id).opened
        assert opened is not None
        approve = ApproveHandoff(
            actor=OPERATOR,
            reason="seen on camera",
            key="key-1",
            cycle=opened.cycle,
            subject=opened.subject,
            evidence=opened.evidence,
        )
        assert isinstance(stage.supervisor.answer(handoff.handoff_id, approve), Accepted)
        stage.run(ran.mission.mission_id)
        report = replay_mission(stage.runtime, ran.mission.mission_id)
        assert report.differences == ()
        assert report.handoffs >= 4 and report.reconstructed == 0
        before = replay_mission(rewritten(stage.parts, every=uncommanded), ran.mission.mission_id)
        assert before.differences == ()
        assert before.handoffs == report.handoffs and before.reconstructed > before.handoffs


def test_a_pause_and_a_stop_are_derived_again() -> None:
    with staged() as stage:
        mission_id = stage.begin("circuit")
        stage.until(mission_id, lambda mission: mission.invocation is not None and mission.invocation.intent.moves)
        stage.runtime.submit(mission_id, PauseMission(actor=OPERATOR, reason="a visitor"))
        stage.until(mission_id, lambda mission: mission.invocation is None)
        stage.runtime.submit(mission_id, ResumeMission(actor=OPERATOR, reason="gone again"))
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough for today"))
        assert stage.run(mission_id).mission.status == "cancelled"
        assert replay_mission(stage.runtime, mission_id).differences == ()


@pytest.mark.ledger("R146", symbol="harness.auditing.roles:RoleReplay._routing")
def test_a_provider_that_routing_did_not_choose_is_named(told: Told) -> None:
    position = told.stored("DispatchIntended", 1).position
    report = told.replayed(events={position: lambda e: changed(e, "careful-local-planner", "provider_id")})
    assert any("routing chose route-follower; careful-local-planner was sent" in line for line in lines(report))


class OtherVerdicts:
    """A log that says something else of every provider than what was stored."""

    def differs(self, stored: SettingHistory, card: CapabilityCard, *, half_life: float) -> OutcomeSums | None:
        return OutcomeSums(failed=3.0, weight=4.0)


@pytest.mark.ledger("R146", symbol="harness.auditing.roles:RoleReplay._sums")
def test_what_routing_was_told_of_a_provider_is_compared_with_the_log(told: Told) -> None:
    outcomes = OtherVerdicts()
    report = replay_mission(told.stage.runtime, told.mission_id, outcomes=outcomes)  # type: ignore[arg-type]
    assert any("the log says OutcomeSums(failed=3.0, weight=4.0" in line for line in lines(report))
    assert replay_mission(told.stage.runtime, told.mission_id).differences == ()


def test_a_log_of_the_first_release_is_replayed_without_a_difference_of_the_gate(tmp_path: Path) -> None:
    (tmp_path / "events.db").write_bytes(gzip.decompress(FIRST_RELEASE.read_bytes()))
    with read_harness(HarnessSettings(data_folder=tmp_path)) as runtime:
        (report,) = replay_all(runtime)
    blobless = ("VerdictRecorded", "GoalVerified")
    assert [line for line in lines(report) if not any(kind in line for kind in blobless)] == []
    assert report.decisions > 10 and report.skills == 7
    assert report.reconstructed == report.decisions + report.leases


def test_a_log_from_before_commands_were_stored_is_derived_again_and_says_so(told: Told) -> None:
    stored, guessed = told.replayed(), told.replayed(every=uncommanded)
    assert guessed.differences == ()
    assert (guessed.decisions, guessed.leases, guessed.state) == (stored.decisions, stored.leases, stored.state)
    assert guessed.reconstructed == guessed.decisions + guessed.leases


@pytest.mark.ledger("R146", symbol="harness.auditing.commands:command_at")
@pytest.mark.parametrize("kind", ["NodePlanned", "PacketRetained", "LeaseAcquired"])
def test_a_changed_command_is_named_by_its_digest(told: Told, kind: str) -> None:
    command = command_of(told.stored(kind))
    assert command is not None
    report = told.replayed(records={command: lambda body: body | {"command": "StopMission"}})
    assert any(f"command {command[:12]} was changed" in line for line in lines(report))


def test_a_command_that_was_taken_out_of_one_event_is_missed(told: Told) -> None:
    position = told.stored("PacketRetained", 1).position
    report = told.replayed(events={position: uncommanded})
    assert any(f"position {position}," in line and "no command is stored with it" in line for line in lines(report))


def test_a_command_that_another_decision_was_given_is_named(told: Told) -> None:
    first, second = told.stored("LeaseAcquired", 0), told.stored("LeaseAcquired", 1)
    other = command_of(first)
    assert other is not None and other != command_of(second)
    report = told.replayed(events={second.position: lambda body: body | {"command": other}})
    assert any(f"position {second.position}," in line for line in lines(report))


def test_verification_names_an_event_whose_command_is_not_stored(told: Told) -> None:
    position = told.stored("GoalVerified").position
    assert told.stage.parts.store.verify().position > position
    doctored = rewritten(told.stage.parts, events={position: lambda body: body | {"command": "0" * 64}})
    with raises_saying(LogDamaged, match="command 000000000000 that it names is not stored") as damaged:
        doctored.verify()
    assert f"position {position}" in str(damaged.value)


def uncommanded(body: Body) -> Body:
    """The event as a release before commands were stored would have written it."""
    return {name: value for name, value in body.items() if name != "command"}
