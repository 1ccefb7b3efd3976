"""Recognises what people are saying now: a few recognisers at a time, each for one person, until nothing more comes."""

import io
import threading
import wave
from collections.abc import Callable
from dataclasses import dataclass, field

from harness.contracts.errors import ProviderFailed, RecordingUnusable, UnknownName
from harness.contracts.ports import SpeechStream
from harness.contracts.reasons import because

MOST_AT_ONCE = 4
RATE_HZ = 16_000
LONGEST_BYTES = 30 * 2 * RATE_HZ
"""The longest recording of a goal, at two bytes a sample."""
SILENT_S = 20.0


@dataclass
class SpeechSession:
    """One stream: its owner, its samples so far, and when samples last came (wall seconds)."""

    owner: str
    stream: SpeechStream
    fed_s: float
    body: bytearray = field(default_factory=bytearray)
    lock: threading.Lock = field(default_factory=threading.Lock)


class SpeechSessions:
    """Opens, feeds and ends streams by a name that nobody can guess. `clock` is wall time."""

    def __init__(
        self, listen: Callable[[], SpeechStream], *, clock: Callable[[], float], key: Callable[[], str]
    ) -> None:
        self._listen, self._clock, self._key = listen, clock, key
        self._open: dict[str, SpeechSession] = {}
        self._lock = threading.Lock()

    @classmethod
    def deaf(cls) -> "SpeechSessions":
        """Of a console without a recogniser: every stream is refused."""

        def refuse() -> SpeechStream:
            raise RecordingUnusable(because("no_transcriber"), where="speech")

        return cls(refuse, clock=lambda: 0.0, key=lambda: "")

    def begin(self, owner: str) -> str:
        """The name of a new stream; a person's earlier one ends. Raises ProviderFailed where too many are open."""
        with self._lock:
            self._drop(lambda one: one.owner == owner or self._clock() - one.fed_s > SILENT_S)
            if len(self._open) >= MOST_AT_ONCE:
                raise ProviderFailed(because("too_many_speakers", limit=MOST_AT_ONCE))
            name = self._key()
            self._open[name] = SpeechSession(owner=owner, stream=self._listen(), fed_s=self._clock())
            return name

    def feed(self, name: str, owner: str, samples: bytes) -> str:
        """The words so far. Raises UnknownName, and ProviderFailed, after which the stream is over."""
        session = self._of(name, owner)
        with session.lock:
            session.fed_s = self._clock()
            try:
                if len(session.body) + len(samples) > LONGEST_BYTES:
                    raise ProviderFailed(because("speech_too_long", limit_s=LONGEST_BYTES // (2 * RATE_HZ)))
                words = session.stream.feed(samples)
            except ProviderFailed:
                self._end(name)
                raise
            session.body += samples
            return words

    def finish(self, name: str, owner: str) -> tuple[str, bytes]:
        """The words of all of it, and it as a WAV; the stream is over. Raises UnknownName, ProviderFailed."""
        session = self._of(name, owner)
        with session.lock:
            try:
                return session.stream.finish(), _wav(bytes(session.body))
            finally:
                self._end(name)

    def close(self) -> None:
        """End every stream."""
        with self._lock:
            self._drop(lambda one: True)

    def _of(self, name: str, owner: str) -> SpeechSession:
        with self._lock:
            session = self._open.get(name)
        if session is None or session.owner != owner:
            raise UnknownName(because("speech_unknown", stream=name[:16]))
        return session

    def _end(self, name: str) -> None:
        with self._lock:
            self._drop(lambda one: one is self._open.get(name))

    def _drop(self, which: Callable[[SpeechSession], bool]) -> None:
        for name in [name for name, one in self._open.items() if which(one)]:
            self._open.pop(name).stream.close()


def _wav(samples: bytes) -> bytes:
    made = io.BytesIO()
    with wave.open(made, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes(samples)
    return made.getvalue()
