"""Has a recording transcribed by a service that implements OpenAI's `POST /v1/audio/transcriptions`."""

import re
from collections.abc import Callable

import msgspec

from harness.adapters.providers.messaging.exchange import ServiceExchange
from harness.contracts.channels import TranscriptionEndpoint
from harness.contracts.errors import HarnessError, ProviderFailed
from harness.contracts.reasons import because
from harness.contracts.secret_references import SecretReference

LONGEST_TEXT = 2000


class TranscriptionAnswer(msgspec.Struct, frozen=True):
    """The part of the answer that is read."""

    text: str


class EndpointDecoder:
    """Hears freely, by a configured service. What it answers is text that somebody said, and orders nothing."""

    def __init__(self, entry: TranscriptionEndpoint, *, secret: Callable[[SecretReference], str]) -> None:
        self._entry, self._secret = entry, secret
        self._exchange = ServiceExchange("transcription", timeout_s=entry.timeout_s)

    @property
    def name(self) -> str:
        """The model, as it is stored with every transcript."""
        return f"endpoint {self._entry.model}"

    def hear(self, recording: bytes) -> str:
        """The words of a WAV in lower case, without punctuation. Raises ProviderFailed for a service that does not
        answer in time, or with anything else."""
        try:
            token = self._entry.token
            headers = {"authorization": f"Bearer {self._secret(token)}"} if token else {}
            answer = self._exchange.prepare(
                f"{self._entry.address.rstrip('/')}/audio/transcriptions",
                TranscriptionAnswer,
                headers=headers,
                data={"model": self._entry.model, "response_format": "json"},
                files={"file": ("speech.wav", recording, "audio/wav")},
            )
        except HarnessError as error:
            raise ProviderFailed(because("transcription_failed", problem=error.reason), where="voice") from error
        if len(answer.text) > LONGEST_TEXT:
            raise ProviderFailed(because("transcription_too_long", limit=LONGEST_TEXT), where="voice")
        return " ".join(re.sub(r"[^\w' ]+", " ", answer.text.lower()).split())
