"""Events of a lease, in the past tense."""

from harness.contracts.actors import Actor, Event
from harness.contracts.ids import InvocationId, MissionId, ResourceId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count


class LeaseAcquired(Event, tag=True):
    """`token` is the fencing token: it rises with every acquisition of the resource."""

    resource: ResourceId
    mission_id: MissionId
    invocation_id: InvocationId
    token: Count
    expires_s: float


class LeaseReleased(Event, tag=True):
    invocation_id: InvocationId
    reason: Explanation


class LeaseQuarantined(Event, tag=True):
    """The holder may be moving: the resource stays unavailable until it is freed (D14)."""

    invocation_id: InvocationId
    reason: Explanation


class LeaseFreed(Event, tag=True):
    """A quarantined lease was freed by an acknowledged stop or a named operator, both with static-body evidence."""

    actor: Actor
    static: dict[str, float]
    reason: Explanation


LeaseEvent = LeaseAcquired | LeaseReleased | LeaseQuarantined | LeaseFreed
