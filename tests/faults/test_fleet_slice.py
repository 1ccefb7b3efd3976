"""Workers with several robots each on one PostgreSQL, one killed half-way, one link down: a short slice and its judge."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from experiments.campaigns.findings import Findings
from experiments.campaigns.fleet import BEGIN, END, FleetReport, fleet_missions, with_figures
from experiments.campaigns.fleet_shift import JudgedMission, judged_missions
from harness.contracts.ids import MissionId
from harness.contracts.values import encode

EACH, SEEDS = 2, (1, 2, 3, 4)


def sittings(seed: int, folder: Path) -> FleetReport:
    """A campaign that is left off at once and taken up again; without an offence, whenever the kill came."""
    fleet_missions(EACH, seed=seed, workers=2, robots_each=2, minutes=0.0, folder=folder)
    report = fleet_missions(EACH, seed=seed, workers=2, robots_each=2, folder=folder)
    assert report.offences == ()
    assert (report.lost, report.doubled) == (0, 0)
    assert report.missions == report.planned == sum(report.ends.values()) == 8
    assert report.sittings == 2
    return report


@pytest.mark.xdist_group("postgres")
@pytest.mark.ledger("R151", symbol="harness.gate.leases:_acquire")
def test_a_killed_worker_and_a_link_that_is_down_lose_nothing_and_double_nothing(tmp_path: Path) -> None:
    reports = (sittings(seed, tmp_path / str(seed)) for seed in SEEDS)
    report = next(one for one in reports if one.kills and one.unanswered)
    page = with_figures(f"{BEGIN}{END}", report)
    assert "| 8 of 8 by 2 workers with 4 robots on one PostgreSQL: " in page
    assert f"| 0 lost of {report.acknowledged:,} acknowledged appends, 0 doubled, 0 offences |" in page


def test_what_a_killed_worker_was_still_writing_is_not_read(tmp_path: Path) -> None:
    judged = JudgedMission(
        seed=1, mission_id=MissionId("msn_1"), robot_id="vbot-1-1", findings=Findings(), struck={}, end="succeeded"
    )
    file = tmp_path / "judged.jsonl"
    file.write_bytes(encode(judged) + b"\n" + encode(replace(judged, seed=2))[:40])
    assert list(judged_missions(file)) == [judged]
