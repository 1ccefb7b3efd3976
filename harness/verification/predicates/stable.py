"""temporal stable: an inner effect holds at every sampled instant of an interval, not only at its end (R14)."""

import math
from collections.abc import Callable
from itertools import pairwise

from harness.contracts.effects import AnyEffect, Temporal
from harness.contracts.reasons import because
from harness.contracts.rules import CAPTURES, LINEAGE
from harness.verification.body import current_track
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence

LOOKS = 40
"""At most this many looks, spread evenly over the samples of the interval; its ends are always looked at. Of a longer
interval, from rules 4 on, DENSER times as many as its bound needs."""
DENSER = 2
Find = Callable[[AnyEffect], Callable[[AnyEffect, Evidence], Finding] | None]


def stable(effect: AnyEffect, evidence: Evidence, *, find: Find) -> Finding:
    """The inner predicate's answer at sensor times of the last `interval_s`, each on what was seen until then.

    One look that refutes it is violated; one that cannot decide, or a gap above `bound` seconds, is ambiguous. From the
    rules on that trace levels, it is as old as what any look needed was at that look.
    """
    if not isinstance(effect, Temporal) or effect.inner is None:
        raise Undecidable(because("effect_not_testable", predicate="stable"))
    predicate = find(effect.inner)
    if predicate is None:
        return ambiguous(because("no_predicate", predicate=effect.inner.predicate))
    least = math.ceil(effect.interval_s / effect.bound) + 1 if evidence.policy.rules >= CAPTURES else 0
    looks = _looks(evidence, interval_s=effect.interval_s, most=max(LOOKS, DENSER * least))
    gap_s = max((b - a for a, b in pairwise(looks)), default=effect.interval_s)
    if gap_s > effect.bound:
        return ambiguous(because("gap_without_look", gap_s=gap_s, bound_s=effect.bound), gap_s=gap_s)
    found = [predicate(effect.inner, evidence.at(instant_s)) for instant_s in looks]
    worst = next((one for one in found if one.verdict == "violated"), None) or next(
        (one for one in found if one.verdict != "satisfied"), found[-1]
    )
    held = sum(one.verdict == "satisfied" for one in found)
    ago_s = looks[-1] - looks[found.index(worst)]
    steady = because("held_at_looks", held=held, looks=len(found), interval_s=effect.interval_s)
    return Finding(
        verdict=worst.verdict,
        reason=steady
        if worst.verdict == "satisfied"
        else because("not_at_look", held=steady, ago_s=ago_s, reason=worst.reason),
        measured={**worst.measured, "looks": float(len(found)), "held": float(held), "gap_s": gap_s},
        bounds={**worst.bounds, "held": float(len(found)), "gap_s": effect.bound},
        sources=found[-1].sources,
        evidence=found[-1].evidence,
        age_s=_age_s(found, evidence, newest_s=looks[-1]),
    )


def _age_s(found: list[Finding], evidence: Evidence, *, newest_s: float) -> float:
    """The inner predicate may need a source that is silent, while the looks go on with another one."""
    age_s = max(0.0, evidence.speaks_at_s - newest_s)
    if evidence.policy.rules < LINEAGE:
        return age_s
    return max(age_s, *(one.age_s or 0.0 for one in found))


def _looks(evidence: Evidence, *, interval_s: float, most: int) -> list[float]:
    """Sensor times of the interval that ends with the newest sample; the first lies at its beginning or before."""
    track = current_track(evidence)
    times = sorted({*(one.at_s for one in track.odometry), *(pose.at_s for pose in track.poses)})
    if not times:
        raise Undecidable(because("no_samples_of_execution"))
    begin_s = times[-1] - interval_s
    earlier = [at_s for at_s in times if at_s <= begin_s]
    if not earlier:
        raise Undecidable(because("samples_do_not_cover", interval_s=interval_s, until_s=times[-1]))
    within = [earlier[-1], *(at_s for at_s in times if at_s > begin_s)]
    step = max(1, len(within) // most)
    return sorted({*within[::step], within[-1]})
