"""Pure: who may have a resource. Freed only at rest; the fencing token only rises (D14)."""

from typing import assert_never

from harness.contracts.commands import AcquireLease, FreeLease, LeaseCommand, QuarantineLease, ReleaseLease
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.lease_events import LeaseAcquired, LeaseEvent, LeaseFreed, LeaseQuarantined, LeaseReleased
from harness.contracts.reasons import plain
from harness.contracts.values import Moment
from harness.projections.leases import Lease, apply

STATIC_LIMIT_M = 0.02


def decide(lease: Lease, command: LeaseCommand, now: Moment) -> Decision[LeaseEvent]:
    """Accept or refuse one request for a resource."""
    match command:
        case AcquireLease():
            return _acquire(lease, command)
        case ReleaseLease():
            if lease.invocation_id != command.invocation_id or lease.status == "free":
                return Refused("not_the_holder", f"{command.invocation_id} does not hold {lease.resource}.")
            if lease.status == "quarantined":
                return Refused("lease_quarantined", f"{lease.resource} is quarantined and must be freed.")
            return Accepted((LeaseReleased(invocation_id=command.invocation_id, reason=command.reason),))
        case QuarantineLease():
            if lease.status == "quarantined":
                return Accepted(())
            return Accepted((LeaseQuarantined(invocation_id=command.invocation_id, reason=command.reason),))
        case FreeLease():
            return _free(lease, command)
        case _:
            assert_never(command)


def _acquire(lease: Lease, command: AcquireLease) -> Decision[LeaseEvent]:
    if lease.status == "held" and lease.invocation_id == command.invocation_id:
        return Accepted(())
    if lease.status == "held":
        return Refused("lease_held", f"{command.resource} is held by {lease.invocation_id} of {lease.mission_id}.")
    if lease.status == "quarantined":
        return Refused("lease_quarantined", f"{command.resource} is quarantined: {plain(lease.reason)}")
    if command.token != lease.token + 1:
        return Refused("stale_token", f"Fencing token {command.token} is not the next after {lease.token}.")
    acquired = LeaseAcquired(
        resource=command.resource,
        mission_id=command.mission_id,
        invocation_id=command.invocation_id,
        token=command.token,
        expires_s=command.expires_s,
    )
    return Accepted((acquired,))


def _free(lease: Lease, command: FreeLease) -> Decision[LeaseEvent]:
    if lease.status != "quarantined":
        return Refused("not_quarantined", f"{lease.resource} is not quarantined.")
    displacement = command.static.get("displacement_m")
    stopped = command.static.get("hardware_stop") == 1.0
    if not stopped and (displacement is None or not displacement < STATIC_LIMIT_M):
        return Refused("not_static", "No evidence shows the robot at rest: stop it first, or engage the hardware stop.")
    return Accepted((LeaseFreed(actor=command.actor, static=command.static, reason=command.reason),))


DECIDER: Decider[Lease, LeaseCommand, LeaseEvent] = Decider(
    initial=Lease(), apply=apply, decide=decide, codec=Codec(LeaseEvent)
)
