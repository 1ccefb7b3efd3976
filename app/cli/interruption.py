"""Handles Ctrl-C during a run: the first ends the run after its current step, a second ends the program at once."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, current_thread, main_thread
from types import FrameType

EXIT = 130
"""The exit code of a command that Ctrl-C ended."""


@contextmanager
def interruptible() -> Iterator[Event]:
    """An event that Ctrl-C sets while the block runs; outside the main thread no signal arrives."""
    interrupted = Event()
    if current_thread() is not main_thread():
        yield interrupted
        return
    before = signal.getsignal(signal.SIGINT)

    def ask(number: int, frame: FrameType | None) -> None:
        interrupted.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    signal.signal(signal.SIGINT, ask)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)
