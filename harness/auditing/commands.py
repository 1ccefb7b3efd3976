"""Reads the command that a group of a stream's events answered, as stored with its commit (D58)."""

from collections.abc import Iterable, Sequence
from typing import Any

from harness.contracts.errors import HarnessError
from harness.contracts.ids import sha256
from harness.contracts.ports import StoredEvent
from harness.contracts.reasons import Reason, because, plain
from harness.contracts.stored_commands import TOKENS, command_json, command_of, stored_command
from harness.contracts.values import decode
from harness.runtime import Runtime

MOST_EVENTS = 16
"""No command leads to more events of one stream."""


class CommandUnreadable(Exception):
    """The command that an event names is missing, was changed or refers to something missing; `reason` says which."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(plain(reason))
        self.reason = reason


def command_at(runtime: Runtime, tail: Sequence[StoredEvent], union: Any, *, tokens: Iterable[str] = ()) -> Any | None:
    """The stored command, one of `union`, whose events `tail` begins with; None where no event names one.

    `tokens` are the claim tokens and keys that it may mean. Raises CommandUnreadable.
    """
    digest = command_of(tail[0])
    if digest is None:
        return None
    try:
        body = runtime.record(digest).body
        if sha256(body) != digest:
            raise CommandUnreadable(because("audited_command_changed", digest=digest[:12], found=sha256(body)[:12]))
        stored = stored_command(body)
        records = {name: runtime.record(name).body for name in stored.records.values()}
        events = [one.body for one in tail[:MOST_EVENTS]]
        return decode(command_json(stored, events, records, tokens), union)
    except (HarnessError, LookupError, TypeError, ValueError) as error:
        what = error.located if isinstance(error, HarnessError) else str(error)
        raise CommandUnreadable(because("audited_command_unreadable", digest=digest[:12], error=what)) from error


def tokens_in(event: Any) -> list[str]:
    """The claim token and the key that an event contains."""
    return [token for name in TOKENS if isinstance(token := getattr(event, name, None), str)]
