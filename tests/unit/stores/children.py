"""Programs that the store tests run as processes of their own, to race them and to kill them.

python children.py burst URL            append until killed; print each acknowledged position
python children.py race URL STREAM N    append until the stream holds N events; print how many were ours
python children.py fill URL BYTES       append until no file may grow beyond BYTES; print what went wrong
python children.py fail URL FAILPOINT   append Asked, Dispatched, Answered under a failpoint
python children.py own FOLDER URL       own the folder until killed
python children.py torn FOLDER BYTES    write a blob of BYTES that may not grow to them; the system kills the writer
python children.py spool FOLDER         add samples until killed; print how many were added
"""

import resource
import signal
import sys
from itertools import count
from pathlib import Path
from typing import cast

from app.i18n.reasons.rendering import explained
from harness.adapters.failpoints import parse, provider_with_failpoint, with_failpoint
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.log_address import open_log
from harness.adapters.stores.owner import OwnerLock
from harness.adapters.stores.spool import FileSpool
from harness.contracts.errors import ConcurrencyConflict, StoreUnavailable
from harness.contracts.ids import InvocationId, StreamId
from harness.contracts.observations import Battery
from harness.contracts.ports import Batch, NewEvent, Provider
from harness.contracts.protocol import StartRequest
from harness.contracts.values import Moment, encode

NOW = Moment(mission_s=1.0, wall_s=2.0)


def burst(url: str) -> None:
    store = open_log(url)
    for version in count():
        batches = [_batch(stream, version, "Moved") for stream in ("mission/a", "lease/base")]
        print(store.append(batches, [], NOW).position, flush=True)


def race(url: str, stream: str, rounds: str) -> None:
    store = open_log(url)
    won = version = 0
    while version < int(rounds):
        try:
            store.append([_batch(stream, version, "Won")], [], NOW)
            won += 1
            version += 1
        except ConcurrencyConflict:
            version = len(store.load(StreamId(stream)))
    store.close()
    print(won)


def fill(url: str, limit: str) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), int(limit)))
    store = open_log(url)
    for version in count():
        try:
            print(store.append([_batch("mission/a", version, "Filled", size=20_000)], [], NOW).position)
        except StoreUnavailable as error:
            print(explained(error))
            return


def fail(url: str, name: str) -> None:
    store = with_failpoint(open_log(url), parse(name))
    for version, kind in enumerate(("Asked", "Dispatched", "Answered")):
        store.append([_batch("mission/a", version, kind)], [], NOW)


class PrintingProvider:
    """A provider that only starts, and prints how often it did."""

    def __init__(self) -> None:
        self._starts = count(1)

    def start(self, _request: object) -> None:
        print(next(self._starts), flush=True)


def dispatch(name: str) -> None:
    provider = provider_with_failpoint(cast(Provider, PrintingProvider()), parse(name))
    for _ in range(3):
        provider.start(cast(StartRequest, None))


def own(folder: str, url: str) -> None:
    lock = OwnerLock(Path(folder))
    lock.take(token="secret", url=url)
    print("owned", flush=True)
    signal.pause()


def spool(folder: str) -> None:
    samples = FileSpool(Path(folder))
    for seq in count():
        samples.add(InvocationId("inv_1"), [Battery(seq=seq, at_s=float(seq), source="battery", charge=0.5)])
        print(seq + 1, flush=True)


def blobs(folder: str) -> None:
    store = FileBlobStore(Path(folder))
    for number in count():
        print(store.put(f"{number} ".encode() * 30_000), flush=True)


def torn(folder: str, size: str) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(size) // 2, int(size) // 2))
    FileBlobStore(Path(folder)).put(b"x" * int(size))


def _batch(stream: str, version: int, kind: str, size: int = 0) -> Batch:
    body = encode({"version": version, "padding": "x" * size})
    return Batch(stream=StreamId(stream), expected_version=version, events=(NewEvent(kind=kind, body=body),))


if __name__ == "__main__":
    programs = {
        "burst": burst,
        "race": race,
        "fill": fill,
        "fail": fail,
        "dispatch": dispatch,
        "own": own,
        "spool": spool,
        "blobs": blobs,
        "torn": torn,
    }
    programs[sys.argv[1]](*sys.argv[2:])
