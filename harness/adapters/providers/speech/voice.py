"""Speaks a report: synthesises the text, plays it in mission time, and gives a receipt only for a complete playback."""

import io
import wave
from pathlib import Path

from harness.adapters.providers import local
from harness.adapters.providers.speech.espeak import Samples, synthesise
from harness.adapters.providers.speech.speaker import Speaker
from harness.contracts import capabilities, ids
from harness.contracts.effects import Symbolic
from harness.contracts.errors import ProviderFailed
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.protocol import PROTOCOL, Progress, StartRequest
from harness.contracts.reasons import because
from harness.contracts.values import Value
from harness.provider_protocol.proposals import claims

CARD = capabilities.CapabilityCard(
    provider_id=ids.ProviderId("espeak-voice"),
    version="1",
    embodiments=("any",),
    parameters=(capabilities.Parameter(name="text", type="string"),),
    preconditions=(),
    side_effects=("sound at the robot",),
    latency=capabilities.Latency(base_s=8.0),
    resources=(ids.ResourceId("speaker"),),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=1.0),
    risk="low",
    failure_words=("timeout", "interrupted", "playback_differs", "provider_failed", "store_unavailable"),
    evidence=("receipt:playback",),
    capability="speak",
    estimates=capabilities.Estimates(success=0.99, risk=0.0, uncertainty=0.01, cost=0.0),
    moves=False,
    sources=("speaker",),
    software="espeak-ng",
    protocol=PROTOCOL,
)


class _Playback(Value):
    """What is being played: the WAV's digest, the digest of its samples, how many, their rate, and since when."""

    request: ids.RequestId
    wav: ids.Digest
    pcm: ids.Digest
    samples: int
    rate_hz: int
    begun_s: float

    @property
    def end_s(self) -> float:
        return self.begun_s + self.samples / self.rate_hz


class EspeakVoice(local.LocalProvider):
    """speak by espeak-ng through a Speaker. The WAV (16-bit mono) is stored when the playback begins.

    The one `playback` receipt is given when the speaker took every sample, and the same ones: blob = the WAV, at_s =
    the end of the sound. Stopped or restarted in the middle: no receipt; after a restart `interrupted`.
    """

    def __init__(self, speaker: Speaker, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)
        self._speaker = speaker
        self._playback: _Playback | None = None

    def check(self, request: StartRequest) -> None:
        text = str(request.parameters["text"])
        if not text.strip() or "\0" in text:
            raise ProviderFailed(because("text_not_speakable"), where=CARD.provider_id)
        if self._playback is not None and self._clock.now().mission_s < self._playback.end_s:
            raise ProviderFailed(because("speaker_busy"), where=CARD.provider_id)

    def begin(self, request: StartRequest, now_s: float) -> None:
        samples, rate_hz = synthesise(str(request.parameters["text"]))
        if not samples.any():
            raise ProviderFailed(because("text_without_sound"), where=CARD.provider_id)
        self._playback = _Playback(
            request=request.identity.request_id,
            wav=self._blobs.put(wav(samples, rate_hz=rate_hz)),
            pcm=ids.sha256(samples.astype("<i2").tobytes()),
            samples=len(samples),
            rate_hz=rate_hz,
            begun_s=now_s,
        )
        self._speaker.begin(samples, rate_hz=rate_hz, at_s=now_s)

    def halt(self, request: ids.RequestId) -> None:
        if self._playback is not None and self._playback.request == request:
            self._speaker.halt()
            self._playback = None

    def work(self, request: StartRequest, now_s: float) -> local.Outcome:
        playback = self._playback
        if playback is None or playback.request != request.identity.request_id:
            return local.Failed(failure="interrupted", message=because("playback_cut_off"))
        taken = self._speaker.consumed(now_s)
        if taken < playback.samples:
            return Progress(
                share=taken / playback.samples, text=because("samples_played", played=taken, samples=playback.samples)
            )
        recording = self._speaker.samples_digest()
        self.halt(request.identity.request_id)
        if recording != playback.pcm:
            return local.Failed(failure="playback_differs", message=because("playback_differs"))
        return _result(playback, request)


def _result(playback: _Playback, request: StartRequest) -> local.Result:
    duration_s = playback.samples / playback.rate_hz
    values = {
        "samples": float(playback.samples),
        "sample_rate_hz": float(playback.rate_hz),
        "duration_s": duration_s,
    }
    return local.Result(
        message=because("spoken_within", duration_s=duration_s),
        drafts=(
            local.ReceiptDraft(kind="playback", text="played to the last sample", blob=playback.wav, values=values),
        ),
        declared={"duration_s": duration_s},
        blobs=(playback.wav,),
        at_s=playback.end_s,
        proposes=claims(request, Symbolic, {"sound": playback.wav, "duration_s": duration_s}),
    )


def wav(samples: Samples, *, rate_hz: int) -> bytes:
    """A WAV file of 16-bit mono samples."""
    body = io.BytesIO()
    with wave.open(body, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate_hz)
        file.writeframes(samples.astype("<i2").tobytes())
    return body.getvalue()
