"""Revises a contract so that a stage reads new frames, or drives another route: what a recovery step changes. Pure.

Frames are taken anew by the stage that took them; from elsewhere, a leg to the viewpoint comes before it.
"""

from msgspec.structs import replace

from harness.contracts.effects import Precondition
from harness.contracts.ids import NodeId
from harness.contracts.tasks import Node, RecoveryLimits, TaskContract
from harness.contracts.values import Point
from harness.planning import legs
from harness.planning.binding import names_in

VIEWPOINT = "viewpoint"
TIMEOUT_S = 180.0
LEG_BUDGET = RecoveryLimits(re_perceive=2, adjust_view=2, retry=1, local_replan=1, switch_skill=1, total=4)
REGION = "passage"
"""The parameter of a stage that names the floor which its frames are to show."""


def frames_of(contract: TaskContract, node: Node) -> Node | None:
    """The stage whose frames this one reads; None if it reads none."""
    read = names_in(node.parameters, sigil="@")
    taking = (one for one in contract.nodes if one.node_id in read and "capture_panorama" in one.capabilities)
    return next(taking, None)


def region_of(node: Node) -> tuple[Point, ...]:
    """The floor that the stage's frames are to show; empty where it names none."""
    stated = node.parameters.get(REGION, ())
    corners = stated if isinstance(stated, tuple | list) else ()
    return tuple((float(one[0]), float(one[1])) for one in corners if isinstance(one, tuple | list))


def seen_anew(contract: TaskContract, node: Node, source: Node) -> tuple[NodeId, ...]:
    """The stages that begin again so that the stage reads new frames: the one that takes them first, then itself."""
    return (source.node_id, node.node_id)


def seen_from(contract: TaskContract, source: Node, viewpoint: Point, *, route_m: tuple[Point, ...]) -> TaskContract:
    """The contract with a leg to the viewpoint, where `source` takes its frames anew."""
    name = _name(contract)
    place = Precondition(predicate="at_place", target_m=viewpoint, tolerance_m=legs.TOLERANCE_M)
    preconditions = tuple(one for one in source.preconditions if one.predicate != "at_place")
    bounds = [one.tolerance_m for one in source.preconditions if one.predicate == "at_place" and one.tolerance_m]
    moved = replace(
        source,
        depends_on=(*source.depends_on, name),
        preconditions=(replace(place, tolerance_m=min([legs.TOLERANCE_M, *bounds])), *preconditions),
    )
    at = contract.nodes.index(source)
    x, y = viewpoint
    leg = legs.leg(
        contract,
        name,
        viewpoint,
        subgoal=f"Go to another viewpoint at ({x:.1f}, {y:.1f})",
        arrived="The body is at the viewpoint, measured",
        route_m=route_m,
        depends_on=source.depends_on,
        timeout_s=TIMEOUT_S,
        recovery=LEG_BUDGET,
    )
    return replace(contract, nodes=(*contract.nodes[:at], leg, moved, *contract.nodes[at + 1 :]))


def rerouted(contract: TaskContract, node: Node, route_m: tuple[Point, ...]) -> TaskContract:
    """The contract with another route for one leg; target, tolerance and conditions stay."""
    at = contract.nodes.index(node)
    changed = replace(node, parameters={**node.parameters, "route": route_m})
    return replace(contract, nodes=(*contract.nodes[:at], changed, *contract.nodes[at + 1 :]))


def _name(contract: TaskContract) -> NodeId:
    taken = sum(node.node_id.startswith(f"{VIEWPOINT}-") for node in contract.nodes)
    return NodeId(f"{VIEWPOINT}-{taken + 1}")
