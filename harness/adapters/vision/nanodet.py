"""Prepares a picture for NanoDet-g and turns its raw answer into objects with scores and boxes. Pure.

Size, mean, threshold and overlap are those of the network's own configuration and demonstration program: 416 px, aspect
ratio kept, score at least 0.35, overlap at most 0.6.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from harness.contracts.pictures import DetectedObject

SIDE_PX = 416
LEAST_SCORE = 0.35
MOST_OVERLAP = 0.6
MOST_OBJECTS = 100
STRIDES_PX = (8, 16, 32)
BINS = 11
LABELS: tuple[str, ...] = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow", "elephant",
    "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee", "skis", "snowboard",
    "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard", "tennis racket", "bottle",
    "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich", "orange", "broccoli",
    "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch", "potted plant", "bed", "dining table", "toilet",
    "tv", "laptop", "mouse", "remote", "keyboard", "cell phone", "microwave", "oven", "toaster", "sink",
    "refrigerator", "book", "clock", "vase", "scissors", "teddy bear", "hair drier", "toothbrush",
)  # fmt: skip
"""The classes of COCO in the network's order."""
CELLS = tuple((SIDE_PX // stride) ** 2 for stride in STRIDES_PX)
ANSWER_BYTES = sum(CELLS) * (len(LABELS) + 4 * BINS) * 4
Pixels = NDArray[np.uint8]
Singles = NDArray[np.float32]


def prepared(pixels: Pixels) -> Pixels:
    """An RGB picture (H, W, 3) as the network takes it: BGR, 416 x 416, the picture in the middle, black around it."""
    height, width = pixels.shape[:2]
    scale = SIDE_PX / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    whole = np.zeros((SIDE_PX, SIDE_PX, 3), dtype=np.uint8)
    top, left = (SIDE_PX - size[1]) // 2, (SIDE_PX - size[0]) // 2
    whole[top : top + size[1], left : left + size[0]] = small[:, :, ::-1]
    return whole


def objects_of(answer: bytes, *, width_px: int, height_px: int) -> tuple[DetectedObject, ...]:
    """The objects in a picture of that size, best first. `answer`: ANSWER_BYTES of 32-bit numbers of the network."""
    values = np.frombuffer(answer, dtype="<f4")
    scores, corners = [], []
    at = 0
    for stride, cells in zip(STRIDES_PX, CELLS, strict=True):
        scores.append(values[at : at + cells * len(LABELS)].reshape(cells, len(LABELS)))
        at += scores[-1].size
        spread = values[at : at + cells * 4 * BINS].reshape(cells, 4, BINS)
        at += spread.size
        corners.append(_corners(spread, stride))
    return _named(np.concatenate(scores), np.concatenate(corners), width_px=width_px, height_px=height_px)


def _corners(spread: Singles, stride: int) -> Singles:
    """Left, top, right and bottom (N, 4) in pixels of the prepared picture: the mean of each side's distribution."""
    weights = np.exp(spread - spread.max(axis=2, keepdims=True))
    sides = (weights / weights.sum(axis=2, keepdims=True)) @ np.arange(BINS, dtype=np.float32) * stride
    across = SIDE_PX // stride
    row, column = np.divmod(np.arange(across * across), across)
    x, y = (column + 0.5) * stride, (row + 0.5) * stride
    found: Singles = np.stack([x - sides[:, 0], y - sides[:, 1], x + sides[:, 2], y + sides[:, 3]], axis=1)
    return found


def _named(scores: Singles, corners: Singles, *, width_px: int, height_px: int) -> tuple[DetectedObject, ...]:
    scale = max(width_px, height_px) / SIDE_PX
    margin = np.array([SIDE_PX - width_px / scale, SIDE_PX - height_px / scale] * 2, dtype=np.float32) / 2
    limits = np.array([width_px, height_px] * 2, dtype=np.float32)
    found: list[DetectedObject] = []
    for number, label in enumerate(LABELS):
        likely = np.flatnonzero(scores[:, number] >= LEAST_SCORE)
        if not len(likely):
            continue
        boxes = np.clip((corners[likely] - margin) * scale, 0, limits)
        boxes[:, 2:] -= boxes[:, :2]
        remaining = cv2.dnn.NMSBoxes(boxes.tolist(), scores[likely, number].tolist(), LEAST_SCORE, MOST_OVERLAP)
        for index in np.asarray(remaining, dtype=np.int64).ravel().tolist():
            x, y, width, height = (round(float(side)) for side in boxes[index])
            score = min(1.0, round(float(scores[likely[index], number]), 3))
            found.append(DetectedObject(label=label, score=score, box_px=(x, y, width, height)))
    found.sort(key=lambda one: (-one.score, one.label, one.box_px))
    return tuple(found[:MOST_OBJECTS])
