"""Exploration: where to look next, what may be chosen, and the results of earlier choices, in metres (map frame)."""

from typing import Annotated

import msgspec

from harness.contracts import values
from harness.contracts.ids import Digest, MissionId, NodeId, PacketId
from harness.contracts.reasons import Explanation

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
Region = tuple[values.Point, ...]


class GridMap(values.Value, omit_defaults=True):
    """What the lidar showed of the floor: `rows` x `columns` cells of UNKNOWN, FREE or OCCUPIED, row by row from
    `origin_m`, the lower left corner. `region` holds 1 for each cell that is to be seen; empty: every cell is.
    """

    frame: values.Name
    map_version: values.Name
    origin_m: values.Point
    cell_m: values.Positive
    columns: Annotated[int, msgspec.Meta(ge=1)]
    rows: Annotated[int, msgspec.Meta(ge=1)]
    cells: bytes
    region: bytes = b""


class Frontier(values.Value):
    """An edge of what is known that can be approached: `edge_m` its middle, `approach_m` where to stand for it.

    `length_m` is how much of the edge there is, `way_m` how long the known way to the approach is.
    """

    edge_m: values.Point
    approach_m: values.Point
    length_m: values.NonNegative
    way_m: values.NonNegative


class Feedback(values.Value, tag_field="kind"):
    """The result of an earlier target, read by whoever proposes the next one (R223)."""

    node_id: NodeId
    target_m: values.Point


class Reached(Feedback, tag="reached"):
    """The body arrived, measured. `moved_m`: the path it took."""

    moved_m: values.NonNegative


class BlockedTarget(Feedback, tag="blocked"):
    """The target was given up. `failure` is the class of the last failure, `reason` the harness's own record of it."""

    failure: values.Name
    reason: Explanation


class MapChanged(Feedback, tag="map_changed"):
    """The map changed on the way there: floor newly known, and known floor that is now closed."""

    before: Digest
    after: Digest
    opened_m2: values.NonNegative
    closed_m2: values.NonNegative


AnyFeedback = Reached | BlockedTarget | MapChanged


class TargetQuestion(values.Value):
    """All that a proposer is shown: the newest picture, the map, its frontiers, and the results of earlier targets.

    `left` targets may still be chosen. `zones_m`: floor on which the robot may be; `keep_out_m`: floor it may not
    enter; `longest_way_m` bounds one leg.
    """

    mission_id: MissionId
    configuration: Digest
    k: values.Count
    at_s: float
    objective: values.Name
    frame: values.Name
    map_version: values.Name
    position_m: values.Point
    image: Digest
    map: Digest
    frontiers: tuple[Frontier, ...]
    feedback: tuple[AnyFeedback, ...]
    left: values.Count
    longest_way_m: values.Positive
    zones_m: tuple[Region, ...]
    keep_out_m: tuple[Region, ...] = ()


class TargetProposal(values.Value):
    """A bounded target and the reason to go there. It has no authority: the harness admits it or uses its own
    (R222)."""

    target_m: values.Point
    reason: Explanation


class TargetAnswer(values.Value):
    """What the proposer answered, why it was refused if it was, and what the harness chose; none if nothing is left.

    `route_m` leads from the body to the target over floor that the map shows free.
    """

    planner: values.Name
    said: TargetProposal | None
    refused: Explanation
    chosen: TargetProposal | None
    route_m: Region = ()


class TargetChoice(values.Value):
    """One admitted target, bound to the mission, its configuration version and the state version it was chosen at.

    `question` and `answer` are the records of the choice; `image` is the picture and `map` the map it was made from.
    """

    mission_id: MissionId
    configuration: Digest
    k: values.Count
    target_m: values.Point
    reason: Explanation
    planner: values.Name
    refused: Explanation
    image: Digest
    map: Digest
    question: Digest
    answer: Digest


class MapUpdate(values.Value):
    """One map update: from these sweeps of the lidar, taken during the executions of these packets."""

    before: Digest
    after: Digest
    packets: tuple[PacketId, ...]
    sweeps: tuple[Digest, ...]
    known_m2: values.NonNegative
    opened_m2: values.NonNegative
    closed_m2: values.NonNegative
