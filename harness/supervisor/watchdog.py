"""Turns the robot's condition into vetoes, epoch changes and observations that contradict accepted facts.

A veto is raised here under the layer `robot` and cleared here once its cause is gone; no other layer can (D16).
"""

from itertools import islice
from math import hypot

from msgspec.structs import replace

from harness.contracts.commands import ChangeEpoch, ClearVeto, MissionCommand, RaiseVeto, RecordObservation
from harness.contracts.control import CONTROL, SetAutonomy
from harness.contracts.evidence import CommittedFact
from harness.contracts.observations import Pose
from harness.contracts.reasons import because
from harness.projections.control import SiteControl
from harness.projections.mission import Mission, required_contract
from harness.supervisor.roles import RoleContexts

LAYER = "robot"
SAMPLES = 3
BEYOND_M = 0.2
"""Poses this far beyond its tolerance contradict a state fact, so that noise at the bound does not."""


class Watchdog:
    """Checks once per step; remembers what it reported, so that a lasting condition is one event."""

    def __init__(self, roles: RoleContexts) -> None:
        self._roles = roles
        self._map_version: str | None = None

    def look(self, mission: Mission) -> bool:
        """Submit what the robot's condition requires; True if the mission's state version may have changed."""
        commands = (*self._limit(mission), *self._stop(mission), *self._epoch(mission), *self._contradictions(mission))
        for command in commands:
            self._roles.runtime.submit(mission.mission_id, command)
        return bool(commands)

    def _limit(self, mission: Mission) -> tuple[MissionCommand, ...]:
        """Tell the mission the site's autonomy limit before its next dispatch, if it has changed."""
        control: SiteControl = self._roles.runtime.fold(CONTROL)
        if control.limited_by is None or control.autonomy == mission.autonomy_limit:
            return ()
        return (
            SetAutonomy(
                autonomy=control.autonomy, scope="house", actor=control.limited_by, reason=control.limit_reason
            ),
        )

    def _stop(self, mission: Mission) -> tuple[MissionCommand, ...]:
        status = self._roles.observations.status
        if status is None:
            return ()
        if status.hardware_stop and LAYER not in mission.vetoes:
            return (RaiseVeto(layer=LAYER, reason=because("hardware_stop_is_engaged")),)
        if not status.hardware_stop and LAYER in mission.vetoes:
            return (ClearVeto(layer=LAYER, reason=because("hardware_stop_is_released")),)
        return ()

    def _epoch(self, mission: Mission) -> tuple[MissionCommand, ...]:
        status = self._roles.observations.status
        if status is None or not status.map_version:
            return ()
        before = self._map_version or required_contract(mission).map_version
        self._map_version = status.map_version
        if status.map_version == before:
            return ()
        reason = because("map_changed", before=before, map_version=status.map_version)
        return (ChangeEpoch(map_version=status.map_version, reason=reason),)

    def _contradictions(self, mission: Mission) -> tuple[MissionCommand, ...]:
        """State facts that recent poses refute, unless a running execution is what ends them (D2)."""
        if invocation_moves(mission):
            return ()
        stated = [fact for fact in mission.facts if fact.kind == "state"]
        if not stated:
            return ()
        known = {name for reference in mission.observed for name in str(reference.values.get("refutes", "")).split()}
        newest = (sample for sample in reversed(self._roles.observations.recent) if isinstance(sample, Pose))
        poses = list(islice(newest, SAMPLES))[::-1]
        refuted = [f for f in stated if f.condition_id not in known and _refuted(f, poses)]
        if not refuted:
            return ()
        reference, _ = self._roles.observations.seal(poses, source="localiser")
        names = " ".join(fact.condition_id for fact in refuted)
        return (
            RecordObservation(
                node_id=refuted[0].node_id,
                reference=replace(reference, kind="contradiction", values={"refutes": names}),
                contradicts=tuple(fact.condition_id for fact in refuted),
            ),
        )


def invocation_moves(mission: Mission) -> bool:
    """Whether the open invocation may move the body."""
    return mission.invocation is not None and mission.invocation.intent.moves


def _refuted(fact: CommittedFact, poses: list[Pose]) -> bool:
    target, tolerance_m = fact.arguments.get("target_m"), fact.arguments.get("tolerance_m")
    if target is None or tolerance_m is None or len({p.at_s for p in poses}) < SAMPLES:
        return False
    return all(hypot(pose.x_m - target[0], pose.y_m - target[1]) > tolerance_m + BEYOND_M for pose in poses)
