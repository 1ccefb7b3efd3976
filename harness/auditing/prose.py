"""Compares values derived again with stored ones, ignoring sentences that an older release wrote. Pure."""

from collections.abc import Iterable
from typing import Any

import msgspec

from harness.contracts.reasons import RECORDED
from harness.contracts.values import encode


def is_old(bodies: Iterable[bytes]) -> bool:
    """Whether a stream was written before reasons were codes and facts: no body holds one."""
    return not any(b'"code":' in body and b'"facts":' in body for body in bodies)


def same(derived: Any, stored: Any, *, old: bool) -> bool:
    """Whether both are equal; in an old stream a reason matches any sentence in its place."""
    if encode(derived) == encode(stored):
        return True
    return old and _alike(msgspec.to_builtins(derived), msgspec.to_builtins(stored))


def _alike(derived: Any, stored: Any) -> bool:
    if isinstance(stored, dict) and stored.get("code") == RECORDED:
        return isinstance(derived, dict) and derived.keys() == {"code", "facts"}
    if isinstance(derived, dict) and isinstance(stored, dict):
        return derived.keys() == stored.keys() and all(_alike(derived[name], stored[name]) for name in derived)
    if isinstance(derived, list | tuple) and isinstance(stored, list | tuple):
        return len(derived) == len(stored) and all(_alike(*pair) for pair in zip(derived, stored, strict=True))
    if isinstance(derived, dict) and isinstance(stored, str):
        return derived.keys() == {"code", "facts"}
    return bool(derived == stored)
