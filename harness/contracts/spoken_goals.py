"""A goal that was spoken: what a recogniser wrote down of its recording, and how a mission names both (D48)."""

from harness.contracts.ids import Digest
from harness.contracts.values import Count, Name, Value


class SpokenVocabulary(Value):
    """What a recogniser may expect to hear: sentences in plain words, each with how often it counts.

    `names` are the site's own, which are heard as a whole: a sentence has the `name_token` of one in its place.
    """

    sentences: tuple[tuple[str, Count], ...]
    names: tuple[str, ...] = ()


class Transcription(Value):
    """What a recording says, written down twice: `text` among the expected sentences, `free` without them.

    `recording` is the digest of the file as it was given. The two are compared word by word.
    """

    recording: Digest
    recogniser: Name
    text: str
    free: str
    duration_s: float

    @property
    def agreed(self) -> bool:
        """Whether both say the same; where they do not, a person is asked before anything starts."""
        return bool(self.text) and _words(self.text) == _words(self.free)


class SpokenGoal(Value):
    """Where a mission's goal comes from: its recording, the stored Transcription, and the checksum of its text."""

    recording: Digest
    transcript: Digest
    checksum: Digest
    recogniser: Name


def name_token(name: str) -> str:
    """A name as one word of a sentence."""
    return "_".join(name.split())


def _words(text: str) -> list[str]:
    return text.lower().replace("-", " ").split()
