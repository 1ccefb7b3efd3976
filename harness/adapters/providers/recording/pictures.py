"""Converts recorded images and clouds to blobs: encoded pictures, and float32 xyz triples."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from harness.contracts.errors import ProviderFailed
from harness.contracts.reasons import Reason, because

SizeOf = Callable[[bytes], tuple[int, int]]
"""Width and height of an encoded image, in pixels."""

_JPEG_QUALITY = 90
_RAW = {
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgr8": (3, None),
    "8UC3": (3, None),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "mono8": (1, None),
    "8UC1": (1, None),
}
_SCALARS = {7: "f4", 8: "f8"}


class EncodedPicture(NamedTuple):
    """An encoded picture and its size in pixels."""

    body: bytes
    media_type: Literal["image/jpeg", "image/png"]
    width_px: int
    height_px: int


def raw_picture(message: Any) -> EncodedPicture | Reason:
    """A sensor_msgs Image as JPEG, or why it cannot be shown."""
    if message.encoding not in _RAW:
        return because("image_encoding_unknown", encoding=str(message.encoding))
    channels, conversion = _RAW[message.encoding]
    height, width, step = int(message.height), int(message.width), int(message.step)
    pixels = np.frombuffer(message.data, dtype=np.uint8)
    if width == 0 or height == 0 or step < width * channels or len(pixels) < step * height:
        return because("images_too_short")
    rows = pixels[: step * height].reshape(height, step)[:, : width * channels].reshape(height, width, channels)
    picture = rows if conversion is None else cv2.cvtColor(rows, conversion)
    done, body = cv2.imencode(".jpg", np.ascontiguousarray(picture), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return EncodedPicture(body.tobytes(), "image/jpeg", width, height) if done else because("images_not_encodable")


def compressed_picture(message: Any, *, size_of: SizeOf) -> EncodedPicture | Reason:
    """A sensor_msgs CompressedImage as it was recorded, checked to be whole, or why it cannot be shown.

    `size_of` decodes it, in a process with limits, and raises ProviderFailed.
    """
    body = bytes(message.data)
    if body.startswith(b"\xff\xd8"):
        media_type: Literal["image/jpeg", "image/png"] = "image/jpeg"
        whole = b"\xff\xd9" in body[-64:]
    elif body.startswith(b"\x89PNG"):
        media_type, whole = "image/png", b"IEND" in body[-16:]
    else:
        return because("image_compression_unknown", format=str(message.format))
    if not whole:
        return because("images_damaged")
    try:
        return EncodedPicture(body, media_type, *size_of(body))
    except ProviderFailed:
        return because("images_damaged")


def cloud_points(message: Any, *, most: int) -> NDArray[np.float64] | Reason:
    """Finite points of a PointCloud2, (n, 3) metres in its frame, thinned evenly to `most`; or why there are none."""
    fields = {field.name.lower(): field for field in message.fields}
    axes = [fields.get(name) for name in "xyz"]
    if any(axis is None or axis.datatype not in _SCALARS for axis in axes):
        return because("clouds_without_axes")
    width, height, step, row = (int(message.width), int(message.height), int(message.point_step), int(message.row_step))
    body = np.frombuffer(message.data, dtype=np.uint8)
    if row < width * step or len(body) < row * height or step == 0:
        return because("clouds_too_short")
    order = ">" if message.is_bigendian else "<"
    kind = np.dtype(
        {
            "names": ["x", "y", "z"],
            "formats": [order + _SCALARS[axis.datatype] for axis in axes if axis],
            "offsets": [axis.offset for axis in axes if axis],
            "itemsize": step,
        }
    )
    rows = body[: row * height].reshape(height, row)[:, : width * step]
    points = np.frombuffer(rows.tobytes(), dtype=kind)
    xyz = np.stack([points[name].astype(np.float64) for name in "xyz"], axis=1)
    xyz = xyz[np.isfinite(xyz).all(axis=1)]
    return xyz[:: max(1, -(-len(xyz) // most))]
