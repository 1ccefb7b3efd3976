"""An anchor: the head of the log at one instant, kept elsewhere to compare the log with later; perhaps signed."""

from typing import Literal

from harness.contracts.ids import Digest
from harness.contracts.reasons import Reason
from harness.contracts.values import Count, Value

FORMAT = "regenharness-anchor/1"


class Anchor(Value, omit_defaults=True):
    """`at_s` is wall time in seconds; unset in an anchor that was only written down as position and digest.

    `signature` is Ed25519 over `signed_bytes`; key and signature in hexadecimal, empty where nobody signed.
    """

    position: Count
    digest: Digest
    at_s: float = 0.0
    public_key: str = ""
    signature: str = ""


class AnchorFinding(Value):
    """How the log compares with one anchor. `reason` is why it does not fit; None where it matches.

    `signed` says whether a valid signature by `public_key` stands on it, `trusted` whether that is the key asked for.
    """

    position: Count
    digest: Digest
    verdict: Literal["matches", "cut", "rewritten", "unsigned"]
    public_key: str = ""
    signed: bool = False
    trusted: bool = False
    reason: Reason | None = None
