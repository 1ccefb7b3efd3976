"""What a machine may take from a running mission: a slice of the campaign, and its counting."""

import socket
from threading import Thread

import msgspec
import pytest

from experiments.campaigns.hard_faults import STRIKES, HardFault, HardFaultOutcome, possible, reported, struck_by
from experiments.campaigns.link import Link
from experiments.campaigns.publish import figures

READ_ONLY = "disk read-only" if possible("disk read-only") else "nothing writable"
"""Where this machine lets a file system be mounted, one that gives up; else files that cannot grow."""
SLICE = ("locked store", READ_ONLY, "64 file descriptors", "link drops")


@pytest.mark.long
@pytest.mark.parametrize("name", SLICE)
def test_under_a_fault_of_the_machine_nothing_false_is_accepted_nothing_is_lost_and_nothing_starts_twice(
    name: str,
) -> None:
    found = struck_by(HardFault(name=name, at_s=8.0, lasts_s=2.0))
    assert found.struck
    assert (found.false_completions, found.lost_events, found.duplicate_starts, found.wrong) == ((), 0, 0, ())
    assert found.end in ("succeeded", "awaiting_human"), found.said


def outcome(name: str, **changes: object) -> HardFaultOutcome:
    fault = HardFault(name=name, at_s=3.0, lasts_s=2.0)
    return HardFaultOutcome(fault=fault, struck=True, **{"end": "succeeded", **changes})  # type: ignore[arg-type]


def test_counts_are_by_fault_and_what_must_never_be_is_an_offence() -> None:
    asked = outcome("locked store", end="awaiting_human", asked="interrupted")
    lost = outcome("memory limit", lost_events=2)
    found = reported([outcome("locked store"), asked, lost], skipped=("disk full",))
    assert found.struck == {"locked store": 2, "memory limit": 1}
    assert found.succeeded == {"locked store": 1, "memory limit": 1}
    assert found.questions == {"locked store: interrupted": 1}
    assert found.offences == ("memory limit: 2 events lost",)
    page = figures({"hard_faults": msgspec.to_builtins(found)})
    assert "locked store 1 of 2" in page and "not to be brought about here: disk full" in page


def test_every_fault_says_whether_this_machine_lets_it_be_brought_about() -> None:
    assert all(possible(name) in (True, False) for name in STRIKES)
    assert all(possible(name) for name in SLICE)


def test_a_link_passes_bytes_on_drops_what_is_open_when_it_is_cut_and_passes_on_again() -> None:
    echo = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            try:
                one, _ = echo.accept()
            except OSError:
                return
            one.sendall(one.recv(100).upper())
            one.recv(100)
            one.close()

    serving = Thread(target=serve, daemon=True)
    serving.start()
    link = Link(echo.getsockname()[1])

    def heard() -> bytes:
        """What comes back over the link; nothing where it is down."""
        with socket.create_connection(("127.0.0.1", link.port), timeout=20.0) as near:
            try:
                near.sendall(b"hello")
                return near.recv(100)
            except OSError:
                return b""

    assert heard() == b"HELLO"
    with socket.create_connection(("127.0.0.1", link.port), timeout=20.0) as open_one:
        open_one.sendall(b"hello")
        assert open_one.recv(100) == b"HELLO"
        link.cut()
        assert open_one.recv(100) == b""
    assert link.dropped >= 1 and heard() == b""
    link.mend()
    assert heard() == b"HELLO"
    link.close()
    echo.shutdown(socket.SHUT_RDWR)
    echo.close()
    serving.join()
