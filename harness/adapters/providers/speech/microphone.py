"""Records what was heard in the room while a report was spoken, and has it recognised (D47)."""

from collections.abc import Callable

from msgspec.structs import replace

from harness.adapters.providers.speech.playback_speed import at_another_speed
from harness.adapters.providers.speech.recogniser import recognised
from harness.adapters.providers.speech.recordings import RecordingClaims
from harness.contracts.errors import HarnessError
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import PLAYED_AT, PLAYED_FOR, Measurement
from harness.contracts.ports import Room
from harness.contracts.values import encode

MICROPHONE = "room microphone"
RECOGNISER = "recogniser"
Keep = Callable[[bytes], Digest]
Read = Callable[[Digest], bytes]


class RoomMicrophone:
    """IndependentSource of what speech is to show (`predicate`): the recording of the playback, kind "room_sound", and
    its "recognition".

    A recording that was taken for another request before, or a copy of one, is no recording of this playback: only its
    recognition is given then, which names that request, and the predicate is left undecided. So it is with one that
    runs at another speed than what was played. Without a room to record, the sound that the speaker's receipt names is
    recognised: that shows what was synthesised, never that it was played.
    `read` fetches sounds by their digest.
    """

    lasting = False

    def __init__(
        self,
        room: Room | None,
        *,
        keep: Keep,
        read: Read,
        claims: RecordingClaims | None = None,
        predicate: str = "heard",
    ) -> None:
        self.predicate = predicate
        self._room, self._keep, self._read = room, keep, read
        self._claims = claims or RecordingClaims(None, read=read)

    @property
    def able(self) -> bool:
        """Whether there is a room to record."""
        return self._room is not None

    def measure(self, measurement: Measurement) -> tuple[EvidenceReference, ...]:
        """Nothing for a look that speaks nothing. Raises ProviderFailed if the recogniser fails."""
        if not measurement.executes or measurement.until_s <= measurement.from_s:
            return ()
        if self._room is not None:
            recording = self._room.recording(measurement.from_s, measurement.until_s)
            digest = self._keep(recording)
            if speed := self._another_speed(recording, measurement):
                recognition = self._recognition(recording, measurement)
                return (replace(recognition, values=recognition.values | {PLAYED_AT: speed}),)
            for request in measurement.requests[-1:]:
                if earlier := self._claims.earlier(recording, request, blob=digest):
                    recognition = self._recognition(recording, measurement)
                    return (replace(recognition, values=recognition.values | {PLAYED_FOR: earlier}),)
            return (
                self._reference("room_sound", MICROPHONE, digest, measurement),
                self._recognition(recording, measurement),
            )
        playbacks = [one.blob for one in measurement.receipts if one.kind == "playback" and one.blob]
        return (self._recognition(self._read(playbacks[-1]), measurement),) if playbacks else ()

    def _another_speed(self, recording: bytes, measurement: Measurement) -> float | None:
        """How fast the recording runs beside what the receipt says was played, where it is no recording of that."""
        played = [one.blob for one in measurement.receipts if one.kind == "playback" and one.blob]
        try:
            return at_another_speed(recording, self._read(played[-1])) if played else None
        except HarnessError:
            return None

    def _recognition(self, recording: bytes, measurement: Measurement) -> EvidenceReference:
        found = recognised(recording, text=measurement.text, names=measurement.names)
        return self._reference("recognition", RECOGNISER, self._keep(encode(found)), measurement)

    def _reference(self, kind: str, source: str, blob: Digest, measurement: Measurement) -> EvidenceReference:
        return EvidenceReference(
            kind=kind,
            origin="sensor",
            source=source,
            from_s=measurement.from_s,
            until_s=measurement.until_s,
            confidence=1.0,
            blob=blob,
            values={"asked_text": self._keep(measurement.text.encode())},
        )
