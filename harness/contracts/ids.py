"""Id types, and the few ids that are derived and never chosen.

The task's identity is its mission's id: one mission is one run of one task contract. Task > node > invocation.
"""

import hashlib
from typing import NewType

MissionId = NewType("MissionId", str)
NodeId = NewType("NodeId", str)
InvocationId = NewType("InvocationId", str)
RequestId = NewType("RequestId", str)
PacketId = NewType("PacketId", str)
ProviderId = NewType("ProviderId", str)
RobotId = NewType("RobotId", str)
ResourceId = NewType("ResourceId", str)
PlaceId = NewType("PlaceId", str)
HandoffId = NewType("HandoffId", str)
ConditionId = NewType("ConditionId", str)
StreamId = NewType("StreamId", str)
Digest = NewType("Digest", str)


def sha256(body: bytes) -> Digest:
    """Lower-case hexadecimal SHA-256 of `body`."""
    return Digest(hashlib.sha256(body).hexdigest())


def request_id(mission_id: MissionId, node_id: NodeId, attempt: int) -> RequestId:
    """The dispatch key (D1): a repeat of the same attempt is the same request. `k_ctx` is not part of it."""
    return RequestId(sha256(f"{mission_id}\n{node_id}\n{attempt}".encode()))


def invocation_id(request: RequestId) -> InvocationId:
    return InvocationId(f"inv_{request[:20]}")


def packet_id(invocation: InvocationId) -> PacketId:
    """Derived from the execution's id (R101), so one execution yields one packet."""
    return PacketId(f"pkt_{sha256(invocation.encode())[:20]}")


def mission_stream(mission_id: MissionId) -> StreamId:
    return StreamId(f"mission/{mission_id}")


def leased(robot_id: RobotId, resource: str) -> ResourceId:
    """A robot's resource as leases name it; cards and contracts say `mobile_base`, which every robot has."""
    return ResourceId(f"{robot_id}/{resource}")


def lease_stream(resource: ResourceId) -> StreamId:
    return StreamId(f"lease/{resource}")


def handoff_stream(handoff_id: HandoffId) -> StreamId:
    return StreamId(f"handoff/{handoff_id}")
