"""Letters on signs: the share of a sign's colour that is left at points of its front, as a camera resolves it."""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from simulator.solids import Solid

PX_PER_M = 600.0
"""Of a sign's own picture, before it is made as small as the camera sees it."""
FOCAL_PX = 834.0
INK = 0.12
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


def lettering(solid: Solid, points_m: Floats, *, far_m: float) -> Singles:
    """1 on the plate and INK in the letters, for points (N, 3) of the map frame on the sign; `far_m` away, metres."""
    cos, sin = np.cos(solid.yaw_rad), np.sin(solid.yaw_rad)
    offset = points_m - np.asarray(solid.centre_m)
    ahead = cos * offset[:, 0] + sin * offset[:, 1]
    across = -sin * offset[:, 0] + cos * offset[:, 1]
    face = _face(solid.text, solid.half_m[1], solid.half_m[2], _step(far_m))
    height, width = face.shape
    columns = (across / (2 * solid.half_m[1]) + 0.5) * width - 0.5
    rows = (0.5 - offset[:, 2] / (2 * solid.half_m[2])) * height - 0.5
    found = cv2.remap(
        face,
        columns.astype(np.float32).reshape(-1, 1),
        rows.astype(np.float32).reshape(-1, 1),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )[:, 0]
    return np.where(ahead > 0, found, 1.0).astype(np.float32)


def _step(far_m: float) -> float:
    """Pixels per metre at which the sign is drawn: about those of the camera, in steps, so that few are drawn."""
    px_per_m = min(PX_PER_M, FOCAL_PX / max(far_m, 0.1))
    return float(2.0 ** (np.ceil(2 * np.log2(px_per_m)) / 2))


@lru_cache(maxsize=32)
def _face(text: str, half_width_m: float, half_height_m: float, px_per_m: float) -> Singles:
    """The front of a sign: letters that fill it but for a margin."""
    width, height = round(2 * half_width_m * PX_PER_M), round(2 * half_height_m * PX_PER_M)
    face = np.full((height, width), 255, dtype=np.uint8)
    font, thickness = cv2.FONT_HERSHEY_SIMPLEX, max(2, height // 16)
    (wide, high), _ = cv2.getTextSize(text, font, 1.0, 1)
    scale = min(0.8 * width / wide, 0.55 * height / high)
    (wide, high), _ = cv2.getTextSize(text, font, scale, thickness)
    cv2.putText(
        face, text, ((width - wide) // 2, (height + high) // 2), font, scale, round(255 * INK), thickness, cv2.LINE_AA
    )
    size = (max(4, round(2 * half_width_m * px_per_m)), max(4, round(2 * half_height_m * px_per_m)))
    return np.asarray(cv2.resize(face, size, interpolation=cv2.INTER_AREA), dtype=np.float32) / np.float32(255)
