"""The paper's two missions from the command line: their figures recomputed from stored bytes, beside an independent
reference and beside the paper's own.
"""

import json
import re
from hashlib import sha256
from itertools import pairwise
from math import dist
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from tests.integration.runs import ROOT, truth

PAPER = {"go": (17.62, 0.11, 0.09), "return": (17.62, 0.17, 0.17), "circuit": (18.83, 0.25, 0.15)}
"""The paper's table: reference length, distance at the arrival's declaration, distance at the last pose; metres."""
TOLERANCE_M = 0.40
PAGE = ROOT / "docs" / "explanation" / "what-is-real.md"


class Leg(NamedTuple):
    """One navigating stage as it stands in the log: its packet, its contract's node, its trajectory."""

    packet: dict[str, Any]
    node: dict[str, Any]
    poses: list[dict[str, Any]]

    @property
    def target_m(self) -> tuple[float, float]:
        x, y = self.node["success_conditions"][0]["effect"]["target_m"]
        return x, y

    @property
    def arrival(self) -> dict[str, Any]:
        return next(one for one in self.packet["receipts"] if one["kind"] == "arrival")

    def away_m(self, at_s: float) -> float:
        """Distance to the target of the newest pose at an instant, metres."""
        pose = max((one for one in self.poses if one["at_s"] <= at_s), key=lambda one: one["at_s"])
        return dist((pose["x_m"], pose["y_m"]), self.target_m)


class Run(NamedTuple):
    """A data folder with both missions, and each mission's outcome and events by its template."""

    data: Path
    outcomes: dict[str, dict[str, Any]]
    events: dict[str, list[dict[str, Any]]]

    def blob(self, digest: str) -> bytes:
        """Stored bytes that match their digest now."""
        (path,) = (self.data / "blobs").rglob(f"*{digest}")
        body = path.read_bytes()
        assert sha256(body).hexdigest() == digest
        return body

    def bodies(self, template: str, kind: str) -> list[dict[str, Any]]:
        return [event["body"] for event in self.events[template] if event["kind"] == kind]

    def leg(self, node_id: str) -> Leg:
        template = "circuit" if node_id == "circuit" else "warehouse-inspection"
        packets = [one["packet"] for one in self.bodies(template, "PacketRetained")]
        packet = next(one for one in packets if one["identity"]["node_id"] == node_id)
        (contract,) = [one["contract"] for one in self.bodies(template, "ContractCompiled")]
        node = next(one for one in contract["nodes"] if one["node_id"] == node_id)
        (track,) = [one for one in packet["estimates"] if one["kind"] == "trajectory"]
        return Leg(packet, node, json.loads(self.blob(track["blob"]))["poses"])

    def segment(self, node_id: str) -> dict[str, Any]:
        return next(one for outcome in self.outcomes.values() for one in outcome["segments"] if one["name"] == node_id)


def regen(*words: str) -> dict[str, Any]:
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == 0, done.output
    return dict(json.loads(done.stdout))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    data, outcomes, events = tmp_path_factory.mktemp("paper"), {}, {}
    for template in ("warehouse-inspection", "circuit"):
        words = ("mission", "run", template, "--fidelity", "kinematic", "--speed", "0", "--data", str(data))
        outcomes[template] = regen(*words)
        found = regen("mission", "events", outcomes[template]["mission_id"], "--data", str(data))
        events[template] = found["events"]
    return Run(data, outcomes, events)


@pytest.mark.ask("navigation2#3257")
@pytest.mark.ledger("R199", entry="command line", symbol="harness.verification.predicates.arrival:arrival")
@pytest.mark.parametrize("node_id", PAPER)
def test_arrival_is_where_an_independent_reference_says_the_body_was(run: Run, node_id: str) -> None:
    leg, segment = run.leg(node_id), run.segment(node_id)
    poses = [one for one in truth(run.data) if one["kind"] == "pose"]

    def truly_m(at_s: float) -> float:
        pose = min(poses, key=lambda one: abs(one["at_s"] - at_s))
        assert abs(pose["at_s"] - at_s) < 1.0
        return dist((pose["x_m"], pose["y_m"]), leg.target_m)

    assert truly_m(leg.packet["collected_s"]) <= TOLERANCE_M
    assert segment["measured_distance_m"] == pytest.approx(truly_m(leg.packet["collected_s"]), abs=0.08)
    assert segment["declared_distance_m"] == pytest.approx(truly_m(leg.arrival["at_s"]), abs=0.08)


@pytest.mark.ledger("R199", entry="command line", symbol="simulator.navigation:RouteFollower.claim")
def test_the_velocity_interface_is_disarmed_before_the_observation_begins(run: Run) -> None:
    disarmed = next(one for one in run.leg("go").packet["receipts"] if one["kind"] == "disarm")
    intents = run.bodies("warehouse-inspection", "DispatchIntended")
    (observed,) = [one for one in intents if one["node_id"] == "panorama"]
    assert disarmed["at_s"] <= observed["dispatched_s"]


@pytest.mark.parametrize("node_id", PAPER)
def test_an_arrivals_receipt_and_its_verdict_point_to_the_bytes_they_rest_on(run: Run, node_id: str) -> None:
    leg = run.leg(node_id)
    estimate = json.loads(run.blob(leg.arrival["blob"]))
    last_s, x_m, y_m, _ = estimate["poses"][-1]
    assert dist((x_m, y_m), leg.target_m) == pytest.approx(leg.arrival["values"]["distance_m"], abs=0.01)
    assert last_s <= leg.arrival["at_s"]
    verdicts = [one["verdict"] for events in run.events.values() for one in _of(events, "VerdictRecorded")]
    (verdict,) = [one for one in verdicts if one["packet_id"] == leg.packet["identity"]["packet_id"]]
    arrived = verdict["results"][0]
    assert arrived["evidence"] == [one["blob"] for one in leg.packet["estimates"]]


@pytest.mark.ledger("R212", entry="command line", symbol="app.views.mission_json:_segment")
@pytest.mark.parametrize("node_id", PAPER)
def test_the_papers_table_is_recomputed_from_the_stored_trajectory(run: Run, node_id: str) -> None:
    leg, segment, (length_m, declared_m, last_m) = run.leg(node_id), run.segment(node_id), PAPER[node_id]
    route = leg.node["parameters"]["route"]
    assert sum(dist(a, b) for a, b in pairwise(route)) == pytest.approx(segment["reference_length_m"])
    assert segment["reference_length_m"] == pytest.approx(length_m, abs=0.005), "the paper's own route"
    at_arrival, at_end = leg.away_m(leg.arrival["at_s"]), leg.away_m(leg.poses[-1]["at_s"])
    assert segment["declared_distance_m"] == pytest.approx(at_arrival, abs=0.06)
    assert segment["last_pose_distance_m"] == pytest.approx(at_end, abs=1e-6)
    assert leg.poses[-1]["at_s"] > leg.arrival["at_s"], "the two columns are of two instants"
    shown = published()[node_id]
    assert shown[0] == (length_m, declared_m, last_m), "the page states the paper's figures as they are"
    for figure, now in zip(shown[1], (segment["reference_length_m"], at_arrival, at_end), strict=True):
        assert figure == pytest.approx(now, abs=0.10), "the page states what this simulator gives"


@pytest.mark.ledger("R216", entry="command line", symbol="harness.verification.predicates.circuit:circuit")
def test_the_circuits_evidence_is_recomputed_from_the_stored_trajectory(run: Run) -> None:
    leg = run.leg("circuit")
    start = leg.poses[0]
    assert dist((start["x_m"], start["y_m"]), leg.target_m) <= TOLERANCE_M, "it begins inside the arrival radius"
    assert leg.packet["dispatched_s"] < leg.packet["declared"]["departed_at_s"] < leg.arrival["at_s"]
    excursion = max(dist((one["x_m"], one["y_m"]), leg.target_m) for one in leg.poses)
    progress, remaining = leg.packet["declared"]["route_progress"], leg.packet["declared"]["remaining_m"]
    verdicts = [one["verdict"] for one in run.bodies("circuit", "VerdictRecorded")]
    measured = next(
        result["measured"] for one in verdicts for result in one["results"] if "excursion_m" in result["measured"]
    )
    assert measured["excursion_m"] == pytest.approx(excursion, abs=0.05)
    text = PAGE.read_text(encoding="utf-8")
    for name, (paper, now) in {
        "Farthest from the start": (6.20, excursion),
        "Declared progress": (99.6, 100 * progress),
        "Declared remaining": (0.068, remaining),
    }.items():
        found = re.search(rf"\| {name}[^|]*\| ([\d.]+) \| ([\d.]+) \|", text)
        assert found is not None, name
        assert float(found.group(1)) == paper
        assert float(found.group(2)) == pytest.approx(now, rel=0.05, abs=0.10)


def published() -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """The page's table: per leg the paper's three figures and this simulator's."""
    rows = re.findall(r"^\| `(\w+)` \|" + r" ([\d.]+) \|" * 6 + "$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: (tuple(map(float, figures[::2])), tuple(map(float, figures[1::2]))) for name, *figures in rows}


def _of(events: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [event["body"] for event in events if event["kind"] == kind]
