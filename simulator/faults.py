"""Injects the faults of one mission: which there are, when each occurs, and how often it really did.

A transient fault affects the mission's first navigation only, and its effect on the sensors ends when another
invocation starts or CLEARED_AFTER_S after that one ended. A persistent one affects every navigation and stays.
`hidden-passage` puts a trolley before the passage from the start on; a transient one is rolled away after the first
panorama.
"""

from collections.abc import Sequence
from typing import Literal, get_args

from harness.contracts.errors import UnknownName
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because
from harness.contracts.values import Value
from simulator.sensors import LocaliserMode

FaultName = Literal[
    "stale-pose", "missing-pose", "frozen-localiser", "early-success", "duplicate-request", "interrupted",
    "blocked-passage", "lost-localisation", "biased-localiser", "follower-gives-up",
    "hidden-passage", "pushed-over",
]  # fmt: skip
FAULT_NAMES: tuple[FaultName, ...] = get_args(FaultName)
IN_MOTION: frozenset[FaultName] = frozenset(
    {"biased-localiser", "stale-pose", "frozen-localiser", "early-success", "interrupted", "follower-gives-up", "pushed-over"}
)
"""Faults that wait for a navigation to come to a certain place."""
ON_LEGS: frozenset[FaultName] = frozenset({"pushed-over"})
"""Faults that strike only a body with legs."""
CLEARED_AFTER_S = 10.0
LOST_FOR_S = 8.0
BIASED_BEFORE_M = 2.3
MID_LEG = 0.5
FROZEN_BEFORE_M = 1.5
EARLY_BEFORE_M = 2.5
DUPLICATE_AFTER_S = 1.0
FOLLOWER = "route-follower"
"""The one provider whose controller gives up under `follower-gives-up`; every other one drives on."""


class Fault(Value):
    """One fault of a mission."""

    name: FaultName
    persistent: bool = False


def parse_faults(texts: Sequence[str]) -> tuple[Fault, ...]:
    """`NAME` or `NAME:persistent`, one per text; raises UnknownName that lists the names."""
    found = []
    for text in texts:
        name, _, rest = text.partition(":")
        known = next((known for known in FAULT_NAMES if known == name), None)
        if known is None or rest not in ("", "persistent"):
            raise UnknownName(because("unknown_fault", name=text[:80], known=", ".join(FAULT_NAMES)))
        found.append(Fault(name=known, persistent=rest == "persistent"))
    return tuple(found)


class FaultPlan:
    """The faults of the robot during `mission_id`, from `began_s` on."""

    def __init__(self, mission_id: MissionId | None, faults: Sequence[Fault], *, began_s: float) -> None:
        self.mission_id = mission_id
        self.struck: dict[str, int] = {}
        self.untold = False
        """Whether something struck that no line of truth says yet; whoever writes the line clears it."""
        self._faults = {fault.name: fault for fault in faults}
        self.strikes_motion = any(name in IN_MOTION for name in self._faults)
        self._began_s = began_s
        self._navigations = 0
        self._mode: LocaliserMode = "good"
        self._mode_fault: Fault | None = None
        self._terminal_s: float | None = None
        self._once: set[FaultName] = set()
        for name in ("lost-localisation", "hidden-passage"):
            if name in self._faults:
                self._count(name)

    def mode(self, at_s: float) -> LocaliserMode:
        """The localiser's mode now."""
        if not self._faults:
            return "good"
        lost = self._faults.get("lost-localisation")
        if lost is not None and (lost.persistent or at_s < self._began_s + LOST_FOR_S):
            return "lost"
        fault, ended_s = self._mode_fault, self._terminal_s
        if fault is not None and not fault.persistent and ended_s is not None and at_s >= ended_s + CLEARED_AFTER_S:
            self._clear()
        return self._mode

    def invocation_starts(self, mission_id: MissionId, *, navigates: bool) -> None:
        """Another invocation begins: transient effects end, and a navigation is counted."""
        if self._mode_fault is not None and not self._mode_fault.persistent:
            self._clear()
        if mission_id == self.mission_id and navigates:
            self._navigations += 1
            self._once.clear()
            if self.strikes("missing-pose"):
                self._distort("missing-pose", "missing")

    def navigation_moves(self, *, share: float, remaining_m: float) -> None:
        """The navigation has covered `share` of its route; sensor faults begin where they are due."""
        if remaining_m <= BIASED_BEFORE_M and self.strikes("biased-localiser"):
            self._distort("biased-localiser", "biased")
        if share >= MID_LEG and self.strikes("stale-pose"):
            self._distort("stale-pose", "stale")
        if remaining_m <= FROZEN_BEFORE_M and self.strikes("frozen-localiser"):
            self._distort("frozen-localiser", "frozen")

    def navigation_ends(self, at_s: float) -> None:
        """The affected invocation became terminal."""
        self._terminal_s = at_s

    def ends_early(self, remaining_m: float) -> bool:
        """Whether success is declared now, metres before the goal."""
        return remaining_m <= EARLY_BEFORE_M and self.strikes("early-success")

    def interrupts(self, share: float, provider_id: str) -> bool:
        """Whether the controller gives up now, in the middle of the leg."""
        if share < MID_LEG:
            return False
        return self.strikes("interrupted") or (provider_id == FOLLOWER and self.strikes("follower-gives-up"))

    def pushes(self, share: float) -> bool:
        """Whether somebody pushes the robot over now, in the middle of the leg."""
        return share >= MID_LEG and self.strikes("pushed-over")

    def strikes(self, name: FaultName) -> bool:
        """Whether a fault affects the running navigation; counts it once per navigation."""
        fault = self._faults.get(name)
        if fault is None or self._navigations == 0 or name in self._once:
            return False
        if not fault.persistent and self._navigations > 1:
            return False
        self._once.add(name)
        self._count(name)
        return True

    @property
    def hides_passage(self) -> bool:
        """Whether something stands between the approach and the passage when the mission begins."""
        return "hidden-passage" in self._faults

    def forget_obstacles(self) -> None:
        """Somebody took away what stood in the way: it does not come back in this mission."""
        for name in ("blocked-passage", "hidden-passage"):
            self._faults.pop(name, None)

    def persistent(self, name: FaultName) -> bool:
        fault = self._faults.get(name)
        return fault is not None and fault.persistent

    def _distort(self, name: FaultName, mode: LocaliserMode) -> None:
        self._mode, self._mode_fault, self._terminal_s = mode, self._faults[name], None

    def _clear(self) -> None:
        self._mode, self._mode_fault = "good", None

    def _count(self, name: str) -> None:
        self.untold = True
        self.struck[name] = self.struck.get(name, 0) + 1
