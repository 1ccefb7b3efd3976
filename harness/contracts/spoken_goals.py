"""A goal that was spoken: what a recogniser wrote down of its recording, and how a mission names both (D48)."""

import re
from typing import Literal

from msgspec import UNSET, UnsetType

from harness.contracts.ids import Digest
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Value


class SpokenVocabulary(Value):
    """What a recogniser may expect to hear: sentences in plain words, each with how often it counts.

    `names` are the site's own, which are heard as a whole: a sentence has the `name_token` of one in its place. So are
    `wake_phrases`, which may stand before a sentence and are no part of it.
    """

    sentences: tuple[tuple[str, Count], ...]
    names: tuple[str, ...] = ()
    wake_phrases: tuple[str, ...] = ()


class Transcription(Value):
    """What a recording says, written down twice: `text` among the expected sentences, `free` without them.

    `recording` is the digest of the file as it was given. The two are compared word by word, without the `wake` phrase
    that stands before them. `speech_s`: from when until when somebody speaks, where that was measured. `decoder`: who
    wrote down `free`, where it was not the recogniser itself; `problem`: why a decoder that was to did not.
    """

    recording: Digest
    recogniser: Name
    text: str
    free: str
    duration_s: float
    wake: str | UnsetType = UNSET
    speech_s: tuple[float, float] | UnsetType = UNSET
    decoder: Name | UnsetType = UNSET
    problem: Explanation | UnsetType = UNSET

    @property
    def agreed(self) -> bool:
        """Whether both say the same; where they do not, a person is asked before anything starts."""
        return bool(self.text) and _words(self.text) == _words(self.free)


class AudioCapture(Value):
    """How a recording came about: wall seconds, by the clock of the machine whose microphone it was (R235).

    `acquired_s`: the microphone gave its first samples; `recording_s`: the recording began, with a press or a word.
    Neither is known of a file that somebody chose. `source`: microphone or file.
    """

    source: Literal["microphone", "file"]
    acquired_s: float | UnsetType = UNSET
    recording_s: float | UnsetType = UNSET


class SpokenGoal(Value):
    """Where a mission's goal comes from: its recording, the stored Transcription, and the checksum of its text.

    `free` is what the second decoding heard, `wake` the phrase before the command, `capture` how it was recorded: unset
    where they are not known.
    """

    recording: Digest
    transcript: Digest
    checksum: Digest
    recogniser: Name
    free: str | UnsetType = UNSET
    wake: str | UnsetType = UNSET
    capture: AudioCapture | UnsetType = UNSET


def name_token(name: str) -> str:
    """A name as one word of a sentence."""
    return "_".join(name.split())


def _words(text: str) -> list[str]:
    return text.lower().replace("-", " ").split()


UNITS = (
    "zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve",
    "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen",
)  # fmt: skip
TENS = ("twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety")


def spoken_words(text: str) -> tuple[str, ...]:
    """The words that are heard when a text is read aloud."""
    lowered = re.sub(r"(\d)\s*%", r"\1 percent", text.lower())
    joined = re.sub(r"[^a-z0-9' ]+", " ", lowered)
    return tuple(word for token in joined.split() for word in (spoken_number(token) if token.isdigit() else [token]))


def spoken_number(digits: str) -> list[str]:
    """A number in words; a long one digit by digit."""
    number = int(digits)
    if number < len(UNITS):
        return [UNITS[number]]
    if number < 100:
        return [TENS[number // 10 - 2], *([UNITS[number % 10]] if number % 10 else [])]
    if number == 100:
        return ["one", "hundred"]
    return [UNITS[int(digit)] for digit in digits]
