"""The adjudicator by itself: stories told by hand, and what it imports."""

from typing import Any

import grimp
import pytest

from rsi_reviews.evaluation.adjudicator import StoryInvalid, adjudicate
from rsi_reviews.evaluation.witnesses import torn

ROUTE = {"kind": "arrival", "target_m": [4.0, 0.0], "tolerance_m": 0.4, "route_m": [[0.0, 0.0], [4.0, 0.0]]}
SPEED_MPS, REQUEST = 0.5, "request-1"


def walked(to_m: float, *, seen_m: float | None = None, poses_until_s: float = 100.0) -> dict[str, Any]:
    """The body goes from 0 to `to_m` from second 0 on, stands, and says it arrived; sensors see `seen_m` there."""
    arrived_s = to_m / SPEED_MPS
    times = [0.1 * step for step in range(int(10 * (arrived_s + 3.0)))]
    at = [min(to_m, SPEED_MPS * time) for time in times]
    off = 0.0 if seen_m is None else seen_m - to_m
    claimed_s = times[-1]
    return {
        "routes": {"go": ROUTE},
        "truth": [
            {"kind": "pose", "at_s": t, "x_m": x, "y_m": 0.0, "v_mps": SPEED_MPS * (x < to_m)}
            for t, x in zip(times, at, strict=True)
        ]
        + [{"kind": "terminal", "at_s": arrived_s + 0.3, "x_m": to_m, "y_m": 0.0, "v_mps": 0.0, "request_id": REQUEST,
            "text": "succeeded"}],
        "starts": [{"request_id": REQUEST, "node_id": "go", "attempt": 1, "at_s": 0.0, "moves": True}],
        "poses": [[t, x + off, 0.0] for t, x in zip(times, at, strict=True) if t <= poses_until_s],
        "odometry": [[t, x, 0.0] for t, x in zip(times, at, strict=True)],
        "claims": [{"node_id": "go", "at_s": claimed_s, "requests": [REQUEST], "act": "robot"}],
        "rejections": [],
        "declared": True,
        "ended_s": claimed_s,
    }  # fmt: skip


def start(request: str, *, at_s: float, attempt: int = 2) -> dict[str, Any]:
    """A further physical start of the same stage."""
    return {"request_id": request, "node_id": "go", "attempt": attempt, "at_s": at_s, "moves": True}


def test_what_was_done_and_shown_is_a_success() -> None:
    verdict = adjudicate(walked(4.0))
    assert verdict["success"]
    assert (verdict["contract_false"], verdict["epistemic_false"], verdict["unsupported"]) == ([], [], [])


@pytest.mark.ledger("R230", symbol="rsi_reviews.evaluation.adjudicator:_claim")
def test_a_claim_that_the_sensors_contradict_is_a_contract_false_completion() -> None:
    verdict = adjudicate(walked(2.0))
    assert verdict["false_success"]
    assert verdict["contract_false"] == ["go: the body was 2.00 m from the target; the localiser itself says 2.00 m"]
    assert verdict["epistemic_false"] == []


def test_a_claim_without_evidence_that_is_false_is_a_contract_false_completion_too() -> None:
    assert "1.90 s old" in adjudicate(walked(2.0, seen_m=4.0, poses_until_s=5.0))["contract_false"][0]


def test_a_claim_that_all_sensors_share_is_an_epistemic_false_completion() -> None:
    verdict = adjudicate(walked(3.0, seen_m=4.0))
    assert verdict["epistemic_false"] == ["go: the body was 1.00 m from the target"]
    assert verdict["contract_false"] == []


def test_a_true_claim_that_no_fresh_pose_shows_is_unsupported_and_no_false_completion() -> None:
    verdict = adjudicate(walked(4.0, poses_until_s=6.0))
    assert verdict["success"]
    assert len(verdict["unsupported"]) == 1


def test_a_claim_whose_request_never_started_is_a_contract_false_completion() -> None:
    story = walked(4.0)
    story["claims"][0]["requests"] = ["request-of-somebody-else"]
    assert "the robot never did it" in adjudicate(story)["contract_false"][0]


def test_a_place_bound_to_its_look_alike_is_judged_by_what_the_person_meant() -> None:
    story = walked(3.0) | {"bound": {"go": {**ROUTE, "target_m": [3.0, 0.0]}}}
    verdict = adjudicate(story)
    assert verdict["epistemic_false"]
    assert not verdict["truly_done"]


def test_a_route_is_truly_done_whatever_anybody_claimed() -> None:
    verdict = adjudicate(walked(4.0) | {"claims": [], "declared": False})
    assert verdict["truly_done"]
    assert verdict["missed"]
    assert not verdict["success"]


def test_a_circuit_that_never_left_is_not_done_though_its_goal_is_where_it_stands() -> None:
    circuit = {"kind": "circuit", "target_m": [0.0, 0.0], "tolerance_m": 0.4, "route_m": [[0, 0], [4, 0], [0, 0]]}
    verdict = adjudicate(walked(0.1) | {"routes": {"go": circuit}})
    assert not verdict["truly_done"]
    assert "never left" in verdict["contract_false"][0]


@pytest.mark.parametrize(
    ("second", "refuted", "sentence"),
    [
        (start(REQUEST, at_s=9.0, attempt=1), False, "was started 2 times"),
        (start("request-2", at_s=9.0, attempt=1), False, "attempt 1 of go was started 2 times"),
        (start("request-2", at_s=2.0), False, "its earlier execution was still running"),
        (start("request-2", at_s=9.0), False, "its earlier execution had succeeded"),
        (start("request-2", at_s=9.0), True, ""),
    ],
)
def test_a_physical_start_that_repeats_a_living_or_unrefuted_one_is_a_duplicate(
    second: dict[str, Any], refuted: bool, sentence: str
) -> None:
    story = walked(4.0)
    story["starts"].append(second)
    if refuted:
        story["rejections"].append(
            {"node_id": "go", "at_s": 8.5, "requests": [REQUEST], "why": "no fresh pose", "finished": True}
        )
    found = " ".join(adjudicate(story)["duplicate_starts"])
    assert sentence in found if sentence else found == ""


def test_a_refusal_of_what_was_truly_done_is_a_false_rejection() -> None:
    refused = {"node_id": "go", "at_s": 10.5, "requests": [REQUEST], "why": "no fresh pose", "finished": True}
    assert adjudicate(walked(4.0) | {"rejections": [refused]})["false_rejections"] == ["go: no fresh pose"]
    assert adjudicate(walked(2.0) | {"rejections": [refused]})["false_rejections"] == []


def test_a_dropout_at_the_edge_of_the_window_is_no_disagreement_and_a_jump_is_one() -> None:
    odometry = [(0.05 * step, min(4.0, 0.025 * step), 0.0) for step in range(240)]
    poses = [(t, x, y) for t, x, y in odometry[::2] if not 6.0 <= t <= 6.35]
    assert torn(poses, odometry) == ""
    jumped = [(t, x + 0.3 * (t > 7.2), y) for t, x, y in poses]
    assert "differ by 0.30 m" in torn(jumped, odometry)


@pytest.mark.parametrize(
    "broken",
    [{"routes": {}}, {"routes": {"go": {"kind": "arrival"}}}, {"truth": "none"}, {"declared": None, "poses": None}],
)
def test_a_story_that_lacks_something_is_refused_by_name(broken: dict[str, Any]) -> None:
    with pytest.raises(StoryInvalid):
        adjudicate(walked(4.0) | broken)
    with pytest.raises(StoryInvalid, match="fields_missing: odometry"):
        adjudicate({name: value for name, value in walked(4.0).items() if name != "odometry"})


def test_the_adjudicator_imports_nothing_of_the_harness() -> None:
    graph = grimp.build_graph("app", "harness", "rsi_reviews", cache_dir=None)
    behind = graph.find_upstream_modules("rsi_reviews.evaluation.adjudicator")
    assert behind == {"rsi_reviews.evaluation.witnesses"}
