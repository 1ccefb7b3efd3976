"""Several workers on one PostgreSQL that is restarted under them: a short slice, and the judge of the whole log."""

from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import pytest

from experiments.campaigns.mission import PlayedMission, played
from experiments.campaigns.plan import MissionPlan
from experiments.campaigns.publish import BEGIN, END, with_figures
from experiments.campaigns.workers import WorkersReport, doubled, lost, worked_missions

MISSIONS, SEEDS = 6, (4, 5, 6, 7)


@contextmanager
def errand() -> Iterator[PlayedMission]:
    with played(MissionPlan(seed=5, template="errand", faults=(), disturbances=(), approvals=0)) as mission:
        yield mission


def worked(seed: int) -> WorkersReport:
    """A slice without offence. Whether a worker needs the database while it is away is up to the machine."""
    report = worked_missions(MISSIONS, seed=seed, workers=2, every_s=(0.2, 0.5), most=2)
    assert report.offences == ()
    assert (report.lost, report.doubled) == (0, 0)
    assert (report.missions, sum(report.ends.values())) == (MISSIONS, MISSIONS)
    assert report.restarts <= 2
    return report


@pytest.mark.xdist_group("postgres")
@pytest.mark.ledger("R151", symbol="harness.gate.leases:_acquire")
def test_workers_whose_database_is_restarted_lose_nothing_double_nothing_and_share_no_lease() -> None:
    report = next(one for one in map(worked, SEEDS) if one.restarts and one.outages and one.contended)
    assert report.foreign_leases > 0
    assert report.dispatches >= 2 * MISSIONS and report.acknowledged < report.events
    page = with_figures(f"{BEGIN}{END}", {"workers": msgspec.to_builtins(report)})
    assert f"| {MISSIONS} by 2 workers with 4 robots: " in page
    assert f"| 0 lost, 0 doubled of {report.acknowledged} appends, no offence |" in page


def test_an_acknowledged_append_that_the_log_does_not_have_is_found() -> None:
    with errand() as mission:
        ends = [(event.position, event.digest) for event in mission.log]
        assert list(lost(mission.log, ends)) == []
        cut = mission.log[:-1]
        assert list(lost(cut, ends)) == [f"position {ends[-1][0]} was acknowledged and is lost"]
        other = [*cut, msgspec.structs.replace(mission.log[-1], digest=mission.log[0].digest)]
        assert len(list(lost(other, ends))) == 1


def test_a_mission_a_dispatch_or_a_commit_that_stands_twice_is_found() -> None:
    with errand() as mission:
        assert list(doubled(mission.log)) == []
        for kind in ("MissionCreated", "DispatchIntended", "NodeCommitted"):
            again = next(event for event in mission.log if event.kind == kind)
            (sentence,) = doubled([*mission.log, again])
            assert sentence.startswith(f"{kind} of ") and sentence.endswith("stands 2 times")
