"""Runs one synthesis with the espeak-ng library in its own process: text on standard input, samples on output.

The library keeps state between texts, so that the same text sounds different the second time; a fresh process makes
the samples repeatable, and a crash of the library is a failed synthesis and no more. Run by path, imports none of ours.
Output: the rate in Hz as one ASCII line, then little-endian 16-bit mono samples. Exit 1 with the reason on stderr.
"""

import ctypes
import sys
from typing import Any

import espeakng_loader

_RETRIEVAL_SYNCHRONOUS = 2
_DO_NOT_EXIT = 0x8000
_UTF8 = 1
_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.c_void_p)


def speak(text: bytes, *, voice: str) -> tuple[int, bytes]:
    """The rate in Hz and the samples. Exits the process when the library fails."""
    library = ctypes.CDLL(espeakng_loader.get_library_path())
    folder = espeakng_loader.get_data_path().encode()
    rate_hz = int(library.espeak_Initialize(_RETRIEVAL_SYNCHRONOUS, 0, folder, _DO_NOT_EXIT))
    if rate_hz <= 0:
        sys.exit("the library found no voice files")
    parts: list[bytes] = []

    def take(samples: Any, count: int, _events: int | None) -> int:
        if samples and count > 0:
            parts.append(ctypes.string_at(samples, count * 2))
        return 0

    callback = _CALLBACK(take)
    library.espeak_SetSynthCallback(callback)
    library.espeak_ng_SetRandSeed(ctypes.c_long(1))
    if library.espeak_SetVoiceByName(voice.encode()) != 0:
        sys.exit(f"the voice {voice} does not exist")
    size = ctypes.c_size_t(len(text) + 1)
    if library.espeak_Synth(text, size, 0, 1, 0, ctypes.c_uint(_UTF8), None, None) != 0:
        sys.exit("the library refused the text")
    library.espeak_Synchronize()
    return rate_hz, b"".join(parts)


if __name__ == "__main__":
    rate, spoken = speak(sys.stdin.buffer.read(), voice=sys.argv[1])
    sys.stdout.buffer.write(b"%d\n" % rate + spoken)
