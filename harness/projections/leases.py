"""Folds who holds a resource now. A lease is coordination metadata, never an emergency stop (R86). Pure."""

from typing import Literal, assert_never

from msgspec.structs import replace

from harness.contracts import lease_events
from harness.contracts.ids import InvocationId, MissionId, ResourceId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Value


class Lease(Value):
    """A time-bounded reservation with owner and expiry (R84). `token` is the newest fencing token issued."""

    version: Count = 0
    resource: ResourceId = ResourceId("")
    status: Literal["free", "held", "quarantined"] = "free"
    token: Count = 0
    mission_id: MissionId = MissionId("")
    invocation_id: InvocationId = InvocationId("")
    expires_s: float = 0.0
    reason: Explanation = ""


def apply(lease: Lease, event: lease_events.LeaseEvent) -> Lease:
    """The lease after one more event."""
    nxt = replace(lease, version=lease.version + 1)
    match event:
        case lease_events.LeaseAcquired():
            return replace(
                nxt,
                resource=event.resource,
                status="held",
                token=event.token,
                mission_id=event.mission_id,
                invocation_id=event.invocation_id,
                expires_s=event.expires_s,
                reason="",
            )
        case lease_events.LeaseReleased():
            return replace(nxt, status="free", reason=event.reason)
        case lease_events.LeaseQuarantined():
            return replace(nxt, status="quarantined", reason=event.reason)
        case lease_events.LeaseFreed():
            return replace(nxt, status="free", reason=event.reason)
        case _:
            assert_never(event)
