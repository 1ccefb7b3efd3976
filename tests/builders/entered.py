"""Records which functions of the project are entered, in order and in every thread, while a test runs something."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import CodeType, FrameType

from tests.architecture.sources import ROOT

_PLACES = tuple(f"{ROOT / folder}/" for folder in ("app", "harness"))


@contextmanager
def entered() -> Iterator[list[str]]:
    """`path.py:Qualified.name` of each call of a function in `app` or `harness`, in the order of the calls.

    Recorded are this thread and those that begin meanwhile. A function that another one made counts as a call of its
    maker: `_route` for `_route.<locals>.act`.
    """
    found: list[str] = []
    known: dict[CodeType, str] = {}

    def note(frame: FrameType, _event: str, _argument: object) -> None:
        code = frame.f_code
        name = known.get(code)
        if name is None:
            ours = code.co_filename.startswith(_PLACES)
            name = known[code] = _named(code) if ours else ""
        if name:
            found.append(name)

    before, before_threads = sys.gettrace(), threading.gettrace()
    threading.settrace(note)
    sys.settrace(note)
    try:
        yield found
    finally:
        sys.settrace(before)
        threading.settrace(before_threads)


def _named(code: CodeType) -> str:
    return f"{code.co_filename[len(str(ROOT)) + 1 :]}:{code.co_qualname.partition('.<locals>')[0]}"
