"""Decides who may have a resource. Freed only at standstill; the fencing token only rises (D14). Pure."""

from typing import assert_never

from harness.contracts import commands, lease_events
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.leases import Lease, apply

STATIC_LIMIT_M = 0.02


def decide(lease: Lease, command: commands.LeaseCommand, now: Moment) -> Decision[lease_events.LeaseEvent]:
    """Accept or refuse one command for a resource."""
    match command:
        case commands.AcquireLease():
            return _acquire(lease, command)
        case commands.ReleaseLease():
            if lease.invocation_id != command.invocation_id or lease.status == "free":
                return refused("not_the_holder", invocation_id=command.invocation_id, resource=lease.resource)
            if lease.status == "quarantined":
                return refused("lease_quarantined", because("resource_must_be_freed", resource=lease.resource))
            return Accepted((lease_events.LeaseReleased(invocation_id=command.invocation_id, reason=command.reason),))
        case commands.QuarantineLease():
            if lease.status == "quarantined":
                return Accepted(())
            return Accepted(
                (lease_events.LeaseQuarantined(invocation_id=command.invocation_id, reason=command.reason),)
            )
        case commands.FreeLease():
            return _free(lease, command)
        case _:
            assert_never(command)


def _acquire(lease: Lease, command: commands.AcquireLease) -> Decision[lease_events.LeaseEvent]:
    if lease.status == "held" and lease.invocation_id == command.invocation_id:
        return Accepted(())
    if lease.status == "held":
        return refused(
            "lease_held", resource=command.resource, invocation_id=lease.invocation_id, mission_id=lease.mission_id
        )
    if lease.status == "quarantined":
        return refused(
            "lease_quarantined", because("resource_quarantined", resource=command.resource, reason=lease.reason)
        )
    if command.token != lease.token + 1:
        return refused("stale_token", token=command.token, last_token=lease.token)
    acquired = lease_events.LeaseAcquired(
        resource=command.resource,
        mission_id=command.mission_id,
        invocation_id=command.invocation_id,
        token=command.token,
        expires_s=command.expires_s,
    )
    return Accepted((acquired,))


def _free(lease: Lease, command: commands.FreeLease) -> Decision[lease_events.LeaseEvent]:
    if lease.status != "quarantined":
        return refused("not_quarantined", resource=lease.resource)
    displacement = command.static.get("displacement_m")
    stopped = command.static.get("hardware_stop") == 1.0
    if not stopped and (displacement is None or not displacement < STATIC_LIMIT_M):
        return refused("not_static", because("not_static_to_free"))
    return Accepted((lease_events.LeaseFreed(actor=command.actor, static=command.static, reason=command.reason),))


DECIDER: Decider[Lease, commands.LeaseCommand, lease_events.LeaseEvent] = Decider(
    initial=Lease(), apply=apply, decide=decide, codec=Codec(lease_events.LeaseEvent)
)
