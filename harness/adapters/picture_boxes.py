"""Draws boxes with their labels over a picture, for people; the picture that is evidence stays as it is."""

from collections.abc import Sequence

import cv2
import numpy as np

from harness.adapters.pictures import PICTURES
from harness.contracts.pictures import Box

COLOUR_BGR = (0, 200, 255)
BEHIND_BGR = (20, 20, 20)


def with_boxes(body: bytes, marked: Sequence[tuple[Box, str]]) -> bytes:
    """A PNG of the picture `body` with a labelled box for each entry. Raises ProviderFailed for what is no picture."""
    picture = np.ascontiguousarray(PICTURES.pixels(body)[:, :, ::-1])
    scale = max(picture.shape[:2]) / 1000
    thickness = max(1, round(2 * scale))
    for (x, y, width, height), label in marked:
        cv2.rectangle(picture, (x, y), (x + width, y + height), COLOUR_BGR, thickness)
        drawable = label.encode("ascii", "replace").decode()
        (wide, high), base = cv2.getTextSize(drawable, cv2.FONT_HERSHEY_SIMPLEX, 0.6 * scale + 0.2, thickness)
        top = max(0, y - high - base)
        cv2.rectangle(picture, (x, top), (x + wide, top + high + base), BEHIND_BGR, -1)
        cv2.putText(
            picture, drawable, (x, top + high), cv2.FONT_HERSHEY_SIMPLEX, 0.6 * scale + 0.2, COLOUR_BGR, thickness
        )
    return bytes(cv2.imencode(".png", picture)[1])
