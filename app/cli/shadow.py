"""regen shadow: what robots' own stacks declared, what was measured, and what is accepted of it."""

import time
from typing import Annotated

import typer

from app.cli import output
from app.i18n.reasons.rendering import sentence
from app.views.shadow import AGREES, ShadowRobot, ShadowRow, report_json, shadow_robot
from harness.bootstrap import read_harness
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.reasons import because
from harness.contracts.shadow import AGREEMENTS, SHADOWS, shadow_robot_id, shadow_stream

HEAD = ["robot", "goal", "declared", "measured", "accepted", "", "lacks"]


def shadow(
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    as_json: output.Json = False,
    robot: Annotated[str, typer.Option(help="Only this one.")] = "",
    only: Annotated[str, typer.Option(help="Only goals that: agrees, disagrees, undecided.")] = "",
) -> None:
    """Compare what the own stacks of robots with `authority: observe` declared with what their samples show.

    It reads the log, also beside a running console, which watches the robots. Exit 1 if a declared success is refused.
    """
    if only not in ("", *AGREEMENTS):
        raise ContractInvalid(because("shadow_filter_unknown", value=only[:40], known=AGREEMENTS), where="--only")
    with read_harness(output.settings(data_folder=output.data_of(data, site), site_folder=site)) as runtime:
        names = [*map(shadow_robot_id, runtime.streams(SHADOWS))]
        if robot and robot not in names:
            raise UnknownName(because("unknown_robot", robot_id=robot[:40], known=tuple(names)))
        found = [
            shadow_robot(one, runtime.fold(shadow_stream(one)), None, now_s=time.time(), only=only)
            for one in names
            if robot in ("", one)
        ]
    output.show(report_json(found), as_json=as_json, lines=_lines(found))
    raise typer.Exit(1 if any(one.counts.false_successes for one in found) else 0)


def _lines(robots: list[ShadowRobot]) -> list[str]:
    if not robots:
        return ["No robot was watched in shadow mode yet."]
    lines = []
    for one in robots:
        counts = one.counts
        lines.append(
            f"{one.robot_id} ({one.stack or 'unknown stack'}): {counts.noted} goals, {counts.declared} declared over, "
            f"{counts.succeeded} as successes; {counts.agrees} agree, {counts.disagrees} disagree "
            f"({counts.false_successes} successes that were none), {counts.undecided} undecided, {counts.lost} lost."
        )
    rows = [_row(one, row) for one in robots for row in one.rows]
    return lines + (output.table([HEAD, *rows]) if rows else [])


def _row(robot: ShadowRobot, row: ShadowRow) -> list[str]:
    one = row.one
    agrees = AGREES[one.agreement] if one.agreement is not None else ""
    lacks = ", ".join(one.finding.lacks) if one.finding is not None else ""
    why = sentence(one.lost) if one.lost is not None else lacks or "-"
    texts = [row.declared, row.measured, row.accepted, agrees]
    return [robot.robot_id, one.goal.goal_id, *map(str, texts), why]
