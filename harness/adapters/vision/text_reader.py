"""Reads the text in a picture with the PP-OCR models that the `rapidocr` package holds, in a limited child."""

import math
import struct
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from harness.adapters.limited_process import LimitedProcess, Limits
from harness.contracts.errors import ConfigurationMissing, ProviderFailed
from harness.contracts.ids import sha256
from harness.contracts.pictures import Box, ReadText, VisionModel
from harness.contracts.reasons import because
from harness.contracts.values import decode, encode

EXTRA = "vision"
MODELS = {
    "Det": "PP-OCRv6_det_small.onnx",
    "Rec": "PP-OCRv6_rec_small.onnx",
    "Cls": "ch_ppocr_mobile_v2.0_cls_mobile.onnx",
}
LEAST_SCORE = 0.5
"""The package's own threshold of what it returns."""
LONGEST_SIDE_PX = 2000
TILE_PX, OVERLAP_PX, TILE_SCALE = 480, 120, 2
SAME_LINE = 0.5
MOST_TEXTS = 200
LONGEST_TEXT = 200
LIMITS = Limits(memory_bytes=3 * 2**30, cpu_s=120.0, wall_s=300.0, output_bytes=2**20)
_SHAPE = struct.Struct(">II")
Pixels = NDArray[np.uint8]


class TextReader:
    """Reads lines of text. The child starts with the first picture; one picture at a time.

    Raises ConfigurationMissing where the extra that brings the package is not installed.
    """

    def __init__(self) -> None:
        self.model = _model(_folder())
        self._child = LimitedProcess(texts_in, LIMITS, failure=ProviderFailed)

    def read(self, pixels: Pixels) -> tuple[ReadText, ...]:
        """The lines in an RGB picture (H, W, 3), surest first. Raises ProviderFailed."""
        height, width = pixels.shape[:2]
        scale = min(1.0, LONGEST_SIDE_PX / max(height, width))
        small = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else pixels
        request = _SHAPE.pack(*small.shape[:2]) + np.ascontiguousarray(small).tobytes()
        lines = decode(self._child.run(request), tuple[ReadText, ...])
        return tuple(_scaled(one, 1 / scale) for one in lines)

    def close(self) -> None:
        """End the child. A later picture starts another one."""
        self._child.close()


def texts_in(request: bytes) -> bytes:
    """The child's work: pixels behind height and width, answered with the lines of text as JSON.

    The whole picture is read for large letters, and tiles of it at twice their size for small ones: alone in a wide
    scene they are below what the models find.
    """
    height, width = _SHAPE.unpack_from(request)
    pixels = np.frombuffer(request, dtype=np.uint8, offset=_SHAPE.size).reshape(height, width, 3)
    picture = np.ascontiguousarray(pixels[:, :, ::-1])
    found = _lines(picture, left=0, top=0, scale=1)
    for top in _starts(height):
        for left in _starts(width):
            tile = picture[top : top + TILE_PX, left : left + TILE_PX]
            larger = cv2.resize(tile, None, fx=TILE_SCALE, fy=TILE_SCALE, interpolation=cv2.INTER_CUBIC)
            found += _lines(np.asarray(larger, dtype=np.uint8), left=left, top=top, scale=TILE_SCALE)
    return encode(tuple(distinct(found))[:MOST_TEXTS])


def distinct(lines: Sequence[ReadText]) -> list[ReadText]:
    """Each line once, surest first: of readings that cover one another the one with more letters, then the surer."""
    lines_once: list[ReadText] = []
    for one in sorted(lines, key=lambda line: (-len(line.text), -line.score, line.box_px)):
        if all(_covered(one.box_px, by=other.box_px) < SAME_LINE for other in lines_once):
            lines_once.append(one)
    return sorted(lines_once, key=lambda line: (-line.score, line.box_px))


def _covered(box: Box, *, by: Box) -> float:
    """The share of the smaller box that lies in the other one."""
    wide = min(box[0] + box[2], by[0] + by[2]) - max(box[0], by[0])
    high = min(box[1] + box[3], by[1] + by[3]) - max(box[1], by[1])
    smaller = max(1, min(box[2] * box[3], by[2] * by[3]))
    return max(0, wide) * max(0, high) / smaller


def _starts(length: int) -> list[int]:
    """Where tiles begin along a side, so that a line as long as the overlap is whole in one of them."""
    count = max(1, math.ceil((length - OVERLAP_PX) / (TILE_PX - OVERLAP_PX)))
    last = max(0, length - TILE_PX)
    return sorted({round(last * index / max(1, count - 1)) for index in range(count)})


def _lines(picture: Pixels, *, left: int, top: int, scale: int) -> list[ReadText]:
    """The lines of a part of the picture that begins at `left` and `top` and is shown `scale` times as large."""
    answer = _engine()(picture)
    if answer.txts is None:
        return []
    found = []
    for text, score, corners in zip(answer.txts, answer.scores, answer.boxes, strict=True):
        x, y, width, height = (round(side / scale) for side in _box(corners))
        if text.strip() and score >= LEAST_SCORE:
            surely = min(1.0, round(float(score), 3))
            box = (left + x, top + y, width, height)
            found.append(ReadText(text=text.strip()[:LONGEST_TEXT], score=surely, box_px=box))
    return found


@lru_cache(maxsize=1)
def _engine() -> Any:
    """The package's engine on the models it came with; each by its path, so that it looks for none elsewhere."""
    from rapidocr import RapidOCR  # noqa: PLC0415  only the child needs it

    places = {f"{task}.model_path": str(_folder() / file) for task, file in MODELS.items()}
    return RapidOCR(params={**places, "Global.log_level": "critical", "Global.use_cls": False})


def _folder() -> Path:
    """Where the package holds its models. Raises ConfigurationMissing."""
    spec = find_spec("rapidocr")
    folder = Path(spec.origin).parent / "models" if spec and spec.origin else None
    if folder is None or find_spec("onnxruntime") is None:
        raise ConfigurationMissing(because("text_reader_absent", extra=EXTRA))
    absent = [file for file in MODELS.values() if not (folder / file).is_file()]
    if absent:
        raise ConfigurationMissing(because("text_reader_incomplete", files=tuple(absent)), where=str(folder))
    return folder


@lru_cache(maxsize=4)
def _model(folder: Path) -> VisionModel:
    try:
        installed = version("rapidocr")
    except PackageNotFoundError:
        installed = "unknown"
    digest = sha256(b"".join((folder / file).read_bytes() for file in MODELS.values()))
    return VisionModel(task="text", name="PP-OCRv6 small (rapidocr)", version=installed, digest=digest)


def _box(corners: Any) -> Box:
    points = np.asarray(corners, dtype=np.float64)
    (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
    return round(float(left)), round(float(top)), round(float(right - left)), round(float(bottom - top))


def _scaled(line: ReadText, by: float) -> ReadText:
    if by == 1.0:
        return line
    x, y, width, height = (round(side * by) for side in line.box_px)
    return ReadText(text=line.text, score=line.score, box_px=(x, y, width, height))
