"""Pure: whether what was derived again is what is stored; the words of a sentence that an older release wrote aside."""

from typing import Any

import msgspec

from harness.contracts.values import encode


def same(derived: Any, stored: Any) -> bool:
    """Whether both are equal, verdicts and measured values included; a reason stands for any sentence in its place."""
    return encode(derived) == encode(stored) or _alike(msgspec.to_builtins(derived), msgspec.to_builtins(stored))


def _alike(derived: Any, stored: Any) -> bool:
    if isinstance(derived, dict) and isinstance(stored, dict):
        return derived.keys() == stored.keys() and all(_alike(derived[name], stored[name]) for name in derived)
    if isinstance(derived, list | tuple) and isinstance(stored, list | tuple):
        return len(derived) == len(stored) and all(_alike(*pair) for pair in zip(derived, stored, strict=True))
    if isinstance(derived, dict) and isinstance(stored, str):
        return derived.keys() == {"code", "facts"}
    return bool(derived == stored)
