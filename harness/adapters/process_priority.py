"""How a process stands in the queue for a processor: its niceness, from -20 (first) to 19 (last), as POSIX has it."""

import os
from contextlib import suppress


def ask_for(niceness: int) -> None:
    """Ask the system for this niceness, for this thread and all that it begins from now on.

    Less than before is given to root, with CAP_SYS_NICE, or within RLIMIT_NICE (`LimitNICE=` of a service); a system
    that refuses leaves it where it is.
    """
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, niceness)


def give_way(pid: int = 0, *, niceness: int = 0) -> None:
    """Let this thread, or a child that has just begun, stand no further in front than so; a child that is gone is not
    looked for."""
    with suppress(ProcessLookupError):
        if os.getpriority(os.PRIO_PROCESS, pid) < niceness:
            os.setpriority(os.PRIO_PROCESS, pid, niceness)
