"""One picture through several stages, and views from several places: what the predicates accept and what not."""

from collections.abc import Sequence
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.effects import Relational, Symbolic, Visual
from harness.contracts.evidence import CommittedFact, EvidenceReference, PacketIdentity
from harness.contracts.ids import (
    ConditionId,
    Digest,
    InvocationId,
    MissionId,
    NodeId,
    PacketId,
    ProviderId,
    RequestId,
    sha256,
)
from harness.contracts.observations import Odometry, Trajectory
from harness.contracts.protocol import Receipt
from harness.contracts.tasks import EvidencePolicy
from harness.contracts.values import Point, encode, raw
from harness.contracts.verifier_inputs import CommittedNode, VerificationPolicy
from harness.verification.finding import Undecidable
from harness.verification.predicates.explored import explored
from harness.verification.predicates.pictures import one_image, pictured
from harness.verification.reading import Evidence

BODIES = {sha256(body): body for body in (b"first", b"second", b"third")}
FIRST, SECOND, THIRD = BODIES
MISSION = MissionId("m1")
SHARED = Relational(predicate="one_image", relation="one_image", subject="describe", object="capture")


def views(*places: tuple[Point, Digest]) -> list[CommittedFact]:
    return [fact(f"look-{at}", "pictured", image, at=at, place=place) for at, (place, image) in enumerate(places)]


def fact(node: str, name: str, image: Digest, *, at: int = 0, place: Point = (0.0, 0.0)) -> CommittedFact:
    return CommittedFact(
        name=name,
        kind="event",
        node_id=NodeId(node),
        condition_id=ConditionId(f"{node}.{name}"),
        packet_id=PacketId(f"pkt_{node}"),
        k=at,
        at_s=1000.0 + at,
        arguments={"images": [image]},
        measured={"x_m": place[0], "y_m": place[1]},
    )


def evidence(facts: Sequence[CommittedFact], *, nodes: Sequence[str] = ()) -> Evidence:
    records = [_record("facts", list(facts)), *(_record("node", _committed(name)) for name in nodes)]
    context = Context(
        role="verifier",
        mission_id=MISSION,
        node_id=None,
        k=9,
        at_s=1010.0,
        configuration=Digest("c" * 64),
        records=tuple(records),
    )
    return Evidence(context, BODIES.__getitem__)


def _record(kind: str, value: Any) -> ContextRecord:
    return ContextRecord(kind=kind, origin="verifier", source="mission", at_s=1000.0, value=raw(value), mandatory=True)


def _committed(name: str) -> CommittedNode:
    identity = PacketIdentity(
        mission_id=MISSION,
        node_id=NodeId(name),
        attempt=1,
        request_id=RequestId("r"),
        invocation_id=InvocationId("i"),
        packet_id=PacketId(f"pkt_{name}"),
        provider_id=ProviderId("p"),
        provider_version="1",
    )
    return CommittedNode(
        node_id=NodeId(name), identity=identity, requests=(), dispatched_s=0.0, terminal_s=1.0, committed_k=1
    )


def wanted(number: str = "2") -> Symbolic:
    return Symbolic(predicate="explored", arguments={"views": number, "apart_m": "1.0"})


@pytest.mark.parametrize(
    ("places", "verdict"),
    [
        ([((0.0, 0.0), FIRST), ((3.0, 0.0), SECOND)], "satisfied"),
        ([((0.0, 0.0), FIRST), ((0.5, 0.0), SECOND)], "violated"),
        ([((0.0, 0.0), FIRST), ((3.0, 0.0), FIRST)], "violated"),
        ([((0.0, 0.0), FIRST)], "violated"),
    ],
)
def test_views_count_once_per_place_and_per_picture(places: list[tuple[Point, Digest]], verdict: str) -> None:
    assert explored(wanted(), evidence(views(*places))).verdict == verdict


def test_a_view_whose_picture_is_gone_decides_nothing() -> None:
    with pytest.raises(Undecidable):
        explored(wanted("1"), evidence(views(((0.0, 0.0), Digest("f" * 64)))))


def test_a_number_that_is_none_decides_nothing() -> None:
    with pytest.raises(Undecidable, match=r"condition_without_argument .*views"):
        explored(wanted("some"), evidence([]))


@pytest.mark.parametrize(
    ("named", "verdict"),
    [
        ({"capture": FIRST, "describe": FIRST}, "satisfied"),
        ({"capture": FIRST, "describe": SECOND}, "violated"),
        ({"capture": FIRST}, "violated"),
    ],
)
def test_all_stages_share_one_checksum_or_the_goal_is_not_met(named: dict[str, Digest], verdict: str) -> None:
    facts = [fact(name, "pictured", image) for name, image in named.items()]
    assert one_image(SHARED, evidence(facts, nodes=("capture", "describe"))).verdict == verdict


def test_a_stage_that_was_not_accepted_leaves_it_open() -> None:
    facts = [fact("capture", "pictured", THIRD)]
    assert one_image(SHARED, evidence(facts, nodes=("capture",))).verdict == "ambiguous"


def looked(*, step_m: float = 0.0, receipt: bool = True, width_px: int = 160) -> Evidence:
    """One look of a second: a picture, its capture receipt, and odometry that moves so far per sample."""
    picture = cv2.imencode(".png", np.zeros((90, width_px), np.uint8))[1].tobytes()
    odometry = tuple(
        Odometry(
            seq=at,
            at_s=1000.0 + at / 20,
            source="odometry",
            frame="odom",
            x_m=step_m * at,
            y_m=0.0,
            yaw_rad=0.0,
            v_mps=0.0,
            w_radps=0.0,
        )
        for at in range(20)
    )
    track = encode(Trajectory(odometry=odometry))
    bodies = {sha256(body): body for body in (picture, track)}
    policy = VerificationPolicy(evidence=EvidencePolicy(mandatory=()), risk="low", required={})
    taken = Receipt(
        receipt_id="c", kind="capture", at_s=1000.0, source="camera", request_id=RequestId("r"), blob=sha256(picture)
    )
    records = [
        _record("policy", policy),
        _record("image", _reference("image", sha256(picture))),
        _record("trajectory", _reference("trajectory", sha256(track))),
        _record("receipts", [taken] if receipt else []),
    ]
    base = evidence([]).context
    return Evidence(msgspec.structs.replace(base, records=tuple(records)), bodies.__getitem__)


def _reference(kind: str, blob: Digest) -> EvidenceReference:
    return EvidenceReference(
        kind=kind,
        origin="sensor",
        source="camera",
        from_s=1000.0,
        until_s=1001.0,
        confidence=1.0,
        blob=blob,
        values={"role": "current"},
    )


@pytest.mark.parametrize(
    ("look", "verdict"),
    [
        (looked(), "satisfied"),
        (looked(step_m=0.02), "violated"),
        (looked(width_px=80), "violated"),
        (looked(receipt=False), "ambiguous"),
    ],
)
def test_a_picture_counts_if_it_is_whole_receipted_and_taken_at_rest(look: Evidence, verdict: str) -> None:
    assert pictured(Visual(predicate="pictured", frames=1, width_px=160, height_px=90), look).verdict == verdict
