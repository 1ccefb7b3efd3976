"""Recognises one recording with PocketSphinx in a process of its own: a job on standard input, words on output.

A crash of the library is a failed recognition and no more, and nothing else waits for it. Run by path, imports none of
ours. Input: one line of JSON (model, dictionary), then 16-bit mono samples of 16 kHz. Without a model, the one of
general English in the wheel is used. Output: the words, in one line.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from pocketsphinx import Decoder

RATE_HZ = 16_000


def recognise(samples: bytes, *, model: str, dictionary: str) -> str:
    """The most likely words; empty where nothing was understood."""
    with TemporaryDirectory() as folder:
        words, sounds = Path(folder) / "model.lm", Path(folder) / "words.dict"
        words.write_text(model)
        sounds.write_text(dictionary)
        expected = {"lm": str(words), "dict": str(sounds)} if model else {}
        decoder = Decoder(samprate=RATE_HZ, loglevel="FATAL", **expected)
        decoder.start_utt()
        decoder.process_raw(samples, full_utt=True)
        decoder.end_utt()
        found = decoder.hyp()
        return found.hypstr if found else ""


if __name__ == "__main__":
    job = json.loads(sys.stdin.buffer.readline())
    print(recognise(sys.stdin.buffer.read(), model=job["model"], dictionary=job["dictionary"]))
