"""Lease requests that go with an invocation: taken with the intent, given back only with the body at rest (D14)."""

from harness.contracts.actors import Actor
from harness.contracts.commands import AcquireLease, FreeLease, QuarantineLease, ReleaseLease
from harness.contracts.events import DispatchIntended
from harness.contracts.ids import MissionId, ResourceId, lease_stream
from harness.gate.commit import Request
from harness.projections.mission import Mission
from harness.runtime import Runtime

GRACE_S = 10.0
"""A lease outlives the node's deadline by this much, so that the happy path needs no renewal."""
SUPERVISOR = Actor(name="supervisor", role="harness", channel="policy")


def tokens(runtime: Runtime, resources: tuple[ResourceId, ...]) -> dict[str, int]:
    """The fencing token each acquisition would get."""
    return {resource: runtime.lease(resource).token + 1 for resource in resources}


def acquire(mission_id: MissionId, intent: DispatchIntended) -> list[Request]:
    return [
        Request(
            lease_stream(ResourceId(resource)),
            AcquireLease(
                resource=ResourceId(resource),
                mission_id=mission_id,
                invocation_id=intent.invocation_id,
                token=token,
                expires_s=intent.deadline_s + GRACE_S,
            ),
        )
        for resource, token in intent.resources.items()
    ]


def give_back(runtime: Runtime, intent: DispatchIntended, *, at_rest: bool, reason: str) -> list[Request]:
    """Release what the invocation holds, or quarantine it while the body may still move."""
    requests = []
    for resource in intent.resources:
        lease = runtime.lease(ResourceId(resource))
        if lease.status != "held" or lease.invocation_id != intent.invocation_id:
            continue
        command = (
            ReleaseLease(invocation_id=intent.invocation_id, reason=reason)
            if at_rest or not intent.moves
            else QuarantineLease(invocation_id=intent.invocation_id, reason=reason)
        )
        requests.append(Request(lease_stream(ResourceId(resource)), command))
    return requests


def expired(runtime: Runtime, resources: tuple[ResourceId, ...], *, now_s: float) -> list[Request]:
    """Quarantine what a holder kept past its expiry: it may be moving."""
    return [
        Request(
            lease_stream(resource),
            QuarantineLease(
                invocation_id=lease.invocation_id, reason="the lease expired with its holder unaccounted for"
            ),
        )
        for resource in resources
        if (lease := runtime.lease(resource)).status == "held" and lease.expires_s < now_s
    ]


def free(runtime: Runtime, mission: Mission, *, static: dict[str, float]) -> list[Request]:
    """Free what this mission's acknowledged executions left in quarantine, on static-body evidence. Never re-arms.

    An execution is acknowledged once its provider reported an end, which is when its packet is retained.
    """
    acknowledged = {p.identity.invocation_id for node in mission.nodes.values() for p in node.packets}
    return [
        Request(
            stream,
            FreeLease(actor=SUPERVISOR, static=static, reason="the stop was acknowledged and the body is static"),
        )
        for stream in runtime.streams("lease/")
        if (lease := runtime.lease(ResourceId(stream.partition("/")[2]))).status == "quarantined"
        and lease.invocation_id in acknowledged
    ]
