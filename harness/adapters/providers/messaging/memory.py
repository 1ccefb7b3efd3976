"""Holds messages in this process's memory, for suites in virtual time."""

from collections.abc import Sequence

from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because


class MemoryOutbox:
    """MessageOutbox without a disk: idempotent by key, like every other."""

    def __init__(self) -> None:
        self._sent: dict[str, tuple[str, tuple[Digest, ...]]] = {}

    def send(self, key: str, text: str, images: Sequence[Digest]) -> str:
        """Raises ProviderFailed for a key that came before with other contents."""
        message = (text, tuple(images))
        if self._sent.setdefault(key, message) != message:
            raise ProviderFailed(because("message_sent_otherwise", key=key))
        return f"ack-{sha256(key.encode())[:16]}"

    def held(self, key: str) -> tuple[str, Sequence[Digest]] | None:
        """The message of this key, or None."""
        return self._sent.get(key)
