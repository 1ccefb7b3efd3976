"""Computes what truly happened and what the sensors reported of it, for the adjudicator. Pure. Imports nothing of the
harness.

All positions are planar metres in the map frame unless they come from odometry; instants are mission seconds.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from statistics import median
from typing import Any

MARGIN_M = 0.05
"""How far a sound measurement may be off: the localiser's noise is 6 mm, and three samples are taken."""
DEPARTURE_M = 0.8
PASSED_M = 1.6
"""A waypoint counts as passed inside the corridor of 1.5 m round it, where a detour may lead; and a margin."""
FRESH_S = 1.0
REST_M = 0.02
AGREE_M = 0.05
WINDOW_S = 2.0
SAMPLES = 3
STANDING_MPS = 0.02
SILENT_S = 2.0
SHARE = 0.9
DRIFT = 0.03
LOOKED_S = 2.0
"""Poses this long after standstill are a fresh look: they may set right what was doubtful in motion."""
LOOKED_BACK_S = 8.0
SPARSE = 10
"""Every tenth odometry sample, half a second apart: closer ones add their noise to the length."""
Line = Mapping[str, Any]
Fix = tuple[float, float, float]
"""Sensor time, x, y."""


def away(route: Line, lines: Sequence[Line], *, from_s: float, at_s: float) -> str:
    """Why the body was not where the route requires it at an instant, by ground truth; empty if it was."""
    poses = [one for one in lines if one["at_s"] <= at_s]
    if not poses:
        return "nothing is known of the body"
    off_m = math.dist((poses[-1]["x_m"], poses[-1]["y_m"]), route["target_m"])
    if off_m > route["tolerance_m"] + MARGIN_M:
        return f"the body was {off_m:.2f} m from the target"
    if route["kind"] != "circuit":
        return ""
    return unwalked(route, [(one["x_m"], one["y_m"]) for one in poses if one["at_s"] >= from_s])


def unwalked(route: Line, way: Sequence[tuple[float, float]]) -> str:
    """Why a path is not the circuit: it never left, or did not pass the waypoints in order; empty if it is."""
    if max((math.dist(point, route["target_m"]) for point in way), default=0.0) <= DEPARTURE_M:
        return "the body never left"
    waypoints, passed = route["route_m"], 0
    for point in way:
        if passed < len(waypoints) and math.dist(point, waypoints[passed]) <= PASSED_M:
            passed += 1
    return f"the body passed {passed} of {len(waypoints)} waypoints" if passed < len(waypoints) else ""


def reached_s(route: Line, lines: Sequence[Line], *, from_s: float) -> float | None:
    """The first instant after `from_s` at which the body stood where the route requires, having walked it; or None."""
    for one in lines:
        if one["at_s"] < from_s or abs(one["v_mps"]) > STANDING_MPS:
            continue
        if not away(route, lines, from_s=from_s, at_s=one["at_s"]):
            return float(one["at_s"])
    return None


def contradiction(route: Line, poses: Sequence[Fix], odometry: Sequence[Fix], *, from_s: float, at_s: float) -> str:
    """What the sensors report up to an instant that contradicts arrival, or is missing for it; empty if nothing.

    `poses` are the localiser's and `odometry` the wheels', both as published, in order of publication.
    """
    earlier = [one for one in poses if from_s <= one[0] <= at_s]
    newest = sorted({one[0]: one for one in earlier}.values())[-SAMPLES:]
    if len(newest) < SAMPLES:
        return f"{len(newest)} poses show where the body came to stand"
    age_s = at_s - newest[-1][0]
    if age_s > FRESH_S + MARGIN_M:
        return f"the newest pose was {age_s:.2f} s old"
    off_m = max(math.dist(one[1:], route["target_m"]) for one in newest)
    if off_m > route["tolerance_m"]:
        return f"the localiser itself says {off_m:.2f} m"
    wheels = [one for one in odometry if from_s <= one[0] <= at_s]
    moved_m = moved_in_last_second_m(wheels)
    if moved_m >= REST_M + 0.005:
        return f"odometry says that the body moved {moved_m:.3f} m in its last second"
    return (unshown(route, earlier, wheels) if route["kind"] == "circuit" else "") or torn(earlier, wheels)


def unshown(route: Line, poses: Sequence[Fix], odometry: Sequence[Fix]) -> str:
    """Why the sensors do not show the circuit: the localiser's path, or where it was silent the metres by odometry."""
    seen = sorted({one[0]: one for one in poses}.values())
    why = unwalked(route, [one[1:] for one in seen])
    if not why or max((b[0] - a[0] for a, b in pairwise(seen)), default=0.0) <= SILENT_S:
        return f"by the localiser {why}" if why else ""
    length_m = sum(math.dist(a, b) for a, b in pairwise(route["route_m"]))
    rolled_m = _rolled_m(odometry)
    return "" if rolled_m >= SHARE * length_m else f"the localiser was silent and the wheels rolled {rolled_m:.1f} m"


def moved_in_last_second_m(odometry: Sequence[Fix]) -> float:
    """Metres in the last second by the medians of its first and last third, as static is defined (D15)."""
    newest_s = max((one[0] for one in odometry), default=-math.inf)
    early = [one for one in odometry if newest_s - 1.0 <= one[0] < newest_s - 2.0 / 3.0]
    late = [one for one in odometry if one[0] >= newest_s - 1.0 / 3.0]
    if len(early) < 2 or len(late) < 2:
        return math.inf
    ends = [(median(one[1] for one in part), median(one[2] for one in part)) for part in (early, late)]
    return 1.5 * math.dist(*ends)


def torn(poses: Sequence[Fix], odometry: Sequence[Fix]) -> str:
    """Whether localiser and odometry tell different stories of the two seconds before standstill.

    Both are read at the same sensor times. Where the localiser was silent there, or was looked at again at rest, poses
    from before are compared with the newest ones, and the wheels may drift meanwhile.
    """
    if not odometry or not poses:
        return "a source is missing"
    end = odometry[-1]
    moving = [one for one in odometry if math.dist(one[1:], end[1:]) > REST_M]
    if not moving:
        return ""
    until_s = moving[-1][0]
    known = sorted({one[0]: one for one in poses}.values())
    stretch = [one for one in known if until_s - WINDOW_S <= one[0] <= until_s + 0.4]
    why, before_s = "a source is missing before standstill", until_s
    if len(stretch) >= 2 * SAMPLES:
        why, before_s = _apart(stretch, odometry, bound_m=2 * AGREE_M), until_s - LOOKED_BACK_S
        if known[-SAMPLES][0] <= until_s + LOOKED_S:
            return why
    looked = [*[one for one in known if one[0] < before_s][-SAMPLES:], *known[-SAMPLES:]]
    if not why or len(looked) < 2 * SAMPLES:
        return why
    drift_m = DRIFT * _rolled_m([one for one in odometry if one[0] >= looked[0][0]])
    return _apart(looked, odometry, bound_m=2 * AGREE_M + drift_m)


def _apart(fixes: Sequence[Fix], odometry: Sequence[Fix], *, bound_m: float) -> str:
    heads, tails = fixes[:SAMPLES], fixes[-SAMPLES:]
    apart_m = abs(_gone_m(heads, tails) - _gone_m(_at(heads, odometry), _at(tails, odometry)))
    return f"localiser and odometry differ by {apart_m:.2f} m" if apart_m > bound_m else ""


def _at(fixes: Sequence[Fix], odometry: Sequence[Fix]) -> list[Fix]:
    return [min(odometry, key=lambda one: abs(one[0] - fix[0])) for fix in fixes]


def _gone_m(heads: Sequence[Fix], tails: Sequence[Fix]) -> float:
    """Metres between the medians of two ends, so that one noisy sample decides nothing."""
    ends = [(median(one[1] for one in part), median(one[2] for one in part)) for part in (heads, tails)]
    return math.dist(*ends)


def _rolled_m(odometry: Sequence[Fix]) -> float:
    """Metres along the wheels' track."""
    return sum(math.dist(a[1:], b[1:]) for a, b in pairwise(sorted(odometry)[::SPARSE]))
