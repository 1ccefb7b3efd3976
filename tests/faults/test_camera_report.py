"""The camera report: a planned capture, keeping and description of one picture, without a single motion."""

from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import pytest

from app.i18n.reasons.rendering import sentence
from harness.auditing.replay import replay_mission
from harness.baseline.load import shipped_workspace
from harness.bootstrap import simulated
from harness.contracts.decisions import Accepted
from harness.contracts.events import DispatchIntended
from harness.contracts.ids import Digest, NodeId, sha256
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import decode
from harness.extra_templates import begin, draft, offered
from harness.planning.decomposition import (
    ONE_AFTER_ANOTHER,
    PlanStep,
    StagePlan,
    StagePlanner,
    one_after_another,
    stage_plan_refusal,
)
from harness.planning.templates import by_name
from harness.projections.mission import required_contract
from harness.provider_protocol.delegation import DelegatingProvider
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.connections import only, staged
from tests.builders.missions_run import OPERATOR, ROBOT, Ran
from tests.builders.tampering import rewritten

GOAL = "Please take a picture and describe what is there"
CAPTURE, PERSIST, DESCRIBE = NodeId("capture"), NodeId("persist"), NodeId("describe")


@contextmanager
def reported(planner: StagePlanner = ONE_AFTER_ANOTHER, *, goal: str = GOAL) -> Iterator[Ran]:
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3) as harness:
        start = Start(actor=OPERATOR, robot_id=ROBOT, goal=goal, seed=3)
        assert isinstance(begin(harness.runtime, start, planner=planner), Accepted)
        mission = harness.supervisor.run(harness.runtime.missions()[0].mission_id)
        yield Ran(harness=harness, mission=mission, truth=())


def proposing(*steps: tuple[str, str, tuple[str, ...]]) -> StagePlanner:
    """A planner that answers with these steps: stage, capability, after."""

    def propose(goal: str, template: TaskTemplate) -> StagePlan:
        planned = (
            PlanStep(stage=NodeId(stage), capability=capability, after=tuple(NodeId(one) for one in after))
            for stage, capability, after in steps
        )
        return StagePlan(steps=tuple(planned), reason="A picture is taken, kept, and then described.")

    return StagePlanner(name="language-model", propose=propose)


MODEL = proposing(
    ("capture", "observe", ()),
    ("persist", "keep_evidence", ("capture",)),
    ("describe", "describe_image", ("persist",)),
)


@pytest.mark.ledger("R225", symbol="harness.verification.predicates.pictures:one_image")
@pytest.mark.ledger("R225", symbol="harness.verification.predicates.pictures:same_image")
def test_a_planned_picture_is_taken_kept_and_described_without_any_motion() -> None:
    with reported(MODEL) as ran:
        mission, runtime = ran.mission, ran.harness.runtime
        assert mission.status == "partly_verified", mission.reason
        assert (mission.labels["planner"], "plan_refused" in mission.labels) == ("language-model", False)
        plan = decode(runtime.blob(Digest(mission.labels["plan"])), StagePlan)
        assert [step.stage for step in plan.steps] == [CAPTURE, PERSIST, DESCRIBE] == [*mission.nodes]
        starts = ran.harness.starts(mission.mission_id)
        assert [start.node_id for start in starts] == [CAPTURE] and not any(start.moves for start in starts)
        assert not any(event.moves for event in ran.events if isinstance(event, DispatchIntended))
        images = {fact.node_id: fact.arguments["images"] for fact in mission.facts}
        assert set(images) == {CAPTURE, PERSIST}, "the description is declared"
        ((checksum,),) = {tuple(found) for found in images.values()}
        assert sha256(runtime.blob(checksum)) == checksum
        assert replay_mission(runtime, mission.mission_id).differences == ()


MOVING = proposing(("go", "navigate", ()), ("capture", "observe", ("go",)))
UNORDERED = proposing(
    ("capture", "observe", ()),
    ("describe", "describe_image", ("capture",)),
    ("persist", "keep_evidence", ("describe",)),
)


@pytest.mark.ledger("R225", symbol="harness.planning.decomposition:stage_plan_refusal")
@pytest.mark.parametrize(
    ("planner", "rule"),
    [
        (MOVING, "not_offered"),
        (proposing(("capture", "navigate", ())), "another_capability"),
        (proposing(("capture", "observe", ())), "stage_missing"),
        (UNORDERED, "out_of_order"),
        (proposing(("capture", "observe", ("describe",)), ("describe", "describe_image", ("capture",)),
                   ("persist", "keep_evidence", ("capture",))), "circular"),
        (proposing(("capture", "observe", ("light",)), ("persist", "keep_evidence", ()),
                   ("describe", "describe_image", ())), "not_planned"),
        (proposing(("capture", "observe", ()), ("capture", "observe", ())), "planned_twice"),
    ],
)  # fmt: skip
def test_a_plan_that_moves_leaves_out_or_reorders_is_refused_and_the_harness_takes_its_own(
    planner: StagePlanner, rule: str
) -> None:
    with reported(planner) as ran:
        assert ran.mission.labels["plan_refused"].startswith(f"{rule}: ")
        assert ran.mission.status == "partly_verified"
        assert not any(start.moves for start in ran.harness.starts(ran.mission.mission_id))


def test_a_planner_that_breaks_stops_nothing() -> None:
    def broken(goal: str, template: TaskTemplate) -> StagePlan:
        raise ConnectionError("no model here")

    with reported(StagePlanner(name="language-model", propose=broken)) as ran:
        assert "ConnectionError: no model here" in ran.mission.labels["plan_refused"]
        assert "plan" not in ran.mission.labels and ran.mission.status == "partly_verified"


class Exchanging(DelegatingProvider):
    """Says that it kept another picture than the one it was given."""

    def report(self, handle: str) -> object:  # type: ignore[override]
        said = self.inner.report(handle)
        if said.status != "succeeded":
            return said
        blobs = self.inner._blobs  # type: ignore[attr-defined]
        other = msgspec.json.decode(blobs.get(said.receipts[0].blob)) | {"image": "0" * 64}
        receipt = msgspec.structs.replace(said.receipts[0], blob=blobs.put(msgspec.json.encode(other)))
        return msgspec.structs.replace(said, receipts=(receipt,))


def test_a_keeper_that_names_another_picture_is_not_accepted() -> None:
    with staged(wrap=only("keep_evidence", Exchanging)) as stage:
        ran = stage.run(stage.begin(by_name("camera-report", shipped_workspace().missions)))
        assert ran.mission.status not in ("succeeded", "partly_verified")
        assert ran.verdicts("persist")[0] == "violated"
        assert "not the accepted picture" in sentence(ran.mission.of(PERSIST).verdicts[0].reason)
        assert replay_mission(rewritten(stage.parts), ran.mission.mission_id).differences == ()


def test_templates_beside_the_configuration_are_offered_and_drafted_as_they_start() -> None:
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3) as harness:
        names = [template.name for template in offered(harness.runtime, ROBOT)]
        beside = ["camera-report", "exploration", "explore-place", "go-to-place", "photograph-subject", "wait-at-place"]
        assert names == ["circuit", "recording", "warehouse-inspection", *beside]
        start = Start(actor=OPERATOR, robot_id=ROBOT, template="camera-report")
        drafted = draft(harness.runtime, start)
        assert harness.runtime.missions() == []
        assert isinstance(begin(harness.runtime, start), Accepted)
        assert required_contract(harness.runtime.missions()[0]) == drafted
        own = Start(actor=OPERATOR, robot_id=ROBOT, template="circuit")
        assert draft(harness.runtime, own) == harness.runtime.draft(own)


def test_the_templates_own_plan_is_admissible() -> None:
    for template in shipped_workspace().missions:
        assert stage_plan_refusal(one_after_another("", template), template=template) is None
