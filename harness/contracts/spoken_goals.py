"""A goal that was spoken: what a recogniser wrote down of its recording, and how a mission names both (D48)."""

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
