"""Answers to what is asked with every request, remembered until anybody writes, in this process or another."""

import sqlite3
from collections.abc import Callable
from typing import Any, TypeVar

KEPT = 4096
Answer = TypeVar("Answer")


class QueryCache:
    """Over one connection. Not safe between threads by itself: its owner's lock covers every call.

    SQLite counts, for a connection, what all others have committed (`PRAGMA data_version`); what this one commits its
    owner tells by `forget`.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._version = -1
        self._answers: dict[tuple[str, str], Any] = {}

    def answer(self, question: tuple[str, str], ask: Callable[[], Answer]) -> Answer:
        """What `ask` answers, or answered since the last commit. Raises sqlite3.Error if the connection is no more."""
        version: int = self._connection.execute("PRAGMA data_version").fetchone()[0]
        if version != self._version or len(self._answers) >= KEPT:
            self.forget()
            self._version = version
        if question not in self._answers:
            self._answers[question] = ask()
        found: Answer = self._answers[question]
        return found

    def forget(self) -> None:
        """After every commit of the owner's."""
        self._answers.clear()
