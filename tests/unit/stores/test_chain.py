"""The event digest as it is documented, and what the walk over a chain notices."""

import hashlib
import struct
from collections.abc import Callable

import msgspec
import pytest

from harness.adapters.stores.chain import GENESIS, check, event_digest, link
from harness.contracts.errors import LogDamaged
from harness.contracts.ids import StreamId
from harness.contracts.ports import LogHead, StoredEvent
from tests.saying import where
from tests.unit.stores.builders import NOW, batch

LOG = link(GENESIS, {}, [batch("mission/ü", 0, "Asked", "Moved"), batch("lease/base", 0, "Taken")], NOW)


def test_the_digest_is_over_the_documented_bytes() -> None:
    event = LOG[1]
    documented = (
        bytes.fromhex(LOG[0].digest)
        + (2).to_bytes(8, "big")
        + (2).to_bytes(8, "big")
        + struct.pack(">d", 100.25)
        + struct.pack(">d", 1_795_000_000.5)
        + (10).to_bytes(4, "big")
        + (5).to_bytes(4, "big")
        + "mission/üMoved".encode()
        + b'{"kind":"Moved","number":1}'
    )
    assert event.digest == hashlib.sha256(documented).hexdigest()


def test_a_stream_and_a_kind_cannot_lend_each_other_letters() -> None:
    one = msgspec.structs.replace(LOG[0], stream=StreamId("mission/a"), kind="bc")
    other = msgspec.structs.replace(LOG[0], stream=StreamId("mission/ab"), kind="c")
    assert event_digest(one) != event_digest(other)


def test_a_chain_is_walked_to_its_end_from_any_place() -> None:
    end = LogHead(position=3, digest=LOG[2].digest)
    assert check(LOG) == end
    assert check(LOG[1:], after=LogHead(position=1, digest=LOG[0].digest)) == end
    assert check([]) == GENESIS


def without_the_second(log: list[StoredEvent]) -> list[StoredEvent]:
    return [log[0], log[2]]


def second_rewritten_and_sealed_again(log: list[StoredEvent]) -> list[StoredEvent]:
    rewritten = msgspec.structs.replace(log[1], body=b"{}")
    return [log[0], msgspec.structs.replace(rewritten, digest=event_digest(rewritten)), log[2]]


def second_changed(log: list[StoredEvent]) -> list[StoredEvent]:
    return [log[0], msgspec.structs.replace(log[1], body=b"{}"), log[2]]


@pytest.mark.parametrize(
    ("tampered", "position"),
    [(without_the_second, 2), (second_changed, 2), (second_rewritten_and_sealed_again, 3)],
)
def test_the_first_event_that_does_not_fit_is_named(
    tampered: Callable[[list[StoredEvent]], list[StoredEvent]], position: int
) -> None:
    with pytest.raises(LogDamaged) as caught:
        check(tampered(LOG))
    assert where(caught.value) == f"position {position}"
