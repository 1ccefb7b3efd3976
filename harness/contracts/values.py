"""The common base of every stored value: frozen, extras forbidden, typed on decoding.

Instants of mission time are `_s` on the robot's clock (seconds since the Unix epoch, D7); instants of wall time are
`_at_s`, seconds since the Unix epoch too. A `Moment` carries both.
"""

from typing import Annotated, Any, TypeVar, dataclass_transform

import msgspec

from harness.contracts.ids import Digest, sha256

T = TypeVar("T")


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(msgspec.field,))
class Value(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, gc=False):
    """Base of all contracts. Decoding checks types and bounds and names the path that broke them.

    Python's garbage collector does not track values: frozen, and made of values and plain containers, none is in a
    cycle.
    """


class Moment(Value):
    """One instant on both clocks (D7). Mission time decides freshness, wall time decides about people."""

    mission_s: float
    wall_s: float


LATEST_TIME_S = 253_402_300_799.0
"""The end of the year 9999: what is later has no date."""
MissionTime = Annotated[float, msgspec.Meta(ge=0, le=LATEST_TIME_S)]
Positive = Annotated[float, msgspec.Meta(gt=0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Count = Annotated[int, msgspec.Meta(ge=0)]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
Point = tuple[float, float]

_encoder = msgspec.json.Encoder(order="deterministic")
_sorting_encoder = msgspec.json.Encoder(order="sorted")


def encode(value: Any) -> bytes:
    """Canonical JSON: keys in a fixed order, no spaces. The same value gives the same bytes."""
    return _encoder.encode(value)


def raw(value: Any) -> msgspec.Raw:
    """The value as JSON that stands in another value as it is: all keys sorted, as if it had been read back before."""
    return msgspec.Raw(_sorting_encoder.encode(value))


def decode(body: bytes, kind: type[T]) -> T:
    """Strict JSON of `kind`; raises msgspec.ValidationError that names the path."""
    return msgspec.json.decode(body, type=kind)


def digest(value: Any) -> Digest:
    """SHA-256 over the canonical JSON of a value."""
    return sha256(encode(value))
