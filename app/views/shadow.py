"""Shapes robots in shadow mode: what their own stacks declared, what was measured, and what is accepted of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, reasoned
from app.i18n.reasons import rendering as reasons
from app.views.bag_audits import KINDS
from app.views.shell import Shell
from harness.contracts.ids import RobotId
from harness.contracts.shadow import AGREEMENTS, Acceptance, Agreement, StackCondition, StackOutcome
from harness.contracts.values import Value
from harness.projections.shadow import ShadowCounts, ShadowGoal, ShadowGoals

SHOWN = 200
DECLARED: Mapping[StackOutcome, str] = {
    "succeeded": N_("succeeded"),
    "failed": N_("failed"),
    "cancelled": N_("cancelled"),
}
ACCEPTED: Mapping[Acceptance, str] = {
    "accepted": N_("reached"),
    "refused": N_("not reached"),
    "undecided": N_("undecided"),
}
AGREES: Mapping[Agreement, str] = {
    "agrees": N_("agrees"),
    "disagrees": N_("disagrees"),
    "undecided": N_("undecided"),
}
TONES: Mapping[str, str] = {"agrees": "good", "disagrees": "bad", "undecided": "warn"}
OLD_S = 5.0
"""A reading of a stack this old says nothing of now."""


@dataclass(frozen=True)
class ShadowRow:
    """One goal of a robot's own stack, with the three columns."""

    one: ShadowGoal

    @property
    def target(self) -> str:
        """Where it leads to; a dash where the stack does not say."""
        at = self.one.goal.target_m
        return f"({at[0]:.2f}, {at[1]:.2f})" if at is not None else "-"

    @property
    def declared(self) -> str:
        """The stack's own word."""
        if self.one.declared is not None:
            return DECLARED[self.one.declared]
        return N_("nothing") if self.one.lost is not None else N_("under way")

    @property
    def measured(self) -> str:
        """What the samples show; a dash where nothing was declared."""
        found = self.one.finding
        if found is None:
            return "-"
        parts = []
        if found.distance_m is not None:
            parts.append(lazy_gettext("{distance_m} m from the target", distance_m=f"{found.distance_m:.2f}"))
        if found.moved_m is not None:
            parts.append(lazy_gettext("went {moved_m} m in the 2 s after", moved_m=f"{found.moved_m:.2f}"))
        return listed(parts) if parts else N_("nothing")

    @property
    def lacks(self) -> tuple[str, ...]:
        """The kinds of evidence that are missing."""
        return tuple(KINDS[lack] for lack in self.one.finding.lacks) if self.one.finding is not None else ()

    @property
    def accepted(self) -> str:
        """What follows from the measurement alone."""
        return ACCEPTED[self.one.accepted] if self.one.accepted is not None else "-"

    @property
    def agreement(self) -> str:
        """Whether declared and accepted say the same; empty while nothing is declared."""
        found = self.one.agreement
        return AGREES[found] if found is not None else ""

    @property
    def tone(self) -> str:
        return TONES.get(self.one.agreement or "", "plain")

    @property
    def lost(self) -> str:
        """Why nobody waits for it any more; empty for one that was declared or is under way."""
        return reasoned(self.one.lost) if self.one.lost is not None else ""


@dataclass(frozen=True)
class ShadowRobot:
    """One robot in shadow mode. `live`: this process reads it now; else only the log speaks."""

    robot_id: RobotId
    condition: StackCondition | None
    counts: ShadowCounts
    rows: tuple[ShadowRow, ...]
    age_s: float | None

    @property
    def live(self) -> bool:
        return self.condition is not None

    @property
    def old(self) -> bool:
        """Whether nothing usable was read for a while."""
        return self.age_s is None or self.age_s > OLD_S

    @property
    def stack(self) -> str:
        """What decides there, by its own name."""
        named = self.condition.stack if self.condition is not None else ""
        return named or (self.rows[0].one.stack if self.rows else "")

    @property
    def trouble(self) -> str:
        """Why it cannot be read now; empty for none."""
        found = self.condition.trouble if self.condition is not None else None
        return reasoned(found) if found is not None else ""


@dataclass(frozen=True)
class ShadowFilter:
    """One choice of the filter by agreement."""

    value: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class ShadowRegion:
    """Every robot in shadow mode, now and in the log."""

    robots: tuple[ShadowRobot, ...]
    only: str


@dataclass(frozen=True)
class ShadowPage(ShadowRegion):
    """They inside the shell of a page."""

    shell: Shell
    filters: tuple[ShadowFilter, ...]


def shadow_robot(
    robot_id: RobotId, shadow: ShadowGoals, condition: StackCondition | None, *, now_s: float, only: str = ""
) -> ShadowRobot:
    """One robot, its newest goals first; `only`: those with this agreement."""
    found = [ShadowRow(one) for one in reversed(shadow.goals.values()) if only in ("", one.agreement)]
    heard_s = condition.heard_s if condition is not None else None
    return ShadowRobot(
        robot_id=robot_id,
        condition=condition,
        counts=shadow.counts,
        rows=tuple(found[:SHOWN]),
        age_s=max(0.0, now_s - heard_s) if heard_s is not None else None,
    )


def shadow_page(region: ShadowRegion, shell: Shell) -> ShadowPage:
    choices = (("", N_("all")), *((one, AGREES[one]) for one in AGREEMENTS))
    return ShadowPage(
        robots=region.robots,
        only=region.only,
        shell=shell,
        filters=tuple(ShadowFilter(value, title, value == region.only) for value, title in choices),
    )


class ShadowReport(Value):
    """What API and command line say of one robot in shadow mode; reasons as codes and facts."""

    robot_id: RobotId
    watched: bool
    stack: str
    age_s: float | None
    counts: ShadowCounts
    goals: tuple[ShadowGoal, ...]
    condition: StackCondition | None = None


def shadow_report(robot: ShadowRobot) -> ShadowReport:
    return ShadowReport(
        robot_id=robot.robot_id,
        watched=robot.live,
        stack=robot.stack,
        age_s=robot.age_s,
        counts=robot.counts,
        goals=tuple(row.one for row in robot.rows),
        condition=robot.condition,
    )


def report_json(robots: Sequence[ShadowRobot]) -> dict[str, Any]:
    """For the command line: the same as the API's, with sentences beside the codes."""
    return {"robots": [_json(one) for one in robots]}


def _json(robot: ShadowRobot) -> dict[str, Any]:
    found: dict[str, Any] = msgspec.to_builtins(shadow_report(robot))
    for row, goal in zip(robot.rows, found["goals"], strict=True):
        goal["agreement"] = row.one.agreement
        goal |= reasons.stated("lost", row.one.lost or "")
    return found
