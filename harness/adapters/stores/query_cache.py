"""Caches the answers to queries made with every request, until this process or another one writes."""

import sqlite3
from collections.abc import Callable
from typing import Any, TypeVar

KEPT = 4096
Answer = TypeVar("Answer")


class QueryCache:
    """A cache over one connection. Not safe between threads by itself: its owner's lock covers every call.

    SQLite counts, for a connection, what all others have committed (`PRAGMA data_version`); its
    own commits are reported by `forget`.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._version = -1
        self._answers: dict[tuple[str, str], Any] = {}

    def answer(self, question: tuple[str, str], ask: Callable[[], Answer]) -> Answer:
        """The result of `ask`, cached since the last commit. Raises sqlite3.Error if the connection is closed."""
        version: int = self._connection.execute("PRAGMA data_version").fetchone()[0]
        if version != self._version or len(self._answers) >= KEPT:
            self.forget()
            self._version = version
        if question not in self._answers:
            self._answers[question] = ask()
        found: Answer = self._answers[question]
        return found

    def forget(self) -> None:
        """Called after every commit of the owner."""
        self._answers.clear()
