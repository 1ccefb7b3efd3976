"""Takes this process's right to open files and TCP connections away, by Landlock (Linux 5.13 and later).

What a process gave up it cannot get back, and its children do not have it either. Files that are open stay open.
"""

import ctypes
import os
import struct
from collections.abc import Iterable
from pathlib import Path

from harness.contracts.errors import StoreUnavailable
from harness.contracts.reasons import because

CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
"""System calls, with the same number on every architecture."""
NO_NEW_PRIVILEGES = 38
PATH_BENEATH = 1
READ_FILE, READ_DIR, EXECUTE = 1 << 2, 1 << 3, 1 << 0
FILE_RIGHTS_BY_ABI = {1: 13, 2: 14, 3: 15, 4: 15}
"""How many file system rights a kernel knows, by the version of its interface; from 5 on there are 16."""
TCP_RIGHTS = 0b11
TCP_FROM_ABI = 4


def confine(readable: Iterable[Path], *, connects: bool) -> None:
    """From now on only `readable` folders and files can be read, and nothing can be written.

    Without `connects` no TCP connection can be made either, where the kernel can forbid it (Linux 6.7). Raises
    StoreUnavailable on a system that cannot confine a process: then nothing was given up.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    abi = libc.syscall(CREATE_RULESET, None, 0, 1)
    if abi < 1:
        raise StoreUnavailable(
            because("confinement_unsupported", error=os.strerror(ctypes.get_errno())),
            where="Landlock",
        )
    rights = (1 << FILE_RIGHTS_BY_ABI.get(abi, 16)) - 1
    tcp = TCP_RIGHTS if abi >= TCP_FROM_ABI and not connects else 0
    handled = struct.pack("QQ", rights, tcp) if abi >= TCP_FROM_ABI else struct.pack("Q", rights)
    ruleset = _done(libc.syscall(CREATE_RULESET, handled, len(handled), 0))
    try:
        for path in readable:
            _allow(libc, ruleset, path)
        _done(libc.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0))
        _done(libc.syscall(RESTRICT_SELF, ruleset, 0))
    finally:
        os.close(ruleset)


def _allow(libc: ctypes.CDLL, ruleset: int, path: Path) -> None:
    """Reading below a folder, or of one file; what is not there needs no right."""
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except FileNotFoundError:
        return
    try:
        rights = READ_FILE | READ_DIR | EXECUTE if path.is_dir() else READ_FILE
        _done(libc.syscall(ADD_RULE, ruleset, PATH_BENEATH, struct.pack("=Qi", rights, place), 0))
    finally:
        os.close(place)


def _done(answer: int) -> int:
    if answer < 0:
        raise StoreUnavailable(
            because("process_unconfined", error=os.strerror(ctypes.get_errno())),
            where="Landlock",
        )
    return answer
