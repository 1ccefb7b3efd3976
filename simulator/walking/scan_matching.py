"""Matches a lidar sweep against the map of a site: refined from an initial guess, or without one.

A match says how well it fits and what of the pose it determines; a sweep of two parallel walls determines no place
along them, and of two places that look alike none is chosen.
"""

import math

import msgspec
import numpy as np
import small_gicp
from numpy.typing import NDArray

from simulator.walking.survey import SurveyedMap

FAR_M, NEAR_M, INLIER_M = 0.5, 0.2, 0.12
"""How far from a hit its place on the map is looked for: first, then again from where that led."""
WEAK_SHARE = 0.03
"""A direction that fewer of the hits speak of is not determined: what is left is roughness of the map."""
ITERATIONS = 15
SIDES_M = (-0.12, 0.0, 0.12)
TURNS = 72
PLACES_M = 0.25
COARSE_POINTS, COARSE_M = 90, 0.15
REFINED, APART_M, APART_RAD = 12, 0.6, 0.35
ACCEPTED_SHARE, CLEARLY = 0.75, 0.08
LOWEST_M, HIGHEST_M = 0.12, 2.0
"""Only hits between these heights show edges of the plan."""
Pose = tuple[float, float, float]
Floats = NDArray[np.float64]


class Match(msgspec.Struct, frozen=True):
    """A pose (m, m, rad in the map), the share of hits that lie on the map, how far off those are, and `information`.

    `information`: for turn, x and y, shape (3, 3), in hits: what so many hits say about each, off by one metre.
    """

    pose: Pose
    share: float
    rms_m: float
    information: Floats


class ScanMatcher:
    """Matches sweeps of upright body points (z = 0 on the floor) against one map."""

    def __init__(self, survey: SurveyedMap) -> None:
        self._survey = survey
        self._places = survey.standing_places(PLACES_M)

    def refine(self, points: Floats, guess: Pose) -> Match:
        """Point-to-plane registration from a guess of the pose."""
        cloud, turned = small_gicp.PointCloud(points), _transform(guess)
        for reach_m in (FAR_M, NEAR_M):
            found = small_gicp.align(
                self._survey.cloud,
                cloud,
                self._survey.tree,
                init_T_target_source=turned,
                registration_type="PLANE_ICP",
                max_correspondence_distance=reach_m,
                max_iterations=ITERATIONS,
            )
            turned = np.asarray(found.T_target_source)
        pose = (float(turned[0, 3]), float(turned[1, 3]), math.atan2(turned[1, 0], turned[0, 0]))
        share, rms_m = self._fit(points, turned)
        return Match(pose=pose, share=share, rms_m=rms_m, information=_planar(np.asarray(found.H), turned))

    def best_around(self, points: Floats, guess: Pose) -> Match:
        """The best of several registrations around a guess: a wall has two sides, and the wrong one is near by."""
        x, y, yaw = guess
        around = [(x + dx, y + dy, yaw) for dx in SIDES_M for dy in SIDES_M]
        return max((self.refine(points, one) for one in around), key=_merit)

    def search(self, points: Floats) -> Match | None:
        """The one place on the map from which the sweep looks like this; None where there is none, or more than one."""
        upright = points[(points[:, 2] > LOWEST_M) & (points[:, 2] < HIGHEST_M), :2]
        if len(upright) < COARSE_POINTS // 3:
            return None
        matches = [self.refine(points, guess) for guess in self._guesses(upright)]
        best = max(matches, key=_merit, default=None)
        if best is None or best.share < ACCEPTED_SHARE:
            return None
        rivals = [one for one in matches if _apart(one.pose, best.pose) and _merit(one) > _merit(best) - CLEARLY]
        return None if rivals else self.best_around(points, best.pose)

    def _guesses(self, upright: Floats) -> list[Pose]:
        """The best distinct poses on a grid of places and turns, by how near the hits are to edges of the map."""
        few = upright[:: max(1, len(upright) // COARSE_POINTS)]
        scores = np.empty((TURNS, len(self._places)))
        for number in range(TURNS):
            angle = math.tau * number / TURNS
            cos, sin = math.cos(angle), math.sin(angle)
            hits = few @ np.array([[cos, sin], [-sin, cos]])
            away = self._survey.edge_m(self._places[:, None, :] + hits[None, :, :])
            scores[number] = np.exp(-0.5 * (away / COARSE_M) ** 2).mean(axis=1)
        chosen: list[Pose] = []
        for index in np.argsort(scores, axis=None)[::-1][:2000].tolist():
            number, place = divmod(index, len(self._places))
            x, y = self._places[place].tolist()
            pose = (x, y, math.remainder(math.tau * number / TURNS, math.tau))
            if all(_apart(pose, one) for one in chosen):
                chosen.append(pose)
            if len(chosen) == REFINED:
                break
        return chosen

    def _fit(self, points: Floats, turned: Floats) -> tuple[float, float]:
        """Share of upright hits near an edge of the map at this pose, and their root mean square distance."""
        upright = points[(points[:, 2] > LOWEST_M) & (points[:, 2] < HIGHEST_M)]
        if not len(upright):
            return 0.0, math.inf
        placed = upright @ turned[:3, :3].T + turned[:3, 3]
        away = self._survey.edge_m(placed[:, :2])
        near = away < INLIER_M
        return float(near.mean()), float(np.sqrt((away[near] ** 2).mean())) if near.any() else math.inf


def _transform(pose: Pose) -> Floats:
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin, 0.0, x], [sin, cos, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def _planar(hessian: Floats, turned: Floats) -> Floats:
    """Of the registration's information (turns and shifts in the body frame), that of yaw, x and y in the map frame."""
    body = hessian[np.ix_((2, 3, 4), (2, 3, 4))]
    into = np.eye(3)
    into[1:, 1:] = turned[:2, :2]
    planar: Floats = into @ body @ into.T
    strengths, directions = np.linalg.eigh(planar[1:, 1:])
    if strengths[0] < WEAK_SHARE * strengths.sum():
        across = np.eye(3)
        across[1:, 1:] -= np.outer(directions[:, 0], directions[:, 0])
        planar = across @ planar @ across
    return planar


def _merit(match: Match) -> float:
    return match.share - match.rms_m


def _apart(one: Pose, other: Pose) -> bool:
    turned = abs(math.remainder(one[2] - other[2], math.tau))
    return math.dist(one[:2], other[:2]) > APART_M or turned > APART_RAD
