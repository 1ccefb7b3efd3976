"""Plans a return to the safe point of the robot's zone, or says why it cannot start now; moves nothing (D27)."""

from dataclasses import dataclass
from math import hypot

from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.commands import AcquireLease
from harness.contracts.control import CONTROL
from harness.contracts.decisions import Refused, refused
from harness.contracts.errors import ContractInvalid
from harness.contracts.observations import Pose
from harness.contracts.protocol import ParameterValue
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.retreat_events import RETREAT, RetreatIntended, SendRetreat
from harness.contracts.values import Point
from harness.gate.commit import CommandEnvelope
from harness.projections.control import SiteControl
from harness.projections.mission import Mission
from harness.supervisor import zones
from harness.supervisor.leases import GRACE_S, tokens
from harness.supervisor.roles import RoleContexts
from harness.supervisor.standstill import AGE_S
from harness.verification.geometry import polyline_length

SLACK_S = 30.0
SLOWNESS = 2.0
"""The deadline allows this many times the way's length at its speed cap, and SLACK_S."""


@dataclass(frozen=True)
class Order:
    """Who lets a return start, and why. `task_id` and `attempt` identify it permanently."""

    task_id: ids.MissionId
    attempt: int
    actor: Actor
    reason: Explanation
    handoff_id: ids.HandoffId | None = None
    mission: Mission | None = None


def planned_retreat(roles: RoleContexts, order: Order) -> RetreatIntended | Refused:
    """The motion as it would run, or why it is not possible now. Looks at the robot; writes nothing."""
    if not roles.observations.collect(None):
        return refused("robot_silent")
    pose = newest_pose(roles)
    if pose is None or roles.observations.status is None:
        return refused("not_localised")
    site, at = roles.runtime.site, (pose.x_m, pose.y_m)
    zone = zones.zone_at(site.zones, at)
    if zone is None or zone.retreat is None:
        here = because("no_safe_place_here") if zone is None else because("zone_without_safe_place", zone=zone.name)
        return refused("no_safe_place", here)
    try:
        way = zones.way_of(site, zone)
    except ContractInvalid as error:
        return refused("retreat_invalid", error.reason)
    away_m = hypot(at[0] - way.place.approach_m[0], at[1] - way.place.approach_m[1])
    if away_m <= zones.ARRIVED_M:
        return refused("already_there", away_m=away_m, place=way.place.name)
    points = zones.ahead(way, at)
    if len(points) < 2:
        return refused("off_the_way", place=way.place.name)
    hindered = hindrance(roles, map_version=site.map_version) or _standing_still(roles) or _vetoed(roles, order)
    if hindered:
        return refused("not_ready", hindered)
    card = _able(roles, way)
    if card is None:
        return refused("no_provider", because("no_provider_that_slow"))
    return _intent(roles, order, way=way, points=points, card=card)


def sending(intent: RetreatIntended) -> list[CommandEnvelope]:
    """The intent with its leases: all or none, before anything is sent."""
    leases = [
        CommandEnvelope(
            ids.lease_stream(ids.leased(intent.robot_id, resource)),
            AcquireLease(
                resource=ids.leased(intent.robot_id, resource),
                mission_id=intent.task_id if intent.handoff_id else ids.MissionId(""),
                invocation_id=intent.invocation_id,
                token=token,
                expires_s=intent.deadline_s + GRACE_S,
            ),
            intent.robot_id,
        )
        for resource, token in intent.resources.items()
    ]
    return [CommandEnvelope(CONTROL, SendRetreat(intent=intent), intent.robot_id), *leases]


def hindrance(roles: RoleContexts, *, map_version: str) -> Reason | None:
    """Why a robot must not move now, from its own status and its newest pose; None if nothing speaks against it.

    The link is judged in wall time, the pose in the robot's time: a robot that runs fast is not a robot that is silent.
    """
    status, pose, now_s = roles.observations.status, newest_pose(roles), roles.observations.robot_s
    if status is None or not roles.observations.linked:
        return because("robot_status_old")
    if status.hardware_stop:
        return because("hardware_stop_engaged")
    if not status.localised or pose is None or now_s - pose.at_s > AGE_S:
        return because("robot_not_localised")
    if not status.map_version == pose.map_version == map_version:
        return because("robot_on_another_map", robot_map=status.map_version, way_map=map_version)
    return None


def newest_pose(roles: RoleContexts) -> Pose | None:
    return next((one for one in reversed(roles.observations.recent) if isinstance(one, Pose)), None)


def _standing_still(roles: RoleContexts) -> Reason | None:
    rest = roles.observations.rest()
    return None if rest.static else because("not_shown_at_rest", why=rest.reason)


def _vetoed(roles: RoleContexts, order: Order) -> Reason | None:
    """A veto of any mission that this robot has not ended, and of the one whose question expired."""
    mine = roles.runtime.open_missions(roles.connection.robot_id)
    for mission in [*mine, *([order.mission] if order.mission else [])]:
        for layer, why in sorted(mission.vetoes.items()):
            return because("motion_vetoed", layer=layer, why=why)
    control: SiteControl = roles.runtime.fold(CONTROL)
    teleoperation = control.wheels.get(roles.connection.robot_id)
    return because("driven_by_hand", actor=teleoperation.actor.name) if teleoperation else None


def _able(roles: RoleContexts, way: zones.ApproachPath) -> CapabilityCard | None:
    """The first connected navigator that drives as slowly as the path demands, and can be stopped and queried."""
    for card in roles.connection.cards:
        speed = next((one for one in card.parameters if one.name == "speed_cap_mps"), None)
        slow = speed is not None and (speed.minimum or 0.0) <= way.retreat.speed_cap_mps
        if card.capability == "navigate" and card.moves and card.cancel.acknowledged and slow:
            return card
    return None


def _intent(
    roles: RoleContexts, order: Order, *, way: zones.ApproachPath, points: tuple[Point, ...], card: CapabilityCard
) -> RetreatIntended:
    request, now_s = ids.request_id(order.task_id, RETREAT, order.attempt), roles.connection.clock.now().mission_s
    site, retreat = roles.runtime.site, way.retreat
    takes_s = SLOWNESS * polyline_length(points) / retreat.speed_cap_mps + SLACK_S
    parameters: dict[str, ParameterValue] = {
        "route": points,
        "target": way.place.approach_m,
        "frame": site.frame,
        "tolerance_m": zones.ARRIVED_M,
        "speed_cap_mps": retreat.speed_cap_mps,
    }
    return RetreatIntended(
        robot_id=roles.connection.robot_id,
        task_id=order.task_id,
        attempt=order.attempt,
        handoff_id=order.handoff_id,
        zone=way.zone,
        place_id=way.place.place_id,
        place=way.place.name,
        request_id=request,
        invocation_id=ids.invocation_id(request),
        provider_id=ids.ProviderId(card.provider_id),
        provider_version=card.version,
        capability=card.capability,
        parameters=parameters,
        resources=tokens(roles.runtime, roles.connection.robot_id, card.resources),
        target_m=way.place.approach_m,
        frame=site.frame,
        map_version=site.map_version,
        dispatched_s=now_s,
        deadline_s=now_s + takes_s,
        otherwise=retreat.otherwise,
        authorised_by=retreat.authorised_by,
        authorised_on=retreat.authorised_on,
        actor=order.actor,
        reason=order.reason,
    )
