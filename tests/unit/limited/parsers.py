"""Parsers for the tests of limited processes: honest ones, and ones that want too much."""

import os
import signal
import sys
import time

from harness.contracts.errors import CloudInvalid
from harness.contracts.reasons import because


def doubled(request: bytes) -> bytes:
    return request * 2


def chatty(request: bytes) -> bytes:
    """Prints what could be taken for an answer."""
    sys.stdout.write("A" * 100)
    sys.stdout.flush()
    os.write(1, b"A" * 100)
    return request


def refusing(request: bytes) -> bytes:
    raise CloudInvalid(because("cloud_empty"), where="here")


def broken(request: bytes) -> bytes:
    raise ZeroDivisionError("no such number")


def greedy(request: bytes) -> bytes:
    return bytes(int(request))


def endless(request: bytes) -> bytes:
    while True:
        pass


def asleep(request: bytes) -> bytes:
    time.sleep(600)
    return b""


def crashing(request: bytes) -> bytes:
    os.kill(os.getpid(), signal.SIGSEGV)
    return b""


def writing(request: bytes) -> bytes:
    with open(request.decode(), "wb") as file:
        file.write(bytes(2**22))
    return b""


def surroundings(request: bytes) -> bytes:
    return "\n".join(sorted(os.environ)).encode()
