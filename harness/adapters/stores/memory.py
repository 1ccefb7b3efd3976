"""In-memory stores for tests, suites and simulated missions. They end with their process; nothing reaches the disk."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from threading import Lock

from harness.adapters.stores import chain
from harness.contracts import ports
from harness.contracts.errors import BlobDamaged, UnknownName
from harness.contracts.ids import Digest, InvocationId, StreamId, sha256
from harness.contracts.observations import AnySample
from harness.contracts.reasons import because
from harness.contracts.values import Moment


class MemoryEventStore:
    """The event log as a list. Safe between threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._log: list[ports.StoredEvent] = []
        self._by_stream: dict[StreamId, list[ports.StoredEvent]] = {}
        self._records: dict[Digest, ports.Record] = {}

    def append(self, batches: Sequence[ports.Batch], records: Sequence[ports.Record], now: Moment) -> ports.LogHead:
        """All or nothing. Raises ConcurrencyConflict, or ContractInvalid for a record or name that no log takes."""
        chain.admit(batches, records)
        with self._lock:
            versions = {batch.stream: len(self._by_stream.get(batch.stream, ())) for batch in batches}
            events = chain.link(self._end(), versions, batches, now)
            self._log.extend(events)
            for event in events:
                self._by_stream.setdefault(event.stream, []).append(event)
            for record in records:
                self._records.setdefault(record.digest, record)
            return self._end()

    def turn(self) -> AbstractContextManager[None]:
        """Nothing to look at: no other process appends."""
        return nullcontext()

    def load(self, stream: StreamId, after: int = 0) -> list[ports.StoredEvent]:
        """Events of one stream with version > after, in order."""
        with self._lock:
            return self._by_stream.get(stream, [])[after:]

    def read(self, after: int = 0, limit: int = 1000) -> list[ports.StoredEvent]:
        """Events of all streams with position > after, in global order, at most `limit`."""
        with self._lock:
            return self._log[after : after + limit]

    def streams(self, prefix: str) -> list[StreamId]:
        """Streams whose name starts with `prefix`, by first position."""
        with self._lock:
            return [stream for stream in self._by_stream if stream.startswith(prefix)]

    def open_missions(self) -> list[StreamId]:
        """Streams of missions that hold no MissionEnded, by first position."""
        with self._lock:
            ended = {event.stream for event in self._log if event.kind == ports.MISSION_ENDED}
            return [one for one in self._by_stream if one.startswith(ports.MISSION_STREAMS) and one not in ended]

    def ended_missions(self, after: int, upto: int) -> list[StreamId]:
        """Streams whose MissionEnded has a position > after and <= upto, in the order of their ends."""
        with self._lock:
            return [event.stream for event in self._log[after:upto] if event.kind == ports.MISSION_ENDED]

    def record(self, digest: Digest) -> ports.Record:
        """Raises UnknownName."""
        with self._lock:
            if digest not in self._records:
                raise UnknownName(because("record_missing", digest=digest), where="records")
            return self._records[digest]

    def head(self) -> ports.LogHead:
        """The end of the log; the genesis head of an empty one."""
        with self._lock:
            return self._end()

    def verify(self) -> ports.LogHead:
        """Recompute the chain and every record's digest; raises LogDamaged that names the first bad position."""
        with self._lock:
            log, records = list(self._log), list(self._records.values())
        digests = {record.digest for record in records}
        head = chain.check(chain.check_commands(log, digests.intersection))
        for record in records:
            chain.check_record(record)
        return head

    def close(self) -> None:
        """Nothing to release."""

    def _end(self) -> ports.LogHead:
        return (
            ports.LogHead(position=self._log[-1].position, digest=self._log[-1].digest) if self._log else chain.GENESIS
        )


class MemoryBlobStore:
    """Blobs in a dictionary."""

    def __init__(self) -> None:
        self._bodies: dict[Digest, bytes] = {}

    def put(self, body: bytes) -> Digest:
        """Keep `body` and return its SHA-256."""
        digest = sha256(body)
        self._bodies[digest] = body
        return digest

    def get(self, digest: Digest) -> bytes:
        """Raises BlobDamaged if there is no such blob."""
        if digest not in self._bodies:
            raise BlobDamaged(because("blob_missing", digest=digest), where="memory")
        return self._bodies[digest]

    def has(self, digest: Digest) -> bool:
        """Whether `get` would find it."""
        return digest in self._bodies

    def digests(self) -> Iterator[Digest]:
        """All digests, in ascending order."""
        yield from sorted(self._bodies)

    def erase(self, digest: Digest) -> None:
        """Forget the bytes."""
        self._bodies.pop(digest, None)


class MemorySpool:
    """Samples in lists, one per invocation."""

    def __init__(self) -> None:
        self._samples: dict[InvocationId, list[AnySample]] = {}

    def add(self, invocation: InvocationId, samples: Iterable[AnySample]) -> None:
        """Append `samples` in the order given."""
        self._samples.setdefault(invocation, []).extend(samples)

    def samples(self, invocation: InvocationId) -> list[AnySample]:
        """What was added, in order; empty if nothing was."""
        return list(self._samples.get(invocation, ()))

    def drop(self, invocation: InvocationId) -> None:
        """Forget the invocation's samples, if there are any."""
        self._samples.pop(invocation, None)
