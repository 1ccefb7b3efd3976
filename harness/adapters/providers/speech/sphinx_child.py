"""Recognises one recording with PocketSphinx in a process of its own: a job on standard input, words on output.

A crash of the library is a failed recognition and no more, and nothing else waits for it. Run by path, imports none of
ours. Input: one line of JSON (model, dictionary), then 16-bit mono samples of 16 kHz. Without a model, the one of
general English in the wheel is used. Output: one line of JSON, the words and where each one stands, in seconds.

With `streaming`, the samples come in chunks, each behind its length as four little-endian bytes; after each chunk the
words so far are one line, and a chunk of no length ends the sound.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

from pocketsphinx import Decoder

RATE_HZ = 16_000


def decoder_of(folder: Path, *, model: str, dictionary: str) -> Decoder:
    """A decoder that expects these words; its files stand in the folder."""
    words, sounds = folder / "model.lm", folder / "words.dict"
    words.write_text(model)
    sounds.write_text(dictionary)
    expected = {"lm": str(words), "dict": str(sounds)} if model else {}
    return Decoder(samprate=RATE_HZ, loglevel="FATAL", **expected)


def result(decoder: Decoder) -> str:
    """The most likely words, none where nothing was understood, with [word, from, until] of each."""
    found = decoder.hyp()
    frame_s = 1.0 / decoder.config["frate"]
    parts = [(one.word, one.start_frame * frame_s, (one.end_frame + 1) * frame_s) for one in decoder.seg() or ()]
    return json.dumps({"text": found.hypstr if found else "", "words": parts})


def recognise(samples: bytes, decoder: Decoder) -> None:
    """One recording as a whole."""
    decoder.start_utt()
    decoder.process_raw(samples, full_utt=True)
    decoder.end_utt()
    print(result(decoder), flush=True)


def follow(source: BinaryIO, decoder: Decoder) -> None:
    """A sound as it comes."""
    decoder.start_utt()
    while length := int.from_bytes(source.read(4), "little"):
        decoder.process_raw(source.read(length), no_search=False, full_utt=False)
        print(result(decoder), flush=True)
    decoder.end_utt()
    print(result(decoder), flush=True)


if __name__ == "__main__":
    job = json.loads(sys.stdin.buffer.readline())
    with TemporaryDirectory() as place:
        made = decoder_of(Path(place), model=job["model"], dictionary=job["dictionary"])
        if job.get("streaming"):
            follow(sys.stdin.buffer, made)
        else:
            recognise(sys.stdin.buffer.read(), made)
