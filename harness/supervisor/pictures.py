"""Has the images of an execution decoded, and finds the earlier captures that they may be copies of. Decides nothing.

What the bytes of every image were first recorded for stands in the log; memory's index of it survives a restart. A
claim that a verdict refused says nothing about how a scene looks: of such captures only the bytes and the noise count.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from threading import Lock

import msgspec
import numpy as np
from cachetools import LRUCache
from msgspec import UNSET
from msgspec.structs import replace
from numpy.typing import NDArray

from harness.contracts.errors import HarnessError
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, MissionId, PacketId
from harness.contracts.measurements import EXAMINATION, EarlierCapture, PictureExamination, PictureLook
from harness.contracts.memory import KnownCapture, MemoryQuery, MemoryRecord
from harness.contracts.reasons import parts
from harness.contracts.rules import CAPTURES
from harness.contracts.values import decode, encode
from harness.projections.mission import Mission
from harness.supervisor.roles import RoleContexts
from harness.verification.images import COPY, MISCLAIMED, another_capture, content_of, copied, one_noise

MOST_CAPTURES = 2000
"""So many of the newest captures are compared by content; the bytes themselves are compared with all."""
MOST_CLAIMS = 10_000
MOST_COPIES = 3
"""Of one image so many earlier ones are named."""
KIND = "capture"
_read: LRUCache[Digest, dict[Digest, PictureLook]] = LRUCache(maxsize=500)
_reading = Lock()
"""The looks of earlier executions by the digest of their examination: they never change."""


class PictureExaminer:
    """One robot's images."""

    def __init__(self, roles: RoleContexts) -> None:
        self._runtime, self._pictures = roles.runtime, roles.connection.pictures
        self._observations = roles.observations

    def examined(self, mission: Mission, images: Sequence[EvidenceReference]) -> tuple[EvidenceReference, ...]:
        """The same references, each with the examination that is stored of all of them. Rules before 4 know none."""
        if not images or mission.rules < CAPTURES:
            return tuple(images)
        looks = {blob: self._look(blob) for blob in dict.fromkeys(one.blob for one in images)}
        earlier = [] if mission.replay else list(self._earlier(images, looks))
        status = self._observations.status
        found = PictureExamination(
            looks=tuple(looks.values()),
            earlier=tuple(earlier),
            camera=status.camera if status is not None and status.camera is not None else UNSET,
        )
        name = self._runtime.keep(encode(found))
        return tuple(replace(one, values=one.values | {EXAMINATION: name}) for one in images)

    def _look(self, image: Digest) -> PictureLook:
        try:
            return self._pictures.look(image, self._runtime.blob(image))
        except HarnessError as error:
            return PictureLook(image=image, problem=error.reason)

    def _earlier(
        self, images: Sequence[EvidenceReference], looks: dict[Digest, PictureLook]
    ) -> Iterator[EarlierCapture]:
        """Of each image: what its bytes were first recorded for, and the captures whose copy it may be."""
        known = self._runtime.memory.find(MemoryQuery(kinds=(KIND,), limit=MOST_CAPTURES))
        captures = [one.record for one in known]
        for image in images:
            same = self._runtime.memory.find(MemoryQuery(kinds=(KIND,), subject=image.blob, limit=MOST_CLAIMS))
            first = capture_of(same[-1].record, image.blob, None) if same else None
            if first is not None and another_capture(image, first):
                yield first
        contents, others = self._contents(captures)
        misclaimed = cache(self._misclaimed)
        for image in images:
            look = looks[image.blob]
            if look.grey and others:
                yield from self._copies(image, look, contents, others, misclaimed)

    def _contents(
        self, captures: Sequence[MemoryRecord]
    ) -> tuple[NDArray[np.float32], list[tuple[MemoryRecord, PictureLook]]]:
        """The contents of earlier captures as rows, and whose they are."""
        others: list[tuple[MemoryRecord, PictureLook]] = []
        for record in captures:
            knowledge = record.knowledge
            if isinstance(knowledge, KnownCapture) and knowledge.examination is not None:
                look = self._stored(knowledge.examination).get(Digest(record.subject))
                others += [(record, look)] if look is not None and look.grey else []
        rows = [content_of(look).small.reshape(-1) for _, look in others]
        return (np.stack(rows) if rows else np.empty((0, 0), dtype=np.float32)), others

    def _copies(
        self,
        image: EvidenceReference,
        look: PictureLook,
        contents: NDArray[np.float32],
        others: Sequence[tuple[MemoryRecord, PictureLook]],
        misclaimed: Callable[[MissionId, PacketId | None], bool],
    ) -> Iterator[EarlierCapture]:
        small = content_of(look).small
        alike = np.maximum(contents @ small.reshape(-1), contents @ small[:, ::-1].reshape(-1))
        found = 0
        for index in np.flatnonzero(alike >= COPY).tolist():
            record, other = others[index]
            earlier = capture_of(record, image.blob, other)
            if earlier is None or other.image == image.blob or not copied(image, look, earlier, other):
                continue
            if not one_noise(look, other) and misclaimed(record.provenance.mission_id, record.provenance.packet_id):
                continue
            yield earlier
            found += 1
            if found == MOST_COPIES:
                return

    def _misclaimed(self, mission_id: MissionId, packet_id: PacketId | None) -> bool:
        """Whether a verdict on the packet says that its pictures are not what they were claimed to be."""
        mission = self._runtime.mission(mission_id)
        nodes = (*mission.nodes.values(), *(one.state for one in mission.history))
        verdicts = [one for node in nodes for one in node.verdicts if one.packet_id == packet_id]
        reasons = [reason for one in verdicts for reason in (one.reason, *(part.reason for part in one.results))]
        return any(part.code in MISCLAIMED for reason in reasons for part in parts(reason))

    def _stored(self, examination: Digest) -> dict[Digest, PictureLook]:
        """The looks of an earlier execution; none where their bytes are gone."""
        with _reading:
            if examination not in _read:
                try:
                    found = decode(self._runtime.blob(examination), PictureExamination)
                except (HarnessError, msgspec.MsgspecError):
                    return {}
                _read[examination] = {one.image: one for one in found.looks}
            return _read[examination]


def capture_of(record: MemoryRecord, image: Digest, look: PictureLook | None) -> EarlierCapture | None:
    """What a record says that its image was recorded for; None of a record about something else."""
    knowledge = record.knowledge
    if not isinstance(knowledge, KnownCapture):
        return None
    return EarlierCapture(
        image=image, request_id=knowledge.request_id, at_s=record.valid_from_s, yaw_rad=knowledge.yaw_rad, look=look
    )
