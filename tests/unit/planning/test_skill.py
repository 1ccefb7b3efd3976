"""The skill role: C2 in, the parameters of one invocation out."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contexts.skill import skill_context
from harness.contracts.capabilities import CapabilityCard, Parameter
from harness.contracts.contexts import Context
from harness.contracts.errors import ContractInvalid
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import NodeId
from harness.planning.skill import propose_skill, requested
from harness.projections.mission import NodeState
from tests.saying import raises_saying
from tests.unit.planning.building import card, contract, fact, mission, service, spend, view

FRAMES = tuple(f"{number:064x}" for number in range(8))
ANALYSIS = service(
    "opencv-analysis",
    "analyse_passage",
    Parameter(name="images", type="digests"),
    Parameter(name="passage", type="points"),
)
DELIVERY = service(
    "message-outbox",
    "deliver_message",
    Parameter(name="text", type="string"),
    Parameter(name="images", type="digests"),
    Parameter(name="analysis", type="string", required=False),
)
OBSERVER = service(
    "observer",
    "observe",
    Parameter(name="duration_s", type="number", minimum=0.1),
    Parameter(name="frames", type="number", required=False, maximum=1),
)


def c2(node_id: str, provider: CapabilityCard, *facts: CommittedFact, **state: Any) -> Context:
    nodes = {node_id: NodeState(node_id=NodeId(node_id), **state)}
    return skill_context(view(replace(mission(None, **nodes), facts=facts)), NodeId(node_id), provider)


def panorama() -> CommittedFact:
    return fact("panorama", "panorama", frames=FRAMES, yaws_rad=[[0.0, 0.0]], position=[1.0, 2.0], heading_rad=0.5)


def test_navigation_gets_the_nodes_target_route_and_limits_and_nothing_the_card_lacks() -> None:
    proposal = propose_skill(c2("go", card()))
    node = contract().node(NodeId("go"))
    assert proposal.provider_id == "route-follower"
    assert proposal.parameters == {
        name: node.parameters[name] for name in ("route", "target", "frame", "tolerance_m", "speed_cap_mps")
    }
    assert "Dropped: lookahead_m" in sentence(proposal.reason)


@pytest.mark.ledger("R10", symbol="harness.planning.skill:propose_skill")
def test_a_further_attempt_asks_for_a_fresh_proposal_and_keeps_the_effect() -> None:
    first = propose_skill(c2("go", card())).parameters
    again = propose_skill(c2("go", card(), attempt=1, spends=(spend("retry", "interrupted"),))).parameters
    slower = round(0.6 * float(str(first["speed_cap_mps"])), 3)
    assert again == {**first, "replan": True, "speed_cap_mps": slower}, "nothing is known to have worked here"


@pytest.mark.ledger("R64", symbol="harness.planning.skill:propose_skill")
def test_another_provider_is_asked_for_the_same_effect() -> None:
    one = propose_skill(c2("go", card(), attempt=1))
    other = propose_skill(c2("go", card("careful-local-planner"), attempt=1))
    assert (one.provider_id, other.provider_id) == ("route-follower", "careful-local-planner")
    assert one.parameters == other.parameters


def test_the_analysis_gets_the_frames_of_the_committed_panorama() -> None:
    proposal = propose_skill(c2("analysis", ANALYSIS, panorama()))
    assert proposal.parameters["images"] == FRAMES
    assert proposal.parameters["passage"] == contract().node(NodeId("analysis")).parameters["passage"]


def test_the_message_gets_the_text_of_the_analysis() -> None:
    found = fact("analysis", "analysis_of", k=2, text="Two boxes stand in the passage.", report="ab" * 32)
    proposal = propose_skill(c2("delivery", DELIVERY, panorama(), found))
    assert proposal.parameters == {"text": "Two boxes stand in the passage.", "images": FRAMES, "analysis": "ab" * 32}


def test_the_spoken_report_tells_the_finding_as_progress_and_never_claims_success() -> None:
    speaker = service("espeak-voice", "speak", Parameter(name="text", type="string"))
    found = fact("analysis", "analysis_of", text="Two boxes stand in the passage.")
    sent = fact("delivery", "delivered", k=2, images=4)
    said = str(propose_skill(c2("report", speaker, found, sent)).parameters["text"])
    assert "Two boxes stand in the passage." in said
    assert not {"success", "completed", "accomplished"} & set(said.lower().split())


def test_a_newer_fact_of_the_same_node_wins() -> None:
    old, new = fact("panorama", "panorama", frames=FRAMES[:4]), fact("panorama", "panorama", k=5, frames=FRAMES)
    for facts in ((old, new), (new, old)):
        assert propose_skill(c2("analysis", ANALYSIS, *facts)).parameters["images"] == FRAMES


def test_a_fact_that_was_never_committed_grounds_nothing() -> None:
    with raises_saying(ContractInvalid, match=r"@\{panorama.frames\} is bound to nothing") as error:
        propose_skill(c2("analysis", ANALYSIS))
    assert "nodes.analysis.parameters.images" in error.value.where


def test_another_context_is_another_decision() -> None:
    go, back = c2("go", card()), c2("return", card())
    assert propose_skill(go).parameters["target"] != propose_skill(back).parameters["target"]
    assert propose_skill(replace(go, records=back.records)) == propose_skill(back)


def test_an_observing_provider_gets_a_look_and_not_the_nodes_motion() -> None:
    look = propose_skill(c2("go", OBSERVER, attempt=1, spends=(spend("re_perceive", "stale_evidence"),)))
    longer = propose_skill(c2("go", OBSERVER, attempt=2, spends=(spend("adjust_view", "ambiguous"),)))
    assert look.parameters == {"duration_s": 3.0, "frames": 1.0}
    assert longer.parameters == {"duration_s": 6.0, "frames": 1.0}
    assert "route" not in requested(contract().node(NodeId("go")), capability="observe")


@pytest.mark.parametrize(
    ("parameter", "says"),
    [
        (Parameter(name="speed_cap_mps", type="number", unit="m/s", maximum=0.3), r"0.5 m/s is outside -inf to 0.3"),
        (Parameter(name="speed_cap_mps", type="number", minimum=0.6), "0.5 is outside 0.6 to inf"),
        (Parameter(name="frame", type="number"), "It is no number"),
        (Parameter(name="target", type="points"), "It is no points"),
        (Parameter(name="payload_kg", type="number"), "A required parameter is not given"),
    ],
)
def test_a_parameter_outside_the_card_is_refused_and_named(parameter: Parameter, says: str) -> None:
    with raises_saying(ContractInvalid, match=says) as error:
        propose_skill(c2("go", card(parameters=(parameter,))))
    assert f"parameter {parameter.name}" in error.value.where
