"""Shapes what analyses found in pictures as boxes over them, with scores and the provider that found it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import msgspec

from app.views.timeline import TimelineEntry
from harness.contracts.errors import BlobDamaged
from harness.contracts.events import PacketRetained
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import Digest
from harness.contracts.pictures import Box, DetectedObject, ReadText, VisionModel

Read = Callable[[Digest], bytes]
"""The bytes of a blob. Raises BlobDamaged."""
Sizes = dict[str, tuple[int, int]]
MOST_BOXES = 100
T = TypeVar("T")


@dataclass(frozen=True)
class MarkedBox:
    """One box in pixels of the picture. `score` is None where the analysis measures and gives none."""

    label: str
    score: float | None
    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class MarkedPicture:
    """One picture, what was found in it, and by whom: a provider, and its models with version and checksum."""

    blob: str
    width_px: int
    height_px: int
    source: str
    models: tuple[str, ...]
    boxes: tuple[MarkedBox, ...]


class _DescribedPicture(msgspec.Struct, frozen=True):
    image: Digest
    width_px: int
    height_px: int
    objects: tuple[DetectedObject, ...]
    texts: tuple[ReadText, ...]
    models: tuple[VisionModel, ...]


class _FoundOnFloor(msgspec.Struct, frozen=True):
    frame: Digest
    box_px: Box
    kind: str = ""


class _AnalysedPassage(msgspec.Struct, frozen=True):
    method: str
    findings: tuple[_FoundOnFloor, ...]
    model: str = ""
    names: tuple[str, ...] = ()


def marked_pictures(entries: Sequence[TimelineEntry], read: Read) -> dict[str, MarkedPicture]:
    """By picture, from the newest report about it. Reports without boxes, and bytes that are gone, give none."""
    found: dict[str, MarkedPicture] = {}
    sizes: Sizes = {}
    for entry in entries:
        if isinstance(entry.event, PacketRetained):
            sizes |= _sizes(entry.event.packet)
            for receipt in entry.event.packet.receipts:
                if receipt.kind == "analysis" and receipt.blob:
                    found |= {one.blob: one for one in _of_report(receipt.blob, receipt.source, read, sizes)}
    return found


def _sizes(packet: EvidencePacket) -> Sizes:
    """Width and height of each image, as the harness read them when it took them in."""
    found: Sizes = {}
    for one in (*packet.before, *packet.after):
        width, height = one.values.get("width_px"), one.values.get("height_px")
        if one.kind == "image" and isinstance(width, float | int) and isinstance(height, float | int):
            found[one.blob] = (round(width), round(height))
    return found


def _of_report(report: Digest, source: str, read: Read, sizes: Sizes) -> Iterator[MarkedPicture]:
    try:
        body = read(report)
    except BlobDamaged:
        return
    if (described := _decoded(body, _DescribedPicture)) is not None:
        boxes = [_box(one.label, one.score, one.box_px) for one in described.objects]
        boxes += [_box(f"“{one.text}”", one.score, one.box_px) for one in described.texts]
        models = tuple(f"{one.name}, {one.version}, sha256 {one.digest[:16]}" for one in described.models)
        yield MarkedPicture(
            described.image, described.width_px, described.height_px, source, models, tuple(boxes[:MOST_BOXES])
        )
    elif (analysed := _decoded(body, _AnalysedPassage)) is not None:
        yield from _of_passage(analysed, source, sizes)


def _of_passage(report: _AnalysedPassage, source: str, sizes: Sizes) -> Iterator[MarkedPicture]:
    names = report.names or tuple(one.kind for one in report.findings)
    for frame in dict.fromkeys(one.frame for one in report.findings):
        if frame not in sizes:
            continue
        width_px, height_px = sizes[frame]
        named = zip(report.findings, names, strict=False)
        boxes = tuple(_box(name, None, one.box_px) for one, name in named if one.frame == frame)
        yield MarkedPicture(frame, width_px, height_px, source, (report.model or report.method,), boxes[:MOST_BOXES])


def _box(label: str, score: float | None, box: Box) -> MarkedBox:
    return MarkedBox(label, score, *box)


def _decoded(body: bytes, shape: type[T]) -> T | None:
    try:
        return msgspec.json.decode(body, type=shape)
    except msgspec.MsgspecError:
        return None
