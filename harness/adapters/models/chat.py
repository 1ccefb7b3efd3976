"""Asks one model in the chat-completions protocol, checks its answer against a shape and records every exchange."""

import base64
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import msgspec

from harness.adapters.providers.http.exchange import nested_too_deep
from harness.contracts import models
from harness.contracts.errors import BlobDamaged, ModelAnswerInvalid, ModelFailed, ModelUnreachable
from harness.contracts.ids import Digest
from harness.contracts.reasons import Reason, because, plain
from harness.contracts.values import encode

T = TypeVar("T")
IMAGE_BYTES = 4 << 20
MOST_IMAGES = 8
CONTENT_BYTES = 64 << 10
"""No answer is longer, without the protocol's envelope."""
MOST_REPORTED_TOKENS = 10_000_000
BYTES_PER_TOKEN = 2
"""A low estimate, for the cost of a request whose tokens nobody reported."""
SCHEMA_FOLLOWS = "Answer with one JSON object and nothing else. It must match this JSON schema: "


class TransportFailed(Exception):
    """No whole answer that can be read. `again`: the same question may be asked once more."""

    def __init__(self, reason: Reason, *, again: bool) -> None:
        super().__init__(plain(reason))
        self.reason, self.again = reason, again


class ChatTransport(Protocol):
    """Carries one request to the endpoint and brings back the bytes of its answer."""

    def send(self, body: bytes, *, recorded: Digest, within_s: float) -> bytes:
        """`recorded` is the digest of the request as it is recorded. Raises TransportFailed."""


class _ChatUsage(msgspec.Struct, frozen=True):
    prompt_tokens: int = -1
    completion_tokens: int = -1


class _ChatMessage(msgspec.Struct, frozen=True):
    content: str | None = None


class _ChatChoice(msgspec.Struct, frozen=True):
    message: _ChatMessage
    finish_reason: str | None = None


class _ChatCompletion(msgspec.Struct, frozen=True):
    """What is read of an answer; endpoints add fields of their own."""

    choices: list[_ChatChoice]
    usage: _ChatUsage | None = None


class ChatModel:
    """Implements `contracts.models.ModelPort`. `keep` stores bytes and returns their digest; `read` gives images."""

    def __init__(
        self,
        endpoint: models.ModelEndpoint,
        transport: ChatTransport,
        *,
        keep: Callable[[bytes], Digest],
        read: Callable[[Digest], bytes],
    ) -> None:
        self._endpoint, self._transport = endpoint, transport
        self._keep, self._read = keep, read
        self._spent, self._lock = 0.0, threading.Lock()

    @property
    def name(self) -> str:
        return f"{self._endpoint.name} ({self._endpoint.model})"[:200]

    @property
    def takes_images(self) -> bool:
        return self._endpoint.images

    def ask(self, request: models.ModelRequest, shape: type[T]) -> models.ModelReply[T]:
        self._check_limits(request)
        sent, recorded = self._bodies(request, shape)
        stored = self._keep(recorded)
        asked_at_s, began_s = time.time(), time.monotonic()
        answer, problem, attempts = self._answered(sent, stored, began_s)
        completion: _ChatCompletion | None = None
        value: T | None = None
        failed: type[ModelFailed] = ModelUnreachable
        if answer is not None:
            failed = ModelAnswerInvalid
            try:
                completion = _completion(answer)
                value = _value(completion, shape, self._endpoint)
            except _Unusable as error:
                problem = error.reason
        exchange = self._exchange(
            request,
            shape,
            stored=stored,
            answer=self._keep(answer) if answer is not None else None,
            usage=_reported(completion),
            sent_bytes=len(recorded),
            asked_at_s=asked_at_s,
            seconds=time.monotonic() - began_s,
            attempts=attempts,
            refused=problem,
        )
        digest = self._keep(encode(exchange))
        if problem is not None or value is None:
            use = models.use_of(exchange, digest)
            raise failed(problem or because("model_answer_empty"), where=self._endpoint.base_url, use=use)
        return models.ModelReply(value=value, exchange=exchange, digest=digest)

    def _check_limits(self, request: models.ModelRequest) -> None:
        limit = self._endpoint.price.limit
        with self._lock:
            spent = self._spent
        if limit is not None and spent >= limit:
            raise ModelFailed(
                because("model_cost_limit_reached", spent=spent, limit=limit, currency=self._endpoint.price.currency),
                where=self._endpoint.name,
            )
        images = sum(isinstance(part, models.MessageImage) for one in request.messages for part in one.parts)
        if images and not self._endpoint.images:
            raise ModelFailed(because("model_takes_no_images"), where=self._endpoint.name)
        if images > MOST_IMAGES:
            raise ModelFailed(because("model_images_too_many", images=images, most=MOST_IMAGES))

    def _bodies(self, request: models.ModelRequest, shape: type) -> tuple[bytes, bytes]:
        """The request as it is sent, and as it is recorded: with digests in place of the images' bytes."""
        sent = _body(self._endpoint, request, shape, self._image)
        if not self._endpoint.images:
            return sent, sent
        return sent, _body(self._endpoint, request, shape, lambda image: f"sha256:{image.digest}")

    def _image(self, image: models.MessageImage) -> str:
        try:
            body = self._read(image.digest)
        except BlobDamaged as error:
            raise ModelFailed(error.reason, where=image.digest[:12]) from error
        if len(body) > IMAGE_BYTES:
            raise ModelFailed(because("model_image_too_large", limit_mib=IMAGE_BYTES >> 20), where=image.digest[:12])
        return f"data:{image.media_type};base64,{base64.b64encode(body).decode()}"

    def _answered(self, sent: bytes, stored: Digest, began_s: float) -> tuple[bytes | None, Reason | None, int]:
        """The answer's bytes, or why none came, and how often was asked. All attempts share one time limit."""
        problem: Reason | None = None
        for attempt in range(1, self._endpoint.retries + 2):
            left_s = self._endpoint.timeout_s - (time.monotonic() - began_s)
            if attempt > 1 and left_s <= 0:
                return None, problem, attempt - 1
            try:
                return self._transport.send(sent, recorded=stored, within_s=left_s), None, attempt
            except TransportFailed as error:
                problem = error.reason
                if not error.again:
                    return None, problem, attempt
        return None, problem, self._endpoint.retries + 1

    def _exchange(
        self,
        request: models.ModelRequest,
        shape: type,
        *,
        stored: Digest,
        answer: Digest | None,
        usage: tuple[int | None, int | None],
        sent_bytes: int,
        asked_at_s: float,
        seconds: float,
        attempts: int,
        refused: Reason | None,
    ) -> models.ModelExchange:
        endpoint = self._endpoint
        most_output = min(request.max_tokens or endpoint.max_tokens, endpoint.max_tokens)
        billed_input = usage[0] if usage[0] is not None else sent_bytes // BYTES_PER_TOKEN * attempts
        billed_output = usage[1] if usage[1] is not None else most_output * attempts
        cost = billed_input * endpoint.price.input_per_million + billed_output * endpoint.price.output_per_million
        with self._lock:
            self._spent += cost / 1e6
        return models.ModelExchange(
            role=request.role,
            endpoint=endpoint.name,
            model=endpoint.model,
            request=stored,
            schema=models.schema_digest(shape),
            answer=answer,
            asked_at_s=asked_at_s,
            seconds=seconds,
            attempts=attempts,
            input_tokens=usage[0],
            output_tokens=usage[1],
            cost=cost / 1e6,
            currency=endpoint.price.currency,
            refused=refused or "",
        )


class _Unusable(Exception):
    """An answer that breaks a rule."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(plain(reason))
        self.reason = reason


def _body(
    endpoint: models.ModelEndpoint,
    request: models.ModelRequest,
    shape: type,
    image: Callable[[models.MessageImage], str],
) -> bytes:
    messages = [{"role": one.speaker, "content": _content(one, image)} for one in request.messages]
    body: dict[str, Any] = {
        "model": endpoint.model,
        "messages": messages,
        "temperature": 0,
        "max_tokens": min(request.max_tokens or endpoint.max_tokens, endpoint.max_tokens),
        "stream": False,
    }
    schema = models.schema_of(shape)
    if endpoint.answers == "json_schema":
        strict = {"name": request.role, "strict": True, "schema": msgspec.json.decode(schema)}
        body["response_format"] = {"type": "json_schema", "json_schema": strict}
    else:
        messages.insert(0, {"role": "system", "content": SCHEMA_FOLLOWS + schema.decode()})
    if endpoint.answers == "json_object":
        body["response_format"] = {"type": "json_object"}
    return encode(body)


def _content(message: models.ModelMessage, image: Callable[[models.MessageImage], str]) -> Any:
    """One text where there are no images, as every endpoint takes it; else a list of parts."""
    if all(isinstance(part, models.MessageText) for part in message.parts):
        return "\n".join(part.text for part in message.parts if isinstance(part, models.MessageText))
    return [
        {"type": "text", "text": part.text}
        if isinstance(part, models.MessageText)
        else {"type": "image_url", "image_url": {"url": image(part)}}
        for part in message.parts
    ]


def _completion(answer: bytes) -> _ChatCompletion:
    if nested_too_deep(answer):
        raise _Unusable(because("model_answer_nested"))
    try:
        return msgspec.json.decode(answer, type=_ChatCompletion)
    except msgspec.MsgspecError as error:
        raise _Unusable(because("model_speaks_other_protocol", error=str(error)[:200])) from error


def _value(completion: _ChatCompletion, shape: type[T], endpoint: models.ModelEndpoint) -> T:
    """What the model said, as the shape. Raises _Unusable."""
    choice = completion.choices[0] if completion.choices else None
    content = choice.message.content if choice else None
    if choice is None or not content:
        raise _Unusable(because("model_answer_empty"))
    if choice.finish_reason == "length":
        raise _Unusable(because("model_answer_cut_off"))
    body = content.encode("utf-8", "replace")
    if len(body) > CONTENT_BYTES:
        raise _Unusable(because("model_answer_too_long", characters=len(content), longest=CONTENT_BYTES))
    if endpoint.answers == "text":
        body = body[body.find(b"{") : body.rfind(b"}") + 1]
    if nested_too_deep(body):
        raise _Unusable(because("model_answer_nested"))
    try:
        return msgspec.json.decode(body, type=shape, strict=True)
    except msgspec.ValidationError as error:
        raise _Unusable(because("model_answer_misshapen", error=str(error)[:200])) from error
    except msgspec.DecodeError as error:
        raise _Unusable(because("model_answer_not_json", error=str(error)[:200])) from error


def _reported(completion: _ChatCompletion | None) -> tuple[int | None, int | None]:
    """The tokens that the endpoint reports, in and out, where the figures can be true."""
    if completion is None or completion.usage is None:
        return None, None
    usage = completion.usage
    counts = (usage.prompt_tokens, usage.completion_tokens)
    first, second = (one if 0 <= one <= MOST_REPORTED_TOKENS else None for one in counts)
    return first, second
