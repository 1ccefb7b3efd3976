"""Compares the log with anchors that were kept elsewhere, to find out whether it was truncated or rewritten since."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, Protocol

import msgspec

from harness.adapters.stores import anchors
from harness.adapters.stores.chain import GENESIS
from harness.contracts.anchors import Anchor, AnchorFinding
from harness.contracts.ports import LogHead, StoredEvent
from harness.contracts.reasons import Reason, because
from harness.contracts.values import encode


class AnchoredLog(Protocol):
    """What is compared: where it ends, and its events after a position."""

    def head(self) -> LogHead: ...

    def log(self, after: int = 0, limit: int = 1000) -> list[StoredEvent]: ...


def taken_anchor(log: AnchoredLog, *, key_file: Path | None = None) -> Anchor:
    """The head of the log now, signed with the key in that file if one is given. Raises StoreUnavailable."""
    return anchors.anchor_of(log.head(), anchors.anchor_key(key_file) if key_file else None)


def anchor_line(anchor: Anchor) -> str:
    """The line that is kept: position and digest, or JSON for a signed anchor."""
    return encode(anchor).decode() if anchor.signature else f"{anchor.position} {anchor.digest}"


def append_line(anchor: Anchor, file: Path) -> None:
    """Add an anchor to a file of anchors. Raises StoreUnavailable."""
    anchors.append_anchor(file, anchor)


def compared_with_file(log: AnchoredLog, file: Path, *, key: str = "") -> tuple[AnchorFinding, ...]:
    """As `compared`, with the anchors of a file. Raises ContractInvalid, StoreUnavailable."""
    return compared(log, anchors.read_anchors(file), key=key)


def compared_with_text(log: AnchoredLog, text: str, *, key: str = "") -> tuple[AnchorFinding, ...]:
    """As `compared`, with the anchors of a text. Raises ContractInvalid."""
    return compared(log, anchors.parsed_anchors(text), key=key)


def compared(log: AnchoredLog, given: Sequence[Anchor], *, key: str = "") -> tuple[AnchorFinding, ...]:
    """One finding for each anchor. `key`: the public key that must have signed it, in hexadecimal.

    An anchor proves all events up to its position only together with `verify`, which recomputes the chain.
    """
    return tuple(_compared(log, anchor, key.strip().lower()) for anchor in given)


def _compared(log: AnchoredLog, anchor: Anchor, key: str) -> AnchorFinding:
    signed = bool(anchor.signature) and anchors.signature_holds(anchor)
    trusted = signed and bool(key) and anchor.public_key.lower() == key
    found = AnchorFinding(
        position=anchor.position,
        digest=anchor.digest,
        verdict="matches",
        public_key=anchor.public_key if signed else "",
        signed=signed,
        trusted=trusted,
    )
    if anchor.signature and not signed:
        return _wrong(found, "unsigned", because("anchor_signature_invalid", position=anchor.position))
    if key and not trusted:
        return _wrong(found, "unsigned", because("anchor_other_key", position=anchor.position))
    head = log.head()
    if head.position < anchor.position:
        missing = anchor.position - head.position
        return _wrong(
            found, "cut", because("anchor_beyond_log", position=anchor.position, head=head.position, missing=missing)
        )
    if _digest_at(log, anchor.position) != anchor.digest:
        return _wrong(found, "rewritten", because("anchor_differs", position=anchor.position))
    return found


def _wrong(found: AnchorFinding, verdict: Literal["cut", "rewritten", "unsigned"], reason: Reason) -> AnchorFinding:
    return msgspec.structs.replace(found, verdict=verdict, reason=reason)


def _digest_at(log: AnchoredLog, position: int) -> str:
    if position == 0:
        return GENESIS.digest
    events = log.log(position - 1, 1)
    return events[0].digest if events and events[0].position == position else ""
