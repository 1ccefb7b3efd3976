"""Runs a parser of foreign bytes in a process of its own, with limits on memory, time and output.

The work is a function of a module, bytes in and bytes out, which the child imports by name:

    def decoded(request: bytes) -> bytes: ...          # may raise a HarnessError of its own
    answer = run_limited(decoded, body, LIMITS, failure=RecordingInvalid, where=str(file))

For many small requests (camera images) keep one `LimitedProcess`: it starts at the first request, serves one at a time,
and is replaced after a request that exceeded a limit. The child gets no secrets: its environment is a few names.
"""

import os
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock, Timer
from weakref import finalize

import msgspec

from harness.adapters.process_priority import give_way
from harness.contracts import errors
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.values import Value, decode

Work = Callable[[bytes], bytes]

READY, ANSWERED, REFUSED, FAILED, OUT_OF_MEMORY, TOO_LARGE = b"R", b"A", b"E", b"F", b"M", b"O"
"""The first byte of what a child sends: it is up; an answer; a typed error; any other exception; a limit."""
LENGTH = struct.Struct(">Q")
MOST_OF_A_REASON = 64 * 1024

_CHILD = "harness.adapters.limited_child"
_STARTING_S = 60.0
_DYING_S = 1.0
_NEEDED = ("PATH", "LANG", "LC_ALL", "TMPDIR")
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
"""Libraries that reserve address space for each thread; one is enough here, and it counts against the limit."""


@dataclass(frozen=True)
class Limits:
    """What one request may use. `memory_bytes` is address space beyond the program with its libraries.

    `cpu_s` is processor time, `wall_s` the longest wait; `output_bytes` bounds the answer and any file it writes.
    """

    memory_bytes: int
    cpu_s: float
    wall_s: float
    output_bytes: int


class ParserProblem(Value):
    """A typed error of the work, as it comes back from the child."""

    kind: str
    what: Explanation
    where: Explanation
    do: Explanation


class LimitedProcess:
    """One child for many requests to `work`. Safe between threads: they wait for each other.

    `failure` is the error that is raised when a limit is exceeded, the child dies, or the work raises anything but a
    HarnessError of the contracts.
    """

    def __init__(self, work: Work, limits: Limits, *, failure: type[HarnessError] = ContractInvalid) -> None:
        self._work = f"{work.__module__}:{work.__qualname__}"
        self._limits = limits
        self._failure = failure
        self._children: list[subprocess.Popen[bytes]] = []
        self._lock = Lock()
        finalize(self, _end_all, self._children)

    def run(self, request: bytes, *, where: str = "") -> bytes:
        """The answer of the work. Raises the HarnessError that the work raised, or `failure` with the reason."""
        with self._lock:
            try:
                status, body = self._exchanged(request)
            except BaseException:
                _end_all(self._children)
                raise
            if status not in (ANSWERED, REFUSED):
                ended = _end_all(self._children, grace_s=0.0 if status else _DYING_S)
                raise self._failure(self._reason(status, body, ended), where=where)
        if status == REFUSED:
            raise self._raised(body, where)
        return body

    def close(self) -> None:
        """End the child. A later request starts another one."""
        with self._lock:
            _end_all(self._children)

    def _exchanged(self, request: bytes) -> tuple[bytes, bytes]:
        """Status and body; no status where the child did not answer in time or died."""
        if self._children and self._children[0].poll() is not None:  # it ended between two requests
            _end_all(self._children)
        child = self._children[0] if self._children else self._started()
        assert child.stdin is not None and child.stdout is not None
        with _killed_after(self._limits.wall_s, child), suppress(BrokenPipeError):
            child.stdin.write(LENGTH.pack(len(request)) + request)
            child.stdin.flush()
            front = child.stdout.read(1 + LENGTH.size)
            if len(front) < 1 + LENGTH.size:
                return b"", b""
            status, length = front[:1], LENGTH.unpack(front[1:])[0]
            if length > (self._limits.output_bytes if status == ANSWERED else MOST_OF_A_REASON):
                return TOO_LARGE, b""
            body = child.stdout.read(length)
            return (status, body) if len(body) == length else (b"", b"")
        return b"", b""

    def _started(self) -> subprocess.Popen[bytes]:
        """A child that is up, or that is about to end: the exchange shows which."""
        limits = self._limits
        numbers = (limits.memory_bytes, limits.cpu_s, limits.output_bytes)
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", _CHILD, self._work, *map(str, numbers)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=_environment(),
            start_new_session=True,
        )
        give_way(child.pid)
        self._children.append(child)
        assert child.stdout is not None
        with _killed_after(_STARTING_S, child):
            child.stdout.read(len(READY))
        return child

    def _reason(self, status: bytes, body: bytes, ended: int) -> Reason:
        limits = self._limits
        match status:
            case b"M":
                return because("parser_out_of_memory", memory_mib=limits.memory_bytes // 2**20)
            case b"O":
                return because("parser_output_too_large", output_mib=limits.output_bytes // 2**20)
            case b"F":
                return because("parser_failed", error=body.decode(errors="replace")[:300])
        if ended in (-signal.SIGXCPU, -signal.SIGKILL):
            return because("parser_out_of_time", cpu_s=limits.cpu_s, wall_s=limits.wall_s)
        return because("parser_died", code=ended)

    def _raised(self, body: bytes, where: str) -> HarnessError:
        try:
            problem = decode(body, ParserProblem)
        except msgspec.MsgspecError:
            return self._failure(because("parser_answer_unreadable"), where=where)
        kind = getattr(errors, problem.kind, None)
        known = kind if isinstance(kind, type) and issubclass(kind, HarnessError) else self._failure
        return known(problem.what, where=problem.where or where, do=problem.do)


def run_limited(
    work: Work, request: bytes, limits: Limits, *, failure: type[HarnessError] = ContractInvalid, where: str = ""
) -> bytes:
    """The answer of `work` from a child of its own, which then ends. Raises as `LimitedProcess.run` does."""
    with closing(LimitedProcess(work, limits, failure=failure)) as child:
        return child.run(request, where=where)


def _end_all(children: list[subprocess.Popen[bytes]], *, grace_s: float = 0.0) -> int:
    """End the child, if there is one, and wait for it; its exit code, negative for a signal.

    Within `grace_s` a child that closed its output may end by itself, so that the code says why it did.
    """
    if not children:
        return 0
    child = children.pop()
    with suppress(subprocess.TimeoutExpired):
        child.wait(timeout=grace_s)
    child.kill()
    code = child.wait()
    for pipe in (child.stdin, child.stdout):
        with suppress(OSError):
            if pipe is not None:
                pipe.close()
    return code


def _environment() -> dict[str, str]:
    root = Path(__file__).resolve().parents[2]
    environment = {name: os.environ[name] for name in _NEEDED if name in os.environ}
    return {**environment, **dict.fromkeys(_ONE_THREAD, "1"), "PYTHONPATH": str(root)}


@contextmanager
def _killed_after(seconds: float, child: subprocess.Popen[bytes]) -> Iterator[None]:
    """Kill the child if the block takes longer: reading from it then ends."""
    timer = Timer(seconds, child.kill)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
