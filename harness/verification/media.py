"""Reads the size of an image or a sound from its header. Pure: decodes no pixel and no sample."""

import struct

from harness.contracts.reasons import because
from harness.verification.finding import Undecidable

_PNG = b"\x89PNG\r\n\x1a\n"
_FRAMES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
_ALONE = frozenset({0x01, *range(0xD0, 0xDA)})


def image_size(body: bytes) -> tuple[int, int]:
    """Width and height in pixels of a JPEG or PNG that is complete to its end mark. Raises Undecidable otherwise."""
    if body.startswith(_PNG):
        return _png_size(body)
    if body.startswith(b"\xff\xd8\xff"):
        return _jpeg_size(body)
    raise Undecidable(because("neither_jpeg_nor_png"))


def wav_samples(body: bytes) -> tuple[int, int]:
    """Number of sample frames and rate in Hz of a PCM WAV. Raises Undecidable if it is none or is cut short."""
    if len(body) < 12 or body[:4] != b"RIFF" or body[8:12] != b"WAVE":
        raise Undecidable(because("no_wav"))
    at, rate_hz, frame_bytes = 12, 0, 0
    while at + 8 <= len(body):
        name, size = body[at : at + 4], struct.unpack_from("<I", body, at + 4)[0]
        if at + 8 + size > len(body):
            break
        if name == b"fmt " and size >= 16:
            rate_hz, _, frame_bytes = struct.unpack_from("<IIH", body, at + 12)
        elif name == b"data" and rate_hz and frame_bytes:
            return size // frame_bytes, rate_hz
        at += 8 + size + size % 2
    raise Undecidable(because("wav_without_sound"))


def _png_size(body: bytes) -> tuple[int, int]:
    if len(body) < 33 or body[12:16] != b"IHDR" or b"IEND" not in body[-12:]:
        raise Undecidable(because("png_cut_short"))
    width, height = struct.unpack_from(">II", body, 16)
    return int(width), int(height)


def _jpeg_size(body: bytes) -> tuple[int, int]:
    if b"\xff\xd9" not in body[-64:]:
        raise Undecidable(because("jpeg_cut_short"))
    at = 2
    while at + 9 <= len(body) and body[at] == 0xFF:
        marker = body[at + 1]
        if marker in _FRAMES:
            height, width = struct.unpack_from(">HH", body, at + 5)
            return int(width), int(height)
        at += 2 if marker in _ALONE else 2 + struct.unpack_from(">H", body, at + 2)[0]
    raise Undecidable(because("jpeg_without_header"))
