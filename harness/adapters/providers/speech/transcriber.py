"""Writes down what a person's recording says, twice: among the expected sentences, and freely (D48).

A Transcriber with the model in PocketSphinx's wheel, which knows American English. It decides nothing.
"""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from harness.adapters.providers.speech.language_model import bigrams, pronunciations, spoken
from harness.adapters.providers.speech.recogniser import NAME, decode, dictionary, listed
from harness.adapters.providers.speech.waves import RATE_HZ, read_wave
from harness.contracts.errors import RecordingUnusable
from harness.contracts.ids import sha256
from harness.contracts.reasons import Reason, because
from harness.contracts.spoken_goals import SpokenVocabulary, Transcription, name_token

SHORTEST_S, LONGEST_S = 0.2, 30.0
PAUSE_S = 0.4
BACKGROUND = 100.0
"""RMS of the noise that is laid under a recording, in steps of 16 bits: the recogniser's model was made from rooms, and
mistakes words beside silence that is perfect."""


class SphinxTranscriber:
    """Transcriber by PocketSphinx, each decoding in a process of its own with a time limit."""

    name = NAME

    def transcribe(self, recording: bytes, *, expected: SpokenVocabulary) -> Transcription:
        """Raises RecordingUnusable for what is no speech in a 16-bit mono WAV, ProviderFailed if decoding fails."""
        sound = read_wave(recording, shortest_s=SHORTEST_S, longest_s=LONGEST_S)
        if isinstance(sound, Reason):
            raise _unusable(sound)
        model, words, names = _model(expected)
        body = _in_a_room(sound.samples)
        text = _written(decode(body, model=model, dictionary=words), names)
        if not text:
            raise _unusable(because("sound_without_words"))
        return Transcription(
            recording=sha256(recording),
            recogniser=self.name,
            text=text,
            free=" ".join(decode(body).split()),
            duration_s=sound.duration_s,
        )


def _in_a_room(samples: npt.NDArray[np.int16]) -> bytes:
    """The samples between two pauses, over the same faint noise each time."""
    pause = np.zeros(round(PAUSE_S * RATE_HZ))
    whole = np.concatenate([pause, samples, pause])
    noise = np.random.default_rng(0).normal(0.0, BACKGROUND, len(whole))
    return np.clip(np.rint(whole + noise), -32768, 32767).astype("<i2").tobytes()


def _unusable(reason: Reason) -> RecordingUnusable:
    facts = {"low_s": SHORTEST_S, "high_s": LONGEST_S}
    return RecordingUnusable(because("recording_unusable", reason=reason, **facts), where="recording")


@lru_cache(maxsize=4)
def _model(expected: SpokenVocabulary) -> tuple[str, str, Mapping[str, str]]:
    """The language model, its dictionary, and what each name that is heard as one word is written as."""
    heard_as = {name_token(name): "_".join(spoken(name)) for name in expected.names}
    parted = [
        (tuple(heard_as.get(word, word) for word in sentence.split()), weight)
        for sentence, weight in expected.sentences
    ]
    sounds = pronunciations(sorted({word for sentence, _ in parted for word in sentence}), dictionary())
    understood = [(sentence, weight) for sentence, weight in parted if all(word in sounds for word in sentence)]
    return bigrams(understood), listed(sounds), {heard_as[name_token(name)]: name for name in expected.names}


def _written(words: str, names: Mapping[str, str]) -> str:
    """What was heard as plain text, the site's names as the site writes them."""
    return " ".join(_plain(word, names) for word in words.split())


def _plain(word: str, names: Mapping[str, str]) -> str:
    return names.get(word, word.replace("_", " "))
