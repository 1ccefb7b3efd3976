"""Builders for the providers beside the harness: a clock that stands still until moved, blobs in memory, requests."""

from collections.abc import Iterator
from typing import Any

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import BlobDamaged
from harness.contracts.ids import Digest, MissionId, NodeId, RequestId, request_id, sha256
from harness.contracts.protocol import InvocationIdentity, StartRequest
from harness.contracts.values import Moment

EPOCH_S = 1_790_000_000.0


class StillClock:
    """Both clocks at one instant; waiting is arriving."""

    def __init__(self, now_s: float = EPOCH_S) -> None:
        self.now_s = now_s

    def now(self) -> Moment:
        return Moment(mission_s=self.now_s, wall_s=self.now_s)

    def wait_until(self, mission_s: float) -> None:
        self.now_s = max(self.now_s, mission_s)


class Blobs:
    """A working blob store in memory."""

    def __init__(self) -> None:
        self.bodies: dict[Digest, bytes] = {}

    def put(self, body: bytes) -> Digest:
        self.bodies[sha256(body)] = body
        return sha256(body)

    def get(self, digest: Digest) -> bytes:
        if digest not in self.bodies:
            raise BlobDamaged("The blob is missing", where=digest)
        return self.bodies[digest]

    def has(self, digest: Digest) -> bool:
        return digest in self.bodies

    def digests(self) -> Iterator[Digest]:
        return iter(self.bodies)

    def erase(self, digest: Digest) -> None:
        self.bodies.pop(digest, None)


def request_to(
    card: CapabilityCard, *, parameters: dict[str, Any], attempt: int = 0, token: int = 1, deadline_s: float = 60.0
) -> StartRequest:
    """A request that fits `card`; `deadline_s` counts from the epoch of the still clock."""
    mission, node = MissionId("msn_senses"), NodeId(card.capability)
    identity = InvocationIdentity(
        mission_id=mission,
        node_id=node,
        attempt=attempt,
        request_id=RequestId(request_id(mission, node, attempt)),
        provider_id=card.provider_id,
    )
    return StartRequest(
        identity=identity,
        capability=card.capability,
        parameters=parameters,
        k_ctx=4,
        configuration=Digest("c" * 64),
        deadline_s=EPOCH_S + deadline_s,
        fencing=dict.fromkeys(card.resources, token),
    )
