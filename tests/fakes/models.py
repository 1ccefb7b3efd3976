"""Models behind no network, checked and recorded as real ones: from a function, or from recorded exchanges."""

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import msgspec

from harness.adapters.models.chat import ChatModel, TransportFailed
from harness.adapters.stores.memory import MemoryBlobStore
from harness.contracts.ids import Digest
from harness.contracts.models import ModelEndpoint, ModelExchange
from harness.contracts.reasons import because
from harness.contracts.values import encode
from tests.builders.model_endpoint import completion

Script = Callable[[dict[str, Any]], "str | bytes"]


class ScriptedTransport:
    """Implements `ChatTransport`; `asked` holds every request's JSON."""

    def __init__(self, answer: Script) -> None:
        self._answer = answer
        self.asked: list[dict[str, Any]] = []

    def send(self, body: bytes, *, recorded: Digest, within_s: float) -> bytes:
        self.asked.append(msgspec.json.decode(body))
        said = self._answer(self.asked[-1])
        return said if isinstance(said, bytes) else json.dumps(completion(said)).encode()


def scripted_model(answer: Script | str | object, **settings: Any) -> ChatModel:
    """A model that always says one thing, or what a function makes of the request; a value is said as its JSON.

    `blobs` (a blob store) keeps the exchanges; the other settings are the endpoint's.
    """
    blobs = settings.pop("blobs", None) or MemoryBlobStore()
    said = answer if isinstance(answer, str) else "" if callable(answer) else encode(answer).decode()
    script: Script = answer if callable(answer) else lambda request: said
    named = {"name": "scripted", "base_url": "http://127.0.0.1:9/v1", "model": "scripted-1", **settings}
    return ChatModel(ModelEndpoint(**named), ScriptedTransport(script), keep=blobs.put, read=blobs.get)


class RecordedTransport:
    """Implements `ChatTransport`. `answers` holds the bytes of answers by the digest of the request as recorded."""

    def __init__(self, answers: Mapping[Digest, bytes]) -> None:
        self._answers = answers

    def send(self, body: bytes, *, recorded: Digest, within_s: float) -> bytes:
        found = self._answers.get(recorded)
        if found is None:
            raise TransportFailed(because("model_exchange_unrecorded", request=recorded[:12]), again=False)
        return found


def recorded_answers(exchanges: Iterable[ModelExchange], *, read: Callable[[Digest], bytes]) -> dict[Digest, bytes]:
    """What a RecordedTransport needs, from exchanges and the store that holds their bytes. Raises BlobDamaged."""
    return {one.request: read(one.answer) for one in exchanges if one.answer is not None}
