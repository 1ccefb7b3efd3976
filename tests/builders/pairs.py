"""Finds where the two missions of a pair diverge, and whether their random draws were the same until then (D31)."""

from harness.contracts.values import Value
from rsi_reviews.regression.case_run import MissionAccount
from rsi_reviews.regression.judge import lasting


class Parting(Value):
    """The first event that differs, in seconds after the missions' begin. A side that has ended has `nothing`."""

    at_s: float
    baseline: str
    candidate: str


def parting(baseline: MissionAccount, candidate: MissionAccount) -> Parting | None:
    """Where two accounts of the same case diverge; None if both took the same course to the end."""
    left, right = lasting(baseline), lasting(candidate)
    for (one, said), (other, answered) in zip(left, right, strict=False):
        if said != answered:
            at_s = min(one.mission_s - baseline.begun_s, other.mission_s - candidate.begun_s)
            return Parting(at_s=at_s, baseline=one.kind, candidate=other.kind)
    if len(left) == len(right):
        return None
    longer, begun_s = (left, baseline.begun_s) if len(left) > len(right) else (right, candidate.begun_s)
    first = longer[min(len(left), len(right))][0]
    kinds = (first.kind, "nothing") if longer is left else ("nothing", first.kind)
    return Parting(at_s=first.mission_s - begun_s, baseline=kinds[0], candidate=kinds[1])


def in_step(baseline: MissionAccount, candidate: MissionAccount, *, until_s: float) -> bool:
    """Whether body and sensors were the same in both for this many seconds after the missions' begin."""
    return _lived(baseline, until_s) == _lived(candidate, until_s)


def _lived(account: MissionAccount, until_s: float) -> list[tuple[object, ...]]:
    end_s = account.begun_s + until_s
    truth = [tuple(one.values()) for one in account.story["truth"] if one["at_s"] < end_s]
    sensed = [tuple(one) for name in ("poses", "odometry") for one in account.story[name] if one[0] < end_s]
    return [*truth, *sensed]
