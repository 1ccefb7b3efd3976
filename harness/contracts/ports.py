"""The interfaces through which the harness reaches the outside world, and the values that cross them."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Protocol, TypeVar

from harness.contracts import ids, protocol, read_models
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import Configuration
from harness.contracts.errors import HarnessError
from harness.contracts.evidence import EvidenceReference
from harness.contracts.measurements import Measurement, PictureLook, Sound, StoredMessage
from harness.contracts.memory import FollowPosition, MemoryEntry, MemoryQuery, MemoryRecord
from harness.contracts.observations import AnySample
from harness.contracts.pictures import PictureInventory
from harness.contracts.predicates import InstalledPredicate, PredicateAnswer, PredicateQuestion
from harness.contracts.reasons import Reason
from harness.contracts.spoken_goals import SpokenVocabulary, Transcription
from harness.contracts.values import Moment, Value

State = TypeVar("State")


class NewEvent(Value):
    """One event to append. `body` is canonical JSON; `kind` is its tag."""

    kind: str
    body: bytes


class Batch(Value):
    """Events for one stream. `expected_version` is the number of events the stream must hold before."""

    stream: ids.StreamId
    expected_version: int
    events: tuple[NewEvent, ...]


class Record(Value):
    """A decision's artefact (context, candidate set, output), stored in the decision's own transaction (D8)."""

    digest: ids.Digest
    kind: str
    body: bytes


MISSION_STREAMS = "mission/"
MISSION_ENDED = "MissionEnded"


class StoredEvent(Value):
    """One event as the log holds it: `position` is global, `version` the stream's, both from 1.

    `digest` = SHA-256(previous digest, position, stream, version, kind, both times, body); see `chain`.
    """

    position: int
    stream: ids.StreamId
    version: int
    kind: str
    body: bytes
    mission_s: float
    recorded_s: float
    previous: ids.Digest
    digest: ids.Digest


class LogHead(Value):
    """The end of the log: what an anchor exports."""

    position: int
    digest: ids.Digest


class EventStore(Protocol):
    """The append-only log. One global order, one hash chain, atomic over several streams."""

    def append(self, batches: Sequence[Batch], records: Sequence[Record], now: Moment) -> LogHead:
        """All or nothing, durable on return. Raises ConcurrencyConflict if a stream's version differs."""

    def turn(self) -> AbstractContextManager[None]:
        """A block in which this thread sees all that was appended before it. What another process appends meanwhile
        may stay unseen until a further block, inside it or after it, or until an append finds that its streams moved.
        """

    def load(self, stream: ids.StreamId, after: int = 0) -> list[StoredEvent]:
        """Events of one stream with version > after, in order."""

    def read(self, after: int = 0, limit: int = 1000) -> list[StoredEvent]:
        """Events of all streams with position > after, in global order."""

    def streams(self, prefix: str) -> list[ids.StreamId]:
        """Streams whose name starts with `prefix`, by first position."""

    def open_missions(self) -> list[ids.StreamId]:
        """Streams of missions that hold no MissionEnded, by first position."""

    def ended_missions(self, after: int, upto: int) -> list[ids.StreamId]:
        """Streams whose MissionEnded has a position > after and <= upto, in the order of their ends."""

    def record(self, digest: ids.Digest) -> Record:
        """Raises UnknownName."""

    def head(self) -> LogHead: ...

    def verify(self) -> LogHead:
        """Recompute the chain and every record's digest; raises LogDamaged that names the first bad position."""

    def close(self) -> None: ...


class Configurations(Protocol):
    """Every configuration version in this log, and which one a robot's new missions are pinned to (R155, D35)."""

    def current_id(self, robot_id: ids.RobotId) -> ids.Digest:
        """The version a new mission of this robot is pinned to."""

    def current(self, robot_id: ids.RobotId) -> Configuration:
        """Raises ConfigurationMissing as `get` does."""

    def get(self, configuration_id: ids.Digest) -> Configuration:
        """A version by its id. Raises ConfigurationMissing if it is not here or this release cannot read it."""

    def on_trial(self, configuration_id: ids.Digest) -> bool:
        """Whether a version is in canary."""

    def record(self, configuration_id: ids.Digest) -> Record:
        """The version's bytes as stored with the decision that first names it. Raises as `get` does."""


class StateSnapshot(Value):
    """A stream's folded state up to `version`, as canonical JSON. `event` is the digest of the event it ends with.

    `fingerprint` names the shape of the state and the code that folded it: another one makes the snapshot void.
    `seal` is over all of it with the installation's key (D59). Release 0.1.0 wrote the SHA-256 of the body there.
    """

    stream: ids.StreamId
    version: int
    event: ids.Digest
    fingerprint: ids.Digest
    seal: ids.Digest
    body: bytes


class SnapshotFindings(Value):
    """What an audit of the stored snapshots found. Only sealed ones are used; the others are folded again.

    `sealed` carry this installation's seal and say what the events say. `unsealed` are of another release or another
    installation. `forged` are the streams whose snapshot says something else than the events, sealed or not.
    `unkeyed` is why there is no key; None if there is one.
    """

    sealed: int = 0
    unsealed: int = 0
    forged: tuple[ids.StreamId, ...] = ()
    unkeyed: Reason | None = None


class Snapshots(Protocol):
    """Folded states stored separately, so that opening a stream costs only its tail. Losing one costs only time."""

    def restore(self, stream: ids.StreamId, initial: State) -> tuple[State, int]:
        """The newest usable state and its version; `initial` and 0 if there is none. Never raises for a bad one."""

    def offer(self, stream: ids.StreamId, version: int, state: object) -> None:
        """Note that the stream has reached this version; a snapshot worth storing is written later, outside the
        caller's path."""

    def audit(self, fold: Callable[[ids.StreamId, int], object]) -> SnapshotFindings:
        """Compare every stored snapshot with `fold`: the state of a stream by its first so many events.

        `fold` raises KeyError for a stream of a family that it does not know.
        """


class BlobStore(Protocol):
    """Content-addressed bytes."""

    def put(self, body: bytes) -> ids.Digest: ...

    def get(self, digest: ids.Digest) -> bytes:
        """Bytes that match the digest; raises BlobDamaged if missing or changed."""

    def has(self, digest: ids.Digest) -> bool: ...

    def digests(self) -> Iterator[ids.Digest]: ...

    def erase(self, digest: ids.Digest) -> None:
        """Remove the bytes, durably; nothing happens where there are none."""


class Spool(Protocol):
    """Unsynced samples of one invocation, until they are sealed as one blob (D8)."""

    def add(self, invocation: ids.InvocationId, samples: Iterable[AnySample]) -> None: ...

    def samples(self, invocation: ids.InvocationId) -> list[AnySample]: ...

    def drop(self, invocation: ids.InvocationId) -> None: ...


class Clock(Protocol):
    """Mission time, wall time and waiting. A virtual clock advances the simulated world instead of sleeping."""

    def now(self) -> Moment: ...

    def wait_until(self, mission_s: float) -> None: ...


class Ids(Protocol):
    """Generates new ids."""

    def mission(self) -> ids.MissionId: ...

    def token(self) -> str:
        """An unguessable one-time value."""


class Provider(Protocol):
    """One implementer of one capability, behind the provider protocol."""

    @property
    def card(self) -> CapabilityCard: ...

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        """Idempotent by request id; other parameters under the same id are refused (ProviderFailed)."""

    def report(self, handle: str) -> protocol.InvocationReport: ...

    def find(self, request: ids.RequestId) -> protocol.InvocationReport | None: ...

    def keepalive(self, handle: str) -> None: ...

    def resume(self, handle: str) -> protocol.InvocationReport:
        """Go on after `blocked` by a lost keepalive, where the card says `resumable`."""

    def stop(self, handle: str) -> protocol.InvocationReport:
        """Ask to stop; the report becomes `cancelled` only once the stop is acknowledged."""


class Robot(Protocol):
    """One robot: its providers, its sensors and its condition."""

    def providers(self) -> Sequence[Provider]: ...

    def status(self) -> protocol.RobotStatus: ...

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations: ...

    def blob(self, digest: ids.Digest) -> bytes: ...

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        """The robot's own start journal."""


class DecidesItself(Protocol):
    """A robot whose own stack decides, as far as it says what that stack was given to do."""

    def stack_goals(self, after: int, limit: int = protocol.MOST_CHANGES) -> protocol.StackGoals:
        """Changes of the stack's goals after a sequence number. Raises ProviderFailed for a robot that tells none."""


class ObservedRobot(DecidesItself, Protocol):
    """A robot in shadow mode: what may be read of it. Nothing here commands."""

    def status(self) -> protocol.RobotStatus: ...

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations: ...


class LiveCamera(Protocol):
    """A robot's live camera for people; what it shows is never evidence."""

    def picture(self) -> protocol.Picture:
        """The current picture, at most half a second old. Raises ProviderFailed where there is no camera."""


class Teleoperable(Protocol):
    """A robot that a person may teleoperate while nothing else moves it."""

    def drive(self, order: protocol.DriveOrder) -> protocol.DriveReport:
        """Hold this velocity until the next order. Raises FencingRefused; ProviderFailed while something moves it."""

    def release(self, session: ids.RequestId) -> protocol.DriveReport:
        """End the session; `ended` once the body is at standstill."""

    def rest(self, order: protocol.PostureOrder) -> protocol.RobotStatus:
        """Lie down or stand up. Raises FencingRefused, or ProviderFailed while something moves it."""


class MessageOutbox(Protocol):
    """Sends messages to the outside. The receipt's text is the channel's own report (D22: declared)."""

    def send(self, key: str, text: str, images: Sequence[ids.Digest]) -> str:
        """Idempotent by key; returns the channel's acknowledgement id. Raises ProviderFailed, DeliveryUnknown among it
        where the message may have been sent."""


class MessageReadPath(Protocol):
    """Reads messages back from their channel, by a client of its own: it shares nothing with the one that sends."""

    def find(self, key: str) -> StoredMessage | None:
        """The message as it is stored now; None if the channel holds none. Raises StoreUnavailable."""


class Room(Protocol):
    """The room around a robot: a loudspeaker plays into it, and its microphone records what can be heard there.

    The two ends share the air and nothing else. Raises ProviderUnreachable.
    """

    def play(self, sound: Sound) -> None:
        """Let a stretch of sound be heard."""

    def recording(self, from_s: float, until_s: float) -> bytes:
        """What was heard between two instants of mission time, as a WAV."""


class SpeechStream(Protocol):
    """Speech as it comes: 16-bit little-endian mono samples of 16 kHz, in chunks. Raises ProviderFailed."""

    def feed(self, samples: bytes) -> str:
        """The words so far."""

    def finish(self) -> str:
        """The words of all of it; nothing more is taken."""

    def close(self) -> None:
        """Give up what it holds; harmless when it is over."""


class Transcriber(Protocol):
    """Writes down what a person said. `name` with its version is stored with every transcript."""

    def listen(self, *, expected: SpokenVocabulary) -> SpeechStream:
        """What somebody says, while they say it. Raises ProviderFailed."""

    @property
    def name(self) -> str: ...

    def transcribe(self, recording: bytes, *, expected: SpokenVocabulary) -> Transcription:
        """What a WAV says. Raises RecordingUnusable for what is no speech, ProviderFailed if the recogniser fails."""


class IndependentSource(Protocol):
    """Measures what a stage left in the world, without the provider that is judged (D17). It decides nothing.

    `predicate` is the one that it supplies; `lasting` says whether its reading is taken again for the goal; `able`
    whether it has what it takes to show that the predicate holds.
    """

    @property
    def predicate(self) -> str: ...

    @property
    def lasting(self) -> bool: ...

    @property
    def able(self) -> bool: ...

    def measure(self, measurement: Measurement) -> Sequence[EvidenceReference]:
        """What is measured now; empty if there is nothing to measure with. Raises HarnessError if it fails."""


class Predicates(Protocol):
    """The predicates of installed packages (D54). Their code runs apart from this process, within limits."""

    @property
    def installed(self) -> Mapping[str, InstalledPredicate]: ...

    @property
    def problems(self) -> Sequence[HarnessError]:
        """What names itself a predicate and cannot be used."""

    def ask(self, name: str, question: PredicateQuestion) -> PredicateAnswer:
        """Raises ContractInvalid where it is not installed, breaks, takes too long or is no pure function."""


class PictureReader(Protocol):
    """Decodes images of robots apart from this process, within limits of memory and time."""

    def look(self, image: ids.Digest, body: bytes) -> PictureLook:
        """What is compared of an image. Raises ProviderFailed if it cannot be decoded to its last pixel."""


class PictureObserver(Protocol):
    """Finds objects and text in a picture, apart from this process. `labels` are the objects that it can find."""

    @property
    def labels(self) -> frozenset[str]: ...

    def observe(self, image: ids.Digest, body: bytes) -> PictureInventory:
        """What is in the picture `body`, whose checksum is `image`. Raises ProviderFailed."""


class Signals(Protocol):
    """Publishes the names of what changed to anybody who watches. Losing one costs nothing."""

    def changed(self, name: str) -> None: ...


class MemoryIndex(Protocol):
    """A read model of memory records that follows the log. It can be dropped at any time and built again."""

    def mark(self) -> FollowPosition: ...

    def add(self, records: Sequence[MemoryRecord], *, after: FollowPosition, upto: FollowPosition) -> None:
        """All or nothing, with the new position. Raises ConcurrencyConflict if the index is not at `after`."""

    def clear(self) -> None:
        """Delete everything; the position becomes 0."""

    def get(self, record_id: str) -> MemoryEntry:
        """Raises UnknownName."""

    def current(self, kind: str, subject: str) -> list[MemoryEntry]:
        """Records of one kind and subject that nothing has superseded, oldest first; disputed ones included."""

    def find(self, query: MemoryQuery) -> list[MemoryEntry]:
        """Newest first."""

    def close(self) -> None: ...


class ReadModels(Protocol):
    """Lists that follow the log. Losing them costs a rebuild and nothing else."""

    def mark(self) -> FollowPosition:
        """How far the lists have followed the log; position 0 and no fold if they hold nothing."""

    def add(self, rows: Sequence[read_models.ListRow], *, after: FollowPosition, upto: FollowPosition) -> None:
        """Replace the rows with those numbers. All or nothing.

        Raises ConcurrencyConflict if the lists are not at `after`.
        """

    def clear(self) -> None:
        """Delete everything."""

    def page(self, query: read_models.ListQuery) -> read_models.ListPage:
        """One page of a list."""

    def count(self, query: read_models.ListQuery) -> int:
        """How many rows answer the query, counted up to read_models.MANY + 1; `after` and `limit` play no part."""

    def tallies(self, listing: read_models.Listing) -> list[read_models.FacetCount]:
        """Every value of every facet with its count, and the whole list under an empty facet."""

    def body(self, listing: read_models.Listing, key: str) -> bytes | None:
        """One item by its key."""

    def close(self) -> None: ...
