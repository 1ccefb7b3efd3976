"""What a model is asked and answers, by role. A model proposes; nothing that it says has any authority (R48)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Generic, Literal, Protocol, TypeVar, get_args

import msgspec

from harness.contracts.ids import Digest, NodeId, sha256
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, NonNegative, Positive, Value

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

ModelRole = Literal[
    "goal_reader",
    "planner",
    "target_proposer",
    "visual_analysis",
    "description",
    "recovery_advice",
    "diagnosis",
    "candidate_generator",
]
MODEL_ROLES: tuple[ModelRole, ...] = get_args(ModelRole)
ModelName = Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9][a-z0-9._-]{0,60}$")]
ModelAddress = Annotated[str, msgspec.Meta(pattern=r"^https?://[^\s/@?#]+(/[^\s?#]*)?$", max_length=300)]
MOST_TOKENS = 16_384


class ModelPrice(Value):
    """What tokens cost, in `currency` per million. `limit`: what one run of the harness may spend; None: no limit."""

    currency: Annotated[str, msgspec.Meta(pattern=r"^[A-Z]{3}$")] = "USD"
    input_per_million: NonNegative = 0.0
    output_per_million: NonNegative = 0.0
    limit: Positive | None = None


class ModelEndpoint(Value):
    """An OpenAI-compatible endpoint and one model there.

    `timeout_s` bounds one question as a whole, its `retries` included. `images`: whether it takes images. `answers`:
    how it is held to a shape: a strict JSON schema, any JSON object, or by the instructions alone. Whatever it is,
    every answer is checked here.
    """

    name: ModelName
    base_url: ModelAddress
    model: Name
    timeout_s: Annotated[float, msgspec.Meta(gt=0, le=600)] = 30.0
    max_tokens: Annotated[int, msgspec.Meta(ge=1, le=MOST_TOKENS)] = 512
    retries: Annotated[int, msgspec.Meta(ge=0, le=5)] = 1
    images: bool = False
    answers: Literal["json_schema", "json_object", "text"] = "json_schema"
    price: ModelPrice = ModelPrice()


class MessageText(Value, tag_field="type", tag="text"):
    """Text of a message."""

    text: str


class MessageImage(Value, tag_field="type", tag="image"):
    """An image of a message, by the digest of its bytes in the blob store."""

    digest: Digest
    media_type: Literal["image/jpeg", "image/png"] = "image/jpeg"


class ModelMessage(Value):
    """One message. `system` holds the harness's own instructions and nothing that came from outside."""

    speaker: Literal["system", "user"]
    parts: tuple[MessageText | MessageImage, ...]


class ModelRequest(Value):
    """One question in one role. `max_tokens` lowers the endpoint's own limit."""

    role: ModelRole
    messages: tuple[ModelMessage, ...]
    max_tokens: Annotated[int, msgspec.Meta(ge=1, le=MOST_TOKENS)] | None = None


class ModelExchange(Value):
    """The record of one question: who was asked what, what came back, what it cost, and which rule refused the answer.

    `request` and `answer` are digests of the bytes as sent and as received, `schema` of the shape that was asked for;
    `answer` is None where no whole answer came. `seconds` of wall time in all; `asked_at_s` wall time. Tokens are None
    where the endpoint does not report them, and `cost` is then an upper estimate. `refused` is empty for an answer of
    the right shape.
    """

    role: ModelRole
    endpoint: ModelName
    model: Name
    request: Digest
    schema: Digest
    answer: Digest | None
    asked_at_s: float
    seconds: NonNegative
    attempts: Count
    input_tokens: Count | None
    output_tokens: Count | None
    cost: NonNegative
    currency: str
    refused: Explanation = ""


class ModelUse(Value):
    """Who spoke, at which cost: what events and pages keep of an exchange. `exchange` is the digest of its record."""

    model: Name
    exchange: Digest
    seconds: NonNegative
    cost: NonNegative
    currency: str
    input_tokens: Count | None
    output_tokens: Count | None


def use_of(exchange: ModelExchange, digest: Digest) -> ModelUse:
    """What is kept of an exchange whose record has this digest."""
    return ModelUse(
        model=f"{exchange.endpoint} ({exchange.model})"[:200],
        exchange=digest,
        seconds=exchange.seconds,
        cost=exchange.cost,
        currency=exchange.currency,
        input_tokens=exchange.input_tokens,
        output_tokens=exchange.output_tokens,
    )


class ModelAdvice(Value):
    """What a model said in one role about a mission, or about one of its nodes. It has no authority.

    `said` is the model's own text, or the stage or step that it named; empty where nothing usable came. `refused`: why
    it was not followed; empty for what was followed, or is only shown.
    """

    role: ModelRole
    node_id: NodeId | None
    said: Annotated[str, msgspec.Meta(max_length=1000)]
    use: ModelUse
    action: Annotated[str, msgspec.Meta(max_length=200)] = ""
    refused: Explanation = ""


@dataclass(frozen=True)
class ModelReply(Generic[T_co]):
    """An answer of the shape that was asked for. `digest` is of the exchange's record in the blob store."""

    value: T_co
    exchange: ModelExchange
    digest: Digest

    @property
    def use(self) -> ModelUse:
        return use_of(self.exchange, self.digest)


class ModelPort(Protocol):
    """One model in whatever role it is given. Every exchange is recorded, the refused ones too."""

    @property
    def name(self) -> str:
        """The endpoint's name and its model, as records and pages name who spoke."""

    @property
    def takes_images(self) -> bool: ...

    def ask(self, request: ModelRequest, shape: type[T]) -> ModelReply[T]:
        """Ask for JSON of `shape`, a msgspec type whose fields are all required; blocks for at most the time limit.

        Raises ModelUnreachable if no whole answer came, ModelAnswerInvalid for one that is too large, cut off, no JSON
        or of another shape, ModelFailed where it was not asked: no images taken, the cost limit reached.
        """


Models = Mapping[ModelRole, ModelPort]
"""The models in use, by role. What a role without one does is done deterministically."""


def question(role: ModelRole, *, instructions: str, text: str, images: Sequence[MessageImage] = ()) -> ModelRequest:
    """The usual request: the harness's instructions, then one message with the data and the images."""
    return ModelRequest(
        role=role,
        messages=(
            ModelMessage(speaker="system", parts=(MessageText(text=instructions),)),
            ModelMessage(speaker="user", parts=(MessageText(text=text), *images)),
        ),
    )


def schema_of(shape: type) -> bytes:
    """The JSON schema of a shape as canonical JSON, every reference resolved within it."""
    return msgspec.json.encode(msgspec.json.schema(shape), order="deterministic")


def schema_digest(shape: type) -> Digest:
    return sha256(schema_of(shape))
