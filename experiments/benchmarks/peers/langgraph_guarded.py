"""Runs LangGraph with this project's guarantees written by hand around each node, so that equal work is compared.

A node takes a lease with a fencing token and writes its intent before the provider starts; a start is done once for a
request; the bytes that a result names are read and hashed again; verdict, result and release are one commit. Each of
these is a record in a hash chain. Both commits are synced, and so are LangGraph's own checkpoints.
"""

import hashlib
import json
import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any, TypedDict

from langgraph.checkpoint.sqlite import SqliteSaver
from langgraph.graph import END, START, StateGraph

from experiments.benchmarks.turns import STAGES, mission_turns, pragmas, serve

GOAL = b"Do nothing, seven times, and prove it"
CREATE = """
CREATE TABLE lease (resource TEXT PRIMARY KEY, holder TEXT, token INTEGER NOT NULL);
CREATE TABLE start (request TEXT PRIMARY KEY, token INTEGER NOT NULL, receipt TEXT);
CREATE TABLE fact (request TEXT PRIMARY KEY, verdict TEXT NOT NULL, evidence TEXT NOT NULL);
CREATE TABLE audit (position INTEGER PRIMARY KEY, previous TEXT NOT NULL, body TEXT NOT NULL, digest TEXT NOT NULL);
"""


class GuardedThread(TypedDict):
    """The state of one thread."""

    number: int
    out: dict[str, Any]


class HandWrittenGuarantees:
    """Leases, starts, accepted facts and the audit chain, in a database beside LangGraph's."""

    def __init__(self, folder: Path) -> None:
        self.connection = sqlite3.connect(folder / "guarantees.db", isolation_level=None, check_same_thread=False)
        self.connection.execute("PRAGMA journal_mode=WAL")
        self.connection.execute("PRAGMA synchronous=FULL")
        self.connection.executescript(CREATE)
        self._one_at_a_time = Lock()
        self._evidence = folder / hashlib.sha256(GOAL).hexdigest()
        self._evidence.write_bytes(GOAL)

    def intend(self, request: str, resource: str) -> int | None:
        """Take the lease and write the intent; the lease's token, or None if the request was started before."""
        with self._transaction():
            if self.connection.execute("SELECT 1 FROM start WHERE request = ?", (request,)).fetchone():
                return None
            row = self.connection.execute("SELECT holder, token FROM lease WHERE resource = ?", (resource,)).fetchone()
            if row is not None and row[0] is not None:
                raise RuntimeError(f"{resource} is held by {row[0]}")
            token = 1 if row is None else row[1] + 1
            self.connection.execute("INSERT OR REPLACE INTO lease VALUES (?, ?, ?)", (resource, request, token))
            self.connection.execute("INSERT INTO start VALUES (?, ?, NULL)", (request, token))
            self._record(kind="intent", request=request, resource=resource, token=token)
        return token

    def provide(self, request: str, token: int) -> str:
        """What the no-op provider answers: a receipt that names the bytes which it rests on."""
        return self._evidence.name

    def accept(self, request: str, resource: str, token: int, receipt: str) -> dict[str, Any]:
        """Judge the receipt by its bytes, and commit what was judged if the lease is still this request's."""
        body = (self._evidence.parent / receipt).read_bytes()
        digest = hashlib.sha256(body).hexdigest()
        verdict = "satisfied" if digest == receipt == hashlib.sha256(GOAL).hexdigest() else "violated"
        with self._transaction():
            held = self.connection.execute("SELECT holder, token FROM lease WHERE resource = ?", (resource,)).fetchone()
            if held != (request, token):
                raise RuntimeError(f"{request} no longer holds {resource}")
            self.connection.execute("UPDATE start SET receipt = ? WHERE request = ?", (receipt, request))
            self.connection.execute("INSERT INTO fact VALUES (?, ?, ?)", (request, verdict, digest))
            self.connection.execute("UPDATE lease SET holder = NULL WHERE resource = ?", (resource,))
            self._record(kind="verdict", request=request, verdict=verdict, evidence=digest)
        if verdict != "satisfied":
            raise RuntimeError(f"{request} is {verdict}")
        return {"request": request, "verdict": verdict, "evidence": digest}

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._one_at_a_time:
            self.connection.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                self.connection.execute("ROLLBACK")
                raise
            self.connection.execute("COMMIT")

    def _record(self, **facts: Any) -> None:
        newest = "SELECT position, digest FROM audit ORDER BY position DESC LIMIT 1"
        position, previous = self.connection.execute(newest).fetchone() or (0, "")
        body = json.dumps(facts, sort_keys=True)
        digest = hashlib.sha256(f"{position + 1}\n{previous}\n{body}".encode()).hexdigest()
        self.connection.execute("INSERT INTO audit VALUES (?, ?, ?, ?)", (position + 1, previous, body, digest))


def _stage(guarantees: HandWrittenGuarantees, place: int) -> Callable[[GuardedThread], dict[str, Any]]:
    def stage(state: GuardedThread) -> dict[str, Any]:
        request, resource = f"{state['number']}/{place}/1", f"robot-{state['number']}"
        token = guarantees.intend(request, resource)
        if token is None:
            raise RuntimeError(f"{request} was started before: its outcome has to be looked up")
        receipt = guarantees.provide(request, token)
        return {"out": guarantees.accept(request, resource, token, receipt)}

    return stage


def _missions(saver: SqliteSaver, guarantees: HandWrittenGuarantees) -> Callable[[int], None]:
    graph = StateGraph(GuardedThread)
    previous = START
    for place in range(STAGES):
        graph.add_node(f"n{place}", _stage(guarantees, place))
        graph.add_edge(previous, f"n{place}")
        previous = f"n{place}"
    graph.add_edge(previous, END)
    compiled = graph.compile(checkpointer=saver)

    def mission(number: int) -> None:
        config = {"configurable": {"thread_id": str(number)}}
        compiled.invoke({"number": number, "out": {}}, config, durability="sync")

    return mission


def main() -> None:
    """Argument: the folder for both databases."""
    folder = Path(sys.argv[1])
    connection = sqlite3.connect(folder / "langgraph.db", check_same_thread=False)
    saver = SqliteSaver(connection)
    saver.setup()
    guarantees = HandWrittenGuarantees(folder)
    serve(
        mission_turns(_missions(saver, guarantees)),
        name="LangGraph, sync, with lease, evidence, one start and audit by hand",
        packages=("langgraph", "langgraph-checkpoint-sqlite"),
        durability={"checkpoints": pragmas(connection), "guarantees": pragmas(guarantees.connection)},
    )


if __name__ == "__main__":
    main()
