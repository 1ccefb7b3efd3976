"""Runs the peer LangGraph on its SQLite saver, durability="sync": seven no-op nodes per thread, or interrupt
and resume.
"""

import sqlite3
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypedDict

from langgraph.checkpoint.sqlite import SqliteSaver
from langgraph.graph import END, START, StateGraph
from langgraph.types import Command, interrupt

from experiments.benchmarks.turns import STAGES, mission_turns, pragmas, serve


class ThreadState(TypedDict):
    """The state of one thread."""

    number: int
    out: dict[str, Any]


def _stage(place: int) -> Callable[[ThreadState], dict[str, Any]]:
    def stage(state: ThreadState) -> dict[str, Any]:
        return {"out": {"step": place, "ok": True}}

    return stage


def _missions(saver: SqliteSaver) -> Callable[[int], None]:
    graph = StateGraph(ThreadState)
    previous = START
    for place in range(STAGES):
        graph.add_node(f"n{place}", _stage(place))
        graph.add_edge(previous, f"n{place}")
        previous = f"n{place}"
    graph.add_edge(previous, END)
    compiled = graph.compile(checkpointer=saver)

    def mission(number: int) -> None:
        config = {"configurable": {"thread_id": str(number)}}
        compiled.invoke({"number": number, "out": {}}, config, durability="sync")

    return mission


def _approvals(saver: SqliteSaver) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Turns {approvals}: seconds from the resuming call to the first line of the next node, each."""
    started: dict[int, float] = {}

    def ask(state: ThreadState) -> dict[str, Any]:
        return {"out": {"ok": interrupt("approve?")}}

    def following(state: ThreadState) -> dict[str, Any]:
        started[state["number"]] = time.perf_counter()
        return {}

    graph = StateGraph(ThreadState)
    graph.add_node("ask", ask)
    graph.add_node("following", following)
    graph.add_edge(START, "ask")
    graph.add_edge("ask", "following")
    graph.add_edge("following", END)
    compiled = graph.compile(checkpointer=saver)

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        waits = []
        for _ in range(request["approvals"]):
            number = len(started)
            config = {"configurable": {"thread_id": str(number)}}
            compiled.invoke({"number": number, "out": {}}, config, durability="sync")
            approved = time.perf_counter()
            compiled.invoke(Command(resume=True), config, durability="sync")
            waits.append(started[number] - approved)
        return {"waits_s": waits}

    return turn


def main() -> None:
    """Arguments: the folder for the database, and `missions` or `approvals`."""
    connection = sqlite3.connect(Path(sys.argv[1]) / "langgraph.db", check_same_thread=False)
    saver = SqliteSaver(connection)
    saver.setup()
    serve(
        mission_turns(_missions(saver)) if sys.argv[2] == "missions" else _approvals(saver),
        name="LangGraph, SQLite saver, sync",
        packages=("langgraph", "langgraph-checkpoint-sqlite"),
        durability=pragmas(connection),
    )


if __name__ == "__main__":
    main()
