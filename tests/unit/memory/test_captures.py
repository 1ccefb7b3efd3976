"""What the bytes of an image were first recorded for: from the log, and again after the index was lost."""

from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import RequestId
from harness.contracts.memory import KnownCapture, MemoryQuery
from harness.memory.fabric import MemoryFabric
from tests.unit.memory.building import FRAME, Log


def image(at_s: float, *, request: str, yaw_rad: float = 0.5) -> EvidenceReference:
    return EvidenceReference(
        kind="image", origin="sensor", source="camera", from_s=at_s, until_s=at_s, confidence=1.0, blob=FRAME,
        values={"request_id": request, "yaw_rad": yaw_rad},
    )  # fmt: skip


def test_the_first_claim_of_an_images_bytes_is_known_after_later_ones_and_a_lost_index() -> None:
    log = Log()
    for name, request, at_s in (("msn_a", "r-1", 50.0), ("msn_b", "r-2", 60.0)):
        mission_id = log.begin(name)
        log.dispatched(mission_id)
        log.judged(mission_id, images=(image(at_s, request=request),))
    asked = MemoryQuery(kinds=("capture",), subject=FRAME)
    for memory in (log.memory, MemoryFabric(store=log.store, index=VolatileMemoryIndex())):
        claims = [(one.record.valid_from_s, one.record.knowledge) for one in memory.find(asked)]
        assert claims == [
            (60.0, KnownCapture(request_id=RequestId("r-2"), yaw_rad=0.5)),
            (50.0, KnownCapture(request_id=RequestId("r-1"), yaw_rad=0.5)),
        ]
