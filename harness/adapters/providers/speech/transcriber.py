"""Transcribes a person's recording twice: against the expected sentences, and freely (D48).

A Transcriber with the model in PocketSphinx's wheel, which knows American English. It decides nothing.
"""

from collections.abc import Mapping
from functools import lru_cache
from itertools import product
from typing import Protocol

import numpy as np
import numpy.typing as npt
from msgspec import UNSET
from msgspec.structs import replace

from harness.adapters.providers.speech.activity import speech_in
from harness.adapters.providers.speech.language_model import bigrams, pronunciations, spoken
from harness.adapters.providers.speech.recogniser import NAME, Decoded, decode, decoded, dictionary, listed
from harness.adapters.providers.speech.streaming import SphinxStream
from harness.adapters.providers.speech.voice import wav
from harness.adapters.providers.speech.waves import RATE_HZ, over_noise, read_wave
from harness.contracts.errors import ProviderFailed, RecordingUnusable
from harness.contracts.ids import sha256
from harness.contracts.reasons import Reason, because
from harness.contracts.spoken_goals import SpokenVocabulary, Transcription, name_token

SHORTEST_S, LONGEST_S = 0.2, 30.0
PAUSE_S = 0.4
FILLERS = frozenset({"<s>", "</s>", "<sil>", "[NOISE]", "[SPEECH]"})
PINYIN = {
    "xiao": ("SH AW", "SH Y AW", "S Y AW", "ZH AW", "Z AY OW", "Z IY AW", "S IY AW", "Z IY OW", "K S IY AW"),
    "wei": ("W EY", "W AY"),
}
"""Syllables of wake phrases that the English dictionary lacks, or has in one way only."""


class FreeDecoder(Protocol):
    """Hears without expecting anything. `name` is stored with what it heard. Raises ProviderFailed."""

    @property
    def name(self) -> str: ...

    def hear(self, recording: bytes) -> str: ...


class SphinxTranscriber:
    """Transcriber by PocketSphinx, each decoding in a process of its own with a time limit.

    `decoder` hears freely in place of its own second decoding; where it fails, its own stands, with the reason. What it
    hears in a language that PocketSphinx does not know is the text, which nothing agrees with: a person is asked.
    """

    name = NAME

    def __init__(self, decoder: FreeDecoder | None = None) -> None:
        self._decoder = decoder

    def listen(self, *, expected: SpokenVocabulary) -> SphinxStream:
        """What somebody says while they say it. Raises ProviderFailed if the recogniser fails."""
        model, words, names = language_of(expected)
        return SphinxStream(model=model, dictionary=words, names=dict(names))

    def transcribe(self, recording: bytes, *, expected: SpokenVocabulary) -> Transcription:
        """Raises RecordingUnusable for what is no speech in a 16-bit mono WAV, ProviderFailed if decoding fails."""
        sound = read_wave(recording, shortest_s=SHORTEST_S, longest_s=LONGEST_S)
        if isinstance(sound, Reason):
            raise _unusable(sound)
        model, words, names = language_of(expected)
        spoken_at = speech_in(sound)
        if spoken_at is None:
            raise _unusable(because("sound_without_words"))
        samples = sound.samples[round(spoken_at.from_s * RATE_HZ) : round(spoken_at.until_s * RATE_HZ)]
        found = decoded(_in_a_room(samples), model=model, dictionary=words)
        wake, until_s = woken(found, expected)
        text = written(found.text.removeprefix(name_token(wake)) if wake else found.text, names)
        command = samples[round(max(0.0, until_s - PAUSE_S) * RATE_HZ) :]
        made = Transcription(
            recording=sha256(recording),
            recogniser=self.name,
            text=text,
            free="",
            duration_s=sound.duration_s,
            wake=wake or UNSET,
            speech_s=(spoken_at.from_s, spoken_at.until_s) if spoken_at.measured else UNSET,
        )
        made = self._decoded_freely(made, command)
        if not made.text:
            raise _unusable(because("sound_without_words"))
        return made

    def _decoded_freely(self, made: Transcription, command: npt.NDArray[np.int16]) -> Transcription:
        """With the second decoding: the configured decoder's, or the recogniser's own with the reason.

        What only the decoder understands, because it is another language, is the text; nothing then agrees with it.
        """
        if self._decoder is not None:
            try:
                words = self._decoder.hear(wav(command, rate_hz=RATE_HZ))
            except ProviderFailed as error:
                made = replace(made, problem=error.reason)
            else:
                alone = bool(words) and not (made.text and words.isascii())
                by, text, free = (self._decoder.name, words, "") if alone else (made.recogniser, made.text, words)
                return replace(made, recogniser=by, text=text, free=free, decoder=self._decoder.name)
        return replace(made, free=" ".join(decode(_in_a_room(command)).split()))


def woken(found: Decoded, expected: SpokenVocabulary) -> tuple[str, float]:
    """The wake phrase that stands before the command and when it ends, in seconds of what was decoded; "" and 0.0
    where none does."""
    phrases = {name_token(one): one for one in expected.wake_phrases}
    spoken_words = [one for one in found.words if one[0] not in FILLERS]
    first = spoken_words[0][0].partition("(")[0] if spoken_words else ""
    return (phrases[first], spoken_words[0][2]) if first in phrases else ("", 0.0)


def _in_a_room(samples: npt.NDArray[np.int16]) -> bytes:
    """The samples between two pauses, over the same faint noise each time."""
    pause = np.zeros(round(PAUSE_S * RATE_HZ))
    return over_noise(np.concatenate([pause, samples, pause]), np.random.default_rng(0))


def _unusable(reason: Reason) -> RecordingUnusable:
    facts = {"low_s": SHORTEST_S, "high_s": LONGEST_S}
    return RecordingUnusable(because("recording_unusable", reason=reason, **facts), where="recording")


@lru_cache(maxsize=4)
def language_of(expected: SpokenVocabulary) -> tuple[str, str, Mapping[str, str]]:
    """The language model, its dictionary, and what each name that is heard as one word is written as."""
    heard_as = {name_token(name): "_".join(spoken(name)) for name in (*expected.names, *expected.wake_phrases)}
    parted = [
        (tuple(heard_as.get(word, word) for word in sentence.split()), weight)
        for sentence, weight in expected.sentences
    ]
    sounds = pronunciations(sorted({word for sentence, _ in parted for word in sentence}), dictionary())
    for phrase in expected.wake_phrases:
        word = heard_as[name_token(phrase)]
        if ways := dict.fromkeys((*sounds.get(word, ()), *_foreign(phrase))):
            sounds[word] = tuple(ways)
    understood = [(sentence, weight) for sentence, weight in parted if all(word in sounds for word in sentence)]
    return bigrams(understood), listed(sounds), {heard_as[name_token(name)]: name for name in expected.names}


def _foreign(phrase: str) -> tuple[str, ...]:
    """A wake phrase that is no English, as English voices and its own speakers say it; none where a part is not known
    here."""
    parts = [PINYIN.get(part, ()) for part in phrase.split()]
    return tuple(" ".join(one) for one in product(*parts)) if all(parts) else ()


def written(words: str, names: Mapping[str, str]) -> str:
    """What was heard as plain text, the site's names as the site writes them."""
    return " ".join(_plain(word, names) for word in words.split())


def _plain(word: str, names: Mapping[str, str]) -> str:
    return names.get(word, word.replace("_", " "))
