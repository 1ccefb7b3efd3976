"""Signs, reads and writes anchors: one JSON object a line, in a file that lies outside the data folder."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from logging import getLogger
from pathlib import Path
from threading import Event, Thread

import msgspec
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from harness.adapters.clock import SystemClock
from harness.contracts.anchors import FORMAT, Anchor
from harness.contracts.errors import ContractInvalid, HarnessError, StoreUnavailable
from harness.contracts.ids import Digest
from harness.contracts.ports import LogHead
from harness.contracts.reasons import because
from harness.contracts.values import encode

LOG = getLogger(__name__)
LARGEST_TEXT = 4 * 2**20
LOOKED_EVERY_S = 2.0
_DIGEST_LENGTH = 64


def signed_bytes(anchor: Anchor) -> bytes:
    """What the signature covers: canonical JSON of format, position, digest and time."""
    return encode([FORMAT, anchor.position, anchor.digest, anchor.at_s])


def anchor_of(head: LogHead, key: Ed25519PrivateKey | None = None) -> Anchor:
    """An anchor of now; signed where there is a key."""
    anchor = Anchor(position=head.position, digest=head.digest, at_s=round(SystemClock().now().wall_s, 3))
    if key is None:
        return anchor
    public = key.public_key().public_bytes_raw().hex()
    return msgspec.structs.replace(anchor, public_key=public, signature=key.sign(signed_bytes(anchor)).hex())


def signature_holds(anchor: Anchor) -> bool:
    """Whether its signature is valid for the key that it names; False for one without a signature."""
    try:
        key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(anchor.public_key))
        key.verify(bytes.fromhex(anchor.signature), signed_bytes(anchor))
    except (InvalidSignature, ValueError):
        return False
    return True


def anchor_key(file: Path) -> Ed25519PrivateKey:
    """An Ed25519 private key: PEM (`openssl genpkey -algorithm ed25519`) or its 32 bytes. Raises StoreUnavailable."""
    try:
        body = file.read_bytes()
        if len(body) == 32:
            return Ed25519PrivateKey.from_private_bytes(body)
        key = load_pem_private_key(body, password=None)
        if isinstance(key, Ed25519PrivateKey):
            return key
        problem = "it is not an Ed25519 key"
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        problem = str(error)
    raise StoreUnavailable(because("anchor_key_unusable", error=problem), where=str(file))


def parsed_anchors(text: str, *, where: str = "") -> tuple[Anchor, ...]:
    """Every anchor of a text: JSON, or position and digest, one a line. Raises ContractInvalid for any other line."""
    lines = [line.strip() for line in text.lstrip("\ufeff").splitlines()]
    found = tuple(_anchor(line, where) for line in lines if line)
    if not found:
        raise ContractInvalid(because("anchor_unreadable", line=""), where=where)
    return found


def read_anchors(file: Path) -> tuple[Anchor, ...]:
    """The anchors of a file. Raises ContractInvalid, StoreUnavailable."""
    try:
        with file.open("rb") as opened:
            body = opened.read(LARGEST_TEXT + 1)
    except OSError as error:
        raise StoreUnavailable(
            because("anchor_file_unusable", error=error.strerror or str(error)), where=str(file)
        ) from error
    if len(body) > LARGEST_TEXT:
        raise ContractInvalid(because("anchor_file_too_large", limit_mib=LARGEST_TEXT // 2**20), where=str(file))
    return parsed_anchors(body.decode(errors="replace"), where=str(file))


def append_anchor(file: Path, anchor: Anchor) -> None:
    """Add one line, synced. Raises StoreUnavailable."""
    try:
        with file.open("ab") as opened:
            opened.write(encode(anchor) + b"\n")
            opened.flush()
            os.fsync(opened.fileno())
    except OSError as error:
        raise StoreUnavailable(
            because("anchor_file_unusable", error=error.strerror or str(error)), where=str(file)
        ) from error


@contextmanager
def anchoring(head: Callable[[], LogHead], file: Path, *, every: int, key: Ed25519PrivateKey | None) -> Iterator[None]:
    """Until the block ends, write an anchor when `every` events came since the last one, and one at the end.

    A file that cannot be written is logged and tried again; the log never waits for it. Raises StoreUnavailable where
    it cannot be written at the beginning.
    """
    append_anchor(file, anchor_of(head(), key))
    ended, last = Event(), [head().position]

    def write(least: int) -> None:
        try:
            now = head()
            if now.position - last[0] >= least:
                append_anchor(file, anchor_of(now, key))
                last[0] = now.position
        except HarnessError as error:
            LOG.error("anchor_unwritten file=%s error=%s", file, error)

    def watch() -> None:
        while not ended.wait(LOOKED_EVERY_S):
            write(every)

    thread = Thread(target=watch, name="regen-anchors", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        write(1)


def _anchor(line: str, where: str) -> Anchor:
    try:
        if line.startswith("{"):
            return msgspec.json.decode(line, type=Anchor)
        position, digest = line.split()
        if int(position) >= 0 and len(digest) == _DIGEST_LENGTH and int(digest, 16) >= 0:
            return Anchor(position=int(position), digest=Digest(digest))
    except (msgspec.DecodeError, ValueError):
        pass
    raise ContractInvalid(because("anchor_unreadable", line=line[:120]), where=where)
