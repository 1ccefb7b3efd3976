"""Decodes the images of robots in a process of its own, with limits on memory and time; this process never does."""

import os
import struct
from dataclasses import dataclass, field

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from harness.adapters.limited_process import LimitedProcess, Limits
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest
from harness.contracts.measurements import LOOK_PX, PictureLook
from harness.contracts.reasons import because
from harness.contracts.values import decode, encode

LIMITS = Limits(memory_bytes=512 * 2**20, cpu_s=10.0, wall_s=20.0, output_bytes=160 * 2**20)
MOST_PIXELS = 40_000_000
"""No image of a robot is larger; a claim beyond it is not decoded."""
BLOCK_PX = 8
"""Of a JPEG: what is left of the noise in such a block is left of it in a copy that was encoded anew."""
BLOCKS = (40, 22)
WAVES = ((0, 2), (1, 1), (2, 0), (1, 2), (2, 1), (0, 3), (3, 0))
"""Cosine waves down and across of a block that noise still shows in: longer ones are the scene's shading, shorter ones
are what encoding takes away first."""
STEPS = 8.0
"""Steps per level of brightness in which a wave's amplitude is noted."""
LOOK, COLOUR, SIZE = b"L", b"C", b"S"
_SHAPE = struct.Struct(">II")
Pixels = NDArray[np.uint8]


@dataclass
class LimitedPictures:
    """PictureReader whose child starts with the first image and is replaced when it exceeded a limit."""

    _children: dict[int, LimitedProcess] = field(default_factory=dict)

    def look(self, image: Digest, body: bytes) -> PictureLook:
        """What is compared of an image. Raises ProviderFailed if it cannot be decoded to its last pixel."""
        return decode(self._child().run(LOOK + image.encode() + b"\n" + body, where=image[:12]), PictureLook)

    def pixels(self, body: bytes) -> Pixels:
        """The image in colour, uint8 RGB of shape (height, width, 3). Raises ProviderFailed."""
        answer = self._child().run(COLOUR + body)
        height, width = _SHAPE.unpack_from(answer)
        return np.frombuffer(answer, dtype=np.uint8, offset=_SHAPE.size).reshape(height, width, 3)

    def size(self, body: bytes) -> tuple[int, int]:
        """Width and height of an image that has pixels, in pixels. Raises ProviderFailed."""
        height, width = _SHAPE.unpack(self._child().run(SIZE + body))
        return width, height

    def _child(self) -> LimitedProcess:
        """A process that was forked off has a child of its own: two may not write into one pipe."""
        mine = os.getpid()
        if mine not in self._children:
            self._children[mine] = LimitedProcess(decoded, LIMITS, failure=ProviderFailed)
        return self._children[mine]


PICTURES = LimitedPictures()
"""The one of this process."""


def decoded(request: bytes) -> bytes:
    """The child's work: an image as a PictureLook, as rows of RGB behind height and width, or as these alone."""
    if request[:1] == LOOK:
        image, _, body = request[1:].partition(b"\n")
        return encode(looked_at(Digest(image.decode()), body))
    if request[:1] == SIZE:
        width, height = size_of(request[1:])
        return _SHAPE.pack(height, width)
    _grey(Digest(""), request[1:])
    colour = cv2.imdecode(np.frombuffer(request, dtype=np.uint8)[1:], cv2.IMREAD_COLOR_RGB)
    if colour is None:
        raise ProviderFailed(because("blob_no_picture"))
    return _SHAPE.pack(*colour.shape[:2]) + np.ascontiguousarray(colour).tobytes()


def size_of(body: bytes) -> tuple[int, int]:
    """Width and height of an image, decoded in this very process. Raises ProviderFailed for one without pixels."""
    try:
        found = cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_COLOR) if body else None
    except cv2.error as error:
        raise ProviderFailed(because("image_not_whole", image="", error=str(error)[:120])) from error
    if found is None:
        raise ProviderFailed(because("blob_no_picture"))
    return found.shape[1], found.shape[0]


def looked_at(image: Digest, body: bytes) -> PictureLook:
    """What is compared of an image. Raises ProviderFailed if it cannot be decoded to its last pixel."""
    grey = _grey(image, body)
    height, width = grey.shape
    if width < LOOK_PX[0] or height < LOOK_PX[1]:
        raise ProviderFailed(because("image_too_large", width_px=width, height_px=height))
    small = cv2.resize(grey, LOOK_PX, interpolation=cv2.INTER_AREA)
    noise = _noise(grey)
    return PictureLook(
        image=image,
        width_px=width,
        height_px=height,
        grey=small.tobytes(),
        noise=noise.tobytes(),
        blocks=(noise.shape[0], noise.shape[1]),
    )


def _grey(image: Digest, body: bytes) -> Pixels:
    try:
        if body.startswith(b"\xff\xd8"):
            height, width, _, _ = simplejpeg.decode_jpeg_header(body, strict=True)
            if width * height > MOST_PIXELS:
                raise ProviderFailed(because("image_too_large", width_px=width, height_px=height))
            grey: Pixels = simplejpeg.decode_jpeg(body, colorspace="GRAY", strict=True)[:, :, 0]
            return grey
        found = cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_GRAYSCALE) if body else None
    except (ValueError, cv2.error) as error:
        raise ProviderFailed(because("image_not_whole", image=image[:12], error=str(error)[:120])) from error
    if found is None:
        raise ProviderFailed(because("image_not_whole", image=image[:12], error="no pixels"))
    return np.asarray(found, dtype=np.uint8)


def _noise(grey: Pixels) -> NDArray[np.int8]:
    """Amplitudes of WAVES in BLOCKS of the image, int8 of shape (down, across, waves).

    The blocks are the same from either side, so that a mirror image has them in the other order.
    """
    rows, columns = _places(grey.shape[0] // BLOCK_PX, BLOCKS[1]), _places(grey.shape[1] // BLOCK_PX, BLOCKS[0])
    whole = grey[: grey.shape[0] // BLOCK_PX * BLOCK_PX, : grey.shape[1] // BLOCK_PX * BLOCK_PX]
    blocks = whole.reshape(-1, BLOCK_PX, whole.shape[1] // BLOCK_PX, BLOCK_PX).swapaxes(1, 2)
    chosen = blocks[np.ix_(rows, columns)].astype(np.float32)
    waves = _waves()
    found = np.einsum("rcij,wij->rcw", chosen, waves, optimize=True)
    noted: NDArray[np.int8] = np.clip(np.rint(found * STEPS), -127, 127).astype(np.int8)
    return noted


def _places(count: int, most: int) -> NDArray[np.int64]:
    """At most `most` of so many blocks, evenly spaced and symmetric."""
    half = np.unique(np.linspace(0, max(count // 2 - 1, 0), min(most // 2, max(count // 2, 1))).astype(int))
    return np.concatenate([half, (count - 1 - half)[::-1]]) if count > 1 else half


def _waves() -> NDArray[np.float32]:
    """The cosine waves as patterns of a block, orthonormal."""
    at = (2 * np.arange(BLOCK_PX) + 1) * np.pi / (2 * BLOCK_PX)

    def wave(number: int) -> NDArray[np.float64]:
        scale = np.sqrt((1 if number == 0 else 2) / BLOCK_PX)
        found: NDArray[np.float64] = scale * np.cos(number * at)
        return found

    return np.array([np.outer(wave(down), wave(across)) for down, across in WAVES], dtype=np.float32)
