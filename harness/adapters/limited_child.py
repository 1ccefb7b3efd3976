"""The child of a limited process: imports one function, limits itself, and answers requests until its input ends.

Standard input and output carry the requests and answers; what a library prints goes nowhere.
"""

import errno
import math
import os
import resource
import sys
from importlib import import_module
from typing import BinaryIO

from harness.adapters import limited_process as protocol
from harness.contracts.errors import HarnessError
from harness.contracts.values import encode

MOST_FILES = 64


def main() -> int:
    """Answer requests. Arguments: MODULE:FUNCTION, bytes of memory, seconds of processor time, bytes of output."""
    name, memory_bytes, cpu_s, output_bytes = sys.argv[1:5]
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    module, _, function = name.partition(":")
    work: protocol.Work = getattr(import_module(module), function)
    limit(int(memory_bytes), int(output_bytes))
    answers.write(protocol.READY)
    answers.flush()
    while (request := _request(requests)) is not None:
        allow_time(float(cpu_s))
        status, body = answered(work, request, int(output_bytes))
        del request
        answers.write(status + protocol.LENGTH.pack(len(body)) + body)
        answers.flush()
    return 0


def limit(memory_bytes: int, output_bytes: int) -> None:
    """Bound this process from now on: address space beyond what it has, size of files, open files, no core."""
    bounds = {
        resource.RLIMIT_FSIZE: output_bytes,
        resource.RLIMIT_NOFILE: MOST_FILES,
        resource.RLIMIT_CORE: 0,
    }
    if (held := _address_space()) is not None:
        bounds[resource.RLIMIT_AS] = held + memory_bytes
    for name, bound in bounds.items():
        hard = resource.getrlimit(name)[1]
        value = bound if hard == resource.RLIM_INFINITY else min(bound, hard)
        resource.setrlimit(name, (value, value))


def allow_time(cpu_s: float) -> None:
    """Processor time for one more request; the kernel ends the process when it is used up."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    soft = math.ceil(used.ru_utime + used.ru_stime + cpu_s)
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def answered(work: protocol.Work, request: bytes, output_bytes: int) -> tuple[bytes, bytes]:
    """Status and body of one request."""
    try:
        answer = work(request)
    except HarnessError as error:
        problem = protocol.ParserProblem(
            kind=type(error).__name__, what=error.what, where=error.where, do=error.do or ""
        )
        body = encode(problem)
        return (protocol.REFUSED, body) if len(body) <= protocol.MOST_OF_A_REASON else (protocol.FAILED, b"")
    except Exception as error:  # noqa: BLE001 - whatever a parser raises is a refusal of these bytes
        if _of_memory(error):
            return protocol.OUT_OF_MEMORY, b""
        if isinstance(error, OSError) and error.errno == errno.EFBIG:
            return protocol.TOO_LARGE, b""
        message = next(iter(str(error).splitlines()), "")[:300]
        return protocol.FAILED, f"{type(error).__name__}: {message}".encode(errors="replace")
    return (protocol.ANSWERED, answer) if len(answer) <= output_bytes else (protocol.TOO_LARGE, b"")


def _of_memory(error: BaseException) -> bool:
    """Whether it, or what it was raised from, is a lack of memory; OpenCV has an error of its own for that."""
    lacking = isinstance(error, MemoryError) or "nsufficient memory" in str(error)
    lacking = lacking or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
    before = error.__cause__ or error.__context__
    return lacking or (before is not None and _of_memory(before))


def _request(requests: BinaryIO) -> bytes | None:
    front = requests.read(protocol.LENGTH.size)
    if len(front) < protocol.LENGTH.size:
        return None
    return requests.read(protocol.LENGTH.unpack(front)[0])


def _address_space() -> int | None:
    """Bytes of address space that this process has; None where the system does not say."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * resource.getpagesize()
    except OSError:
        return None


if __name__ == "__main__":
    sys.exit(main())
