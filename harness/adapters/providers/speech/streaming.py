"""Recognises speech while it is spoken: chunks of a microphone go in, and the words so far come out (R181)."""

import json
import subprocess
import sys
import threading

import numpy as np

from harness.adapters.providers.speech.recogniser import CHILD, read_answer
from harness.adapters.providers.speech.waves import over_noise
from harness.contracts.errors import ProviderFailed
from harness.contracts.reasons import because, recorded

LARGEST_CHUNK = 2**18
ANSWER_S = 10.0


class SphinxStream:
    """SpeechStream by PocketSphinx in a process of its own, among the sentences of a language model.

    16-bit little-endian mono samples of 16 kHz. Every method raises ProviderFailed where the recogniser fails, or does
    not answer within ANSWER_S.
    """

    def __init__(self, *, model: str, dictionary: str, names: dict[str, str]) -> None:
        self._names, self._noise = names, np.random.default_rng(0)
        self._child = subprocess.Popen(
            [sys.executable, "-P", str(CHILD)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        job = {"model": model, "dictionary": dictionary, "streaming": True}
        self._write(json.dumps(job).encode() + b"\n")

    def feed(self, samples: bytes) -> str:
        """The words so far, with those of this chunk; an empty or odd chunk is refused."""
        if not samples or len(samples) % 2 or len(samples) > LARGEST_CHUNK:
            raise ProviderFailed(because("speech_chunk_unusable", bytes=len(samples), limit=LARGEST_CHUNK))
        body = over_noise(np.frombuffer(samples, dtype="<i2"), self._noise)
        return self._answer(len(body).to_bytes(4, "little") + body)

    def finish(self) -> str:
        """The words of all of it; the stream is over."""
        try:
            return self._answer(bytes(4))
        finally:
            self.close()

    def close(self) -> None:
        """End the process, if it still runs."""
        self._child.kill()
        self._child.wait()
        for pipe in (self._child.stdin, self._child.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    continue

    def _answer(self, body: bytes) -> str:
        """The child's next line. A child that does not answer in time is ended, and its line is then empty."""
        self._write(body)
        late = threading.Timer(ANSWER_S, self._child.kill)
        late.start()
        try:
            assert self._child.stdout is not None
            found = read_answer(self._child.stdout.readline())
        finally:
            late.cancel()
        return " ".join(self._names.get(word, word.replace("_", " ")) for word in found.text.split())

    def _write(self, body: bytes) -> None:
        try:
            assert self._child.stdin is not None
            self._child.stdin.write(body)
            self._child.stdin.flush()
        except (OSError, ValueError) as error:
            raise ProviderFailed(because("speech_recogniser_failed", reason=recorded(str(error)))) from error
