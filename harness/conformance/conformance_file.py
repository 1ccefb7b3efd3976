"""Reads a provider's conformance file: sample requests, the rows it meets, and its exemptions with reasons."""

import base64
import binascii
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import msgspec

from harness.adapters.plain_files import plain_text
from harness.contracts.effects import AnyEffect
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.protocol import Parameters, ParameterValue
from harness.contracts.reasons import because
from harness.contracts.values import Name, Value
from harness.workspace.contract_yaml import read_yaml

LONGEST_BYTES = 4 * 2**20
_SHIPPED = files("harness.baseline").joinpath("conformance")


class ConformanceFile(Value):
    """One conformance file.

    `done`: parameters of requests that end as succeeded. `long`: of requests that are under way for 5 s or more, or
    that wait for a poll. Of several, the one whose `target` lies farthest from the robot is used, so that there is
    some distance to cover. A string `@name` stands for the digest of the blob of that name (base64 in the file).
    `effects` are what a request of `done` brings about, and so what its last report must propose; a request with a
    `target` and a `frame` needs none: it brings about the arrival there. A provider that only `estimates` brings about
    nothing, and the kit holds it to proposing nothing.
    """

    provider_id: ProviderId
    done: tuple[Parameters, ...]
    long: tuple[Parameters, ...]
    meets: tuple[Name, ...]
    exempt: dict[str, Name] = msgspec.field(default_factory=dict)
    blobs: dict[str, str] = msgspec.field(default_factory=dict)
    effects: tuple[AnyEffect, ...] = ()
    estimates: bool = False


def shipped(provider_id: ProviderId) -> ConformanceFile:
    """The conformance file that ships for an installed provider. Raises UnknownName."""
    entry = _SHIPPED.joinpath(f"{provider_id}.yaml")
    if not entry.is_file():
        raise UnknownName(
            because("no_conformance_file", provider_id=provider_id),
            where=str(provider_id),
        )
    return _checked(entry.read_text(encoding="utf-8"), where=f"baseline/conformance/{provider_id}.yaml")


def read(path: Path) -> ConformanceFile:
    """A conformance file from the disk. Raises ContractInvalid that names the place in it."""
    try:
        text = plain_text(path, most_bytes=LONGEST_BYTES)
    except (OSError, UnicodeDecodeError) as error:
        raise ContractInvalid(because("conformance_file_unreadable", error=str(error)), where=str(path)) from error
    return _checked(text, where=str(path))


def filled(parameters: Parameters, blobs: dict[str, Digest]) -> Parameters:
    """Parameters with every `@name` replaced by the digest of that blob."""
    return {name: _filled(value, blobs) for name, value in parameters.items()}


def store_blobs(declaration: ConformanceFile, keep: Callable[[bytes], Digest]) -> dict[str, Digest]:
    """Store the file's blobs where the provider finds them."""
    return {name: keep(_bytes(text)) for name, text in declaration.blobs.items()}


def _filled(value: ParameterValue, blobs: dict[str, Digest]) -> ParameterValue:
    if isinstance(value, str):
        return blobs.get(value.removeprefix("@"), value) if value.startswith("@") else value
    if isinstance(value, tuple):
        return tuple(blobs.get(part[1:], part) if isinstance(part, str) and part[:1] == "@" else part for part in value)
    return value


def _bytes(text: str) -> bytes:
    """Base64 on one line or on many."""
    return base64.b64decode("".join(text.split()), validate=True)


def _checked(text: str, *, where: str) -> ConformanceFile:
    declaration = read_yaml(text, ConformanceFile, where=where, foreign=True)
    if not declaration.done or not declaration.long:
        raise ContractInvalid(because("conformance_file_without_request"), where=where)
    both = sorted(set(declaration.meets) & set(declaration.exempt))
    if both:
        raise ContractInvalid(because("conformance_rows_twice", rows=tuple(both)), where=where)
    for name, body in declaration.blobs.items():
        try:
            _bytes(body)
        except (ValueError, binascii.Error) as error:
            raise ContractInvalid(because("conformance_blob_invalid", name=name), where=where) from error
    return declaration
