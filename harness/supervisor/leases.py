"""Lease requests of an invocation: acquired with the intent, released only with the body at standstill (D14)."""

from dataclasses import dataclass
from typing import Protocol

from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import AcquireLease, FreeLease, QuarantineLease, ReleaseLease
from harness.contracts.control import CONTROL
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ProviderFailed
from harness.contracts.events import DispatchIntended
from harness.contracts.protocol import TERMINAL
from harness.contracts.reasons import Explanation, because
from harness.gate.commit import CommandEnvelope
from harness.projections.control import SiteControl
from harness.projections.leases import Lease
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.supervisor.observations import looked
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.standstill import WINDOW_S

GRACE_S = 10.0
"""A lease outlives the node's deadline by this much, so that the happy path needs no renewal."""
LOOK_S = 0.3
SUPERVISOR = Actor(name="supervisor", role="harness", channel="policy")


class MotionIntent(Protocol):
    """An intent, of a node or of a return to the safe point: whose leases it holds, and whether it moves the body."""

    @property
    def invocation_id(self) -> ids.InvocationId: ...

    @property
    def request_id(self) -> ids.RequestId: ...

    @property
    def provider_id(self) -> ids.ProviderId: ...

    @property
    def resources(self) -> dict[str, int]: ...

    @property
    def moves(self) -> bool: ...


@dataclass(frozen=True)
class HeldLeases:
    """What an execution was dispatched with, on which robot."""

    robot_id: ids.RobotId
    intent: MotionIntent


@dataclass(frozen=True)
class FreeOrder:
    """A person's order to free one resource, with the reason recorded in the log."""

    resource: ids.ResourceId
    actor: Actor
    reason: Explanation


def tokens(runtime: Runtime, robot_id: ids.RobotId, resources: tuple[ids.ResourceId, ...]) -> dict[str, int]:
    """The fencing token each acquisition would get."""
    return {resource: runtime.lease(ids.leased(robot_id, resource)).token + 1 for resource in resources}


def acquire(mission: Mission, intent: DispatchIntended) -> list[CommandEnvelope]:
    return [
        CommandEnvelope(
            ids.lease_stream(ids.leased(mission.robot_id, resource)),
            AcquireLease(
                resource=ids.leased(mission.robot_id, resource),
                mission_id=mission.mission_id,
                invocation_id=intent.invocation_id,
                token=token,
                expires_s=intent.deadline_s + GRACE_S,
            ),
            mission.robot_id,
        )
        for resource, token in intent.resources.items()
    ]


def holds(runtime: Runtime, robot_id: ids.RobotId, intent: MotionIntent) -> bool:
    """Whether the invocation still holds everything it was dispatched with."""
    leases = [runtime.lease(ids.leased(robot_id, resource)) for resource in intent.resources]
    return all(lease.status == "held" and lease.invocation_id == intent.invocation_id for lease in leases)


def give_back(runtime: Runtime, held: HeldLeases, *, at_rest: bool, reason: Explanation) -> list[CommandEnvelope]:
    """Release what the invocation holds, or quarantine it while the body may still move."""
    requests, intent = [], held.intent
    for resource in intent.resources:
        lease = runtime.lease(ids.leased(held.robot_id, resource))
        if lease.status != "held" or lease.invocation_id != intent.invocation_id:
            continue
        command = (
            ReleaseLease(invocation_id=intent.invocation_id, reason=reason)
            if at_rest or not intent.moves
            else QuarantineLease(invocation_id=intent.invocation_id, reason=reason)
        )
        requests.append(CommandEnvelope(ids.lease_stream(lease.resource), command, held.robot_id))
    return requests


def expired(
    runtime: Runtime, robot_id: ids.RobotId, resources: tuple[ids.ResourceId, ...], *, now_s: float
) -> list[CommandEnvelope]:
    """Quarantine what a holder kept past its expiry: it may be moving."""
    return [
        CommandEnvelope(
            ids.lease_stream(lease.resource),
            QuarantineLease(invocation_id=lease.invocation_id, reason=because("holder_unaccounted_for")),
            robot_id,
        )
        for resource in resources
        if (lease := runtime.lease(ids.leased(robot_id, resource))).status == "held" and lease.expires_s < now_s
    ]


def free(runtime: Runtime, mission: Mission, *, static: dict[str, float]) -> list[CommandEnvelope]:
    """Free what this mission's acknowledged executions left in quarantine, on static-body evidence. Never re-arms.

    An execution is acknowledged once its provider reported an end, which is when its packet is retained.
    """
    acknowledged = {p.identity.invocation_id for node in mission.nodes.values() for p in node.packets}
    return [
        CommandEnvelope(
            ids.lease_stream(lease.resource),
            FreeLease(actor=SUPERVISOR, static=static, reason=because("stop_shown_static")),
            mission.robot_id,
        )
        for lease in runtime.leases()
        if lease.status == "quarantined" and lease.invocation_id in acknowledged
    ]


def freed(runtime: Runtime, connection: RobotConnection, order: FreeOrder) -> Accepted[AnyEvent] | Refused:
    """A named person frees a resource (D14), on evidence from a new look at the robot's odometry.

    The previous holder is told to stop where it can be reached: what is freed is not resumed. An engaged hardware stop,
    as the robot reports it, counts as standstill. Nothing is started or re-armed. Raises ProviderUnreachable if the
    robot does not answer.
    """
    held = runtime.lease(order.resource)
    lost = _lost(runtime, connection.robot_id, held)
    if lost is not None:
        _halt(connection, held, lost)
    connection.clock.wait_until(connection.clock.now().mission_s + WINDOW_S + LOOK_S)
    command = FreeLease(actor=order.actor, static=_static(runtime, connection), reason=order.reason)
    return runtime.commit([CommandEnvelope(ids.lease_stream(order.resource), command, connection.robot_id)])


def _static(runtime: Runtime, connection: RobotConnection) -> dict[str, float]:
    """What shows the body at standstill now; empty if nothing is known."""
    seen = looked(runtime, connection)
    stopped = {"hardware_stop": 1.0} if seen.status is not None and seen.status.hardware_stop else {}
    return seen.rest().measured | stopped


def _lost(runtime: Runtime, robot_id: ids.RobotId, lease: Lease) -> ids.RequestId | None:
    """The request that a lease was acquired for: a return's, or an attempt's of its mission."""
    control: SiteControl = runtime.fold(CONTROL)
    retreat = control.retreats.get(robot_id)
    if retreat is not None and retreat.intent.invocation_id == lease.invocation_id:
        return retreat.intent.request_id
    if not lease.mission_id:
        return None
    mission = runtime.mission(lease.mission_id)
    attempts = ((node.node_id, number) for node in mission.nodes.values() for number in range(1, node.attempt + 1))
    requests = [ids.request_id(mission.mission_id, node_id, number) for node_id, number in attempts]
    return next((request for request in requests if ids.invocation_id(request) == lease.invocation_id), None)


def _halt(connection: RobotConnection, lease: Lease, lost: ids.RequestId) -> None:
    """Stop the execution that a lease was quarantined for, where it still runs and can be reached."""
    for provider in connection.providers.values():
        if (
            not any(lease.resource == ids.leased(connection.robot_id, one) for one in provider.card.resources)
            or provider.card.reattach != "by_request"
        ):
            continue
        try:
            found = provider.find(lost)
            his = found is not None and found.identity.provider_id == provider.card.provider_id
            if found is not None and his and found.status not in TERMINAL:
                provider.stop(found.handle)
        except ProviderFailed:
            continue
