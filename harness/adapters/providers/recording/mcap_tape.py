"""MCAP files as a tape: every record is read once, with its checksums, before anything counts as recorded."""

import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from zlib import crc32

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from harness.adapters.providers.recording.packing import unpack, unpack_message
from harness.adapters.providers.recording.tape import Block, Channel, Cursor, Raw, Short, in_time_order, reading
from harness.adapters.providers.recording.type_names import ros2_name
from harness.contracts.errors import RecordingInvalid

MAGIC = b"\x89MCAP0\r\n"
RUN_BYTES = 1024 * 1024
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_LOOSE = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


class McapTape:
    """One MCAP file, or the splits of one recording in order. With `recover`, a cut file gives its whole part.

    `names` are the files to speak of where `paths` are unpacked copies.
    """

    def __init__(self, paths: Sequence[Path], *, names: Sequence[Path], recover: bool = False) -> None:
        self.channels: list[Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.checks = "checksum of every block verified"
        self.cut = ""
        self._paths, self._names, self._recover = paths, names, recover
        self._tables: list[dict[int, Channel]] = [{} for _ in paths]
        self._blocks: list[Block] = []

    def scan(self) -> Iterator[Raw]:
        for number, path in enumerate(self._paths):
            table = self._tables[number]
            scan = _Scan(number, table, self._blocks)
            with reading(self._names[number]), path.open("rb") as file:
                cursor = Cursor(file)
                with reading(self._names[number], cursor):
                    yield from scan.read(cursor)
            if scan.cut:
                self._refuse_or_note(scan, self._names[number])
            if scan.unchecked:
                self.checks = "structure only: the file carries no checksums for its messages"
            self.metadata |= scan.metadata
            self.channels += [channel for channel in table.values() if channel not in self.channels]

    def messages(self, topics: frozenset[str]) -> Iterator[Raw]:
        blocks = [block for block in self._blocks if any(channel.topic in topics for channel in block.channels)]
        return in_time_order(blocks, lambda block: self._load(block, topics))

    def _load(self, block: Block, topics: frozenset[str]) -> list[Raw]:
        table = self._tables[block.file]
        with reading(self._names[block.file]), self._paths[block.file].open("rb") as file:
            file.seek(block.offset)
            body = unpack(file.read(block.length), packing=block.packing, size=block.unpacked)
            return [raw for raw in _messages(body, table) if raw.channel.topic in topics]

    def _refuse_or_note(self, scan: "_Scan", path: Path) -> None:
        readable = f"{scan.count} messages before that are whole"
        if not self._recover:
            do = f"{readable}: copy the file again, or open it with recovery, which labels it incomplete"
            raise RecordingInvalid(scan.cut, where=str(path), do=do if scan.count else "copy the file again")
        self.cut = f"{scan.cut}; {readable}"


class _Scan:
    """The one full pass over a file: finds blocks, verifies checksums and compares the file's own statistics."""

    def __init__(self, number: int, table: dict[int, Channel], blocks: list[Block]) -> None:
        self.metadata: dict[str, dict[str, str]] = {}
        self.count = 0
        self.cut = ""
        self.unchecked = False
        self._number, self._table, self._blocks = number, table, blocks
        self._schemas: dict[int, records.Schema] = {}
        self._declared: int | None = None
        self._run: list[Raw] = []
        self._run_from = self._run_until = 0
        self._unguarded = 0
        self._sets: dict[frozenset[Channel], frozenset[Channel]] = {}

    def read(self, cursor: Cursor) -> Iterator[Raw]:
        """All messages in file order; sets `cut` when the file ends early."""
        try:
            crc = crc32(_opening(cursor))
            opcode = 0
            while opcode != Opcode.FOOTER:
                start, head = cursor.at, cursor.take(_HEAD.size)
                opcode, length = _HEAD.unpack(head)
                body = cursor.take(length)
                self._verify(opcode, head, body, crc)
                crc = 0 if opcode == Opcode.DATA_END else crc32(body, crc32(head, crc))
                yield from self._record(opcode, body, start)
            if cursor.take(len(MAGIC)) != MAGIC:
                raise ValueError("the closing mark of an MCAP file is wrong")
            if self._declared is not None and self._declared != self.count:
                raise ValueError(f"the file declares {self._declared} messages and holds {self.count}")
        except Short:
            place = "inside a record" if cursor.left else "without its closing index"
            self.cut = f"The recording is truncated: it ends at byte {cursor.at + cursor.left} {place}"
        self._close_run()
        self.unchecked = self.unchecked or self._unguarded > 0

    def _verify(self, opcode: int, head: bytes, body: bytes, crc: int) -> None:
        """Section checksums: `crc` runs over the section before this record. 0 means that there is none."""
        if opcode == Opcode.DATA_END:
            (declared,) = struct.unpack_from("<I", body)
            self._unguarded = 0 if declared else self._unguarded
            section = "data"
        elif opcode == Opcode.FOOTER:
            (declared,) = struct.unpack_from("<I", body, 16)
            crc, section = crc32(body[:16], crc32(head, crc)), "summary"
        else:
            return
        if declared and declared != crc:
            raise ValueError(f"the checksum of the {section} section is wrong")

    def _record(self, opcode: int, body: bytes, start: int) -> Iterator[Raw]:
        """One top-level record that begins at byte `start`."""
        if opcode in _LOOSE:
            self._run_from = self._run_from or start
            self._run_until = start + _HEAD.size + len(body)
            for raw in self._known(_one(opcode, body, self._table, self._learn)):
                self._unguarded += 1
                self._run.append(raw._replace(body=b""))
                yield raw
            if self._run_until - self._run_from > RUN_BYTES:
                self._close_run()
            return
        self._close_run()
        if opcode == Opcode.CHUNK:
            yield from self._chunk(records.Chunk.read(_stream(body)), start + _HEAD.size + len(body))
        elif opcode == Opcode.METADATA:
            record = records.Metadata.read(_stream(body))
            self.metadata[record.name] = record.metadata
        elif opcode == Opcode.STATISTICS:
            self._declared = records.Statistics.read(_stream(body)).message_count

    def _chunk(self, chunk: records.Chunk, end: int) -> Iterator[Raw]:
        body = unpack(chunk.data, packing=chunk.compression, size=chunk.uncompressed_size)
        if chunk.uncompressed_crc and crc32(body) != chunk.uncompressed_crc:
            raise ValueError("the checksum of a block is wrong")
        messages = list(self._known(_messages(body, self._table, self._learn)))
        if not chunk.uncompressed_crc:
            self._unguarded += len(messages)
        if messages:
            self._add(end - len(chunk.data), len(chunk.data), messages, chunk.compression, len(body))
        yield from messages

    def _close_run(self) -> None:
        if self._run:
            length = self._run_until - self._run_from
            self._add(self._run_from, length, self._run, "", length)
        self._run, self._run_from, self._run_until = [], 0, 0

    def _add(self, offset: int, length: int, messages: Sequence[Raw], packing: str, unpacked: int) -> None:
        self._blocks.append(
            Block(
                file=self._number,
                offset=offset,
                length=length,
                packing=packing,
                unpacked=unpacked,
                first_ns=min(raw.log_ns for raw in messages),
                last_ns=max(raw.log_ns for raw in messages),
                channels=self._shared(raw.channel for raw in messages),
            )
        )

    def _shared(self, channels: Iterable[Channel]) -> frozenset[Channel]:
        found = frozenset(channels)
        return self._sets.setdefault(found, found)

    def _known(self, messages: Iterator[Raw]) -> Iterator[Raw]:
        for raw in messages:
            self.count += 1
            yield raw

    def _learn(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = records.Schema.read(_stream(body))
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = records.Channel.read(_stream(body))
            schema = self._schemas.get(channel.schema_id)
            if schema is None and channel.schema_id != 0:
                raise ValueError(f"topic {channel.topic} has schema {channel.schema_id}, which is not defined")
            self._table[channel.id] = Channel(
                topic=channel.topic,
                type=ros2_name(schema.name) if schema else "",
                encoding=channel.message_encoding,
                schema_encoding=schema.encoding if schema else "",
                definition=schema.data.decode() if schema else "",
            )


def _opening(cursor: Cursor) -> bytes:
    magic = cursor.take(len(MAGIC))
    if magic != MAGIC:
        raise ValueError("it does not begin like an MCAP file")
    return magic


def _ignore(opcode: int, body: bytes) -> None:
    """Schemas and channels are known from the scan."""


def _messages(body: bytes, table: dict[int, Channel], learn: Callable[[int, bytes], None] = _ignore) -> Iterator[Raw]:
    """The messages of an unpacked block."""
    at = 0
    while at < len(body):
        opcode, length = _HEAD.unpack_from(body, at)
        at += _HEAD.size
        if at + length > len(body):
            raise ValueError("a record reaches beyond its block")
        yield from _one(opcode, body[at : at + length], table, learn)
        at += length


def _one(opcode: int, body: bytes, table: dict[int, Channel], learn: Callable[[int, bytes], None]) -> Iterator[Raw]:
    if opcode == Opcode.MESSAGE:
        number, _, log_ns, _ = _MESSAGE.unpack_from(body)
        if number not in table:
            raise ValueError(f"a message belongs to channel {number}, which the file does not declare")
        yield Raw(log_ns, table[number], unpack_message(body[_MESSAGE.size :]))
    else:
        learn(opcode, body)


def _stream(body: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))
