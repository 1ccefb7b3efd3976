"""Reads MCAP files, whole or cut, with mcap's stream reader; checks the entire file before anything counts."""

from collections.abc import Iterable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from zlib import crc32

from mcap import records
from mcap.records import McapRecord
from mcap.stream_reader import StreamReader

from harness.adapters.providers.recording import raw_messages
from harness.adapters.providers.recording.packing import unpack, unpack_message
from harness.adapters.providers.recording.type_names import ros2_name
from harness.contracts.reasons import Reason, because

MAGIC = b"\x89MCAP0\r\n"
RUN_BYTES = 1024 * 1024


class McapReader:
    """One MCAP file, or the splits of one recording in order. With `recover`, a cut file gives its whole part.

    `names` are the files to speak of where `paths` are unpacked copies.
    """

    def __init__(self, paths: Sequence[Path], *, names: Sequence[Path], recover: bool = False) -> None:
        self.channels: list[raw_messages.Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.checks = because("every_block_checked")
        self.cut: Reason | None = None
        self._paths, self._names, self._recover = paths, names, recover
        self._tables: list[dict[int, raw_messages.Channel]] = [{} for _ in paths]
        self._blocks: list[raw_messages.Block] = []

    def scan(self) -> Iterator[raw_messages.Raw]:
        for number, path in enumerate(self._paths):
            table = self._tables[number]
            scan = _Scan(number, table, self._blocks)
            with raw_messages.reading(self._names[number]), path.open("rb") as file:
                cursor = raw_messages.Cursor(file)
                with raw_messages.reading(self._names[number], cursor):
                    yield from scan.read(cursor)
            if scan.cut:
                self.cut = raw_messages.cut_off(
                    scan.cut, whole=scan.count, recover=self._recover, where=str(self._names[number])
                )
            if scan.unchecked:
                self.checks = because("structure_checked")
            self.metadata |= scan.metadata
            self.channels += [channel for channel in table.values() if channel not in self.channels]

    def messages(self, topics: frozenset[str]) -> Iterator[raw_messages.Raw]:
        blocks = [block for block in self._blocks if any(channel.topic in topics for channel in block.channels)]
        return raw_messages.in_time_order(blocks, lambda block: self._load(block, topics))

    def _load(self, block: raw_messages.Block, topics: frozenset[str]) -> list[raw_messages.Raw]:
        table = self._tables[block.file]
        with raw_messages.reading(self._names[block.file]), self._paths[block.file].open("rb") as file:
            file.seek(block.offset)
            body = unpack(file.read(block.length), packing=block.packing, size=block.unpacked)
            found = (_raw(record, table) for record in _inside(body) if isinstance(record, records.Message))
            return [raw for raw in found if raw.channel.topic in topics]


class _Scan:
    """The one full pass over a file: finds blocks, verifies checksums and compares the file's own statistics."""

    def __init__(self, number: int, table: dict[int, raw_messages.Channel], blocks: list[raw_messages.Block]) -> None:
        self.metadata: dict[str, dict[str, str]] = {}
        self.count = 0
        self.cut: Reason | None = None
        self.unchecked = False
        self._number, self._table, self._blocks = number, table, blocks
        self._schemas: dict[int, records.Schema] = {}
        self._declared: int | None = None
        self._summary_from = 0
        self._run: list[raw_messages.Raw] = []
        self._run_from = self._run_until = 0
        self._unguarded = 0
        self._sets: dict[frozenset[raw_messages.Channel], frozenset[raw_messages.Channel]] = {}

    def read(self, cursor: raw_messages.Cursor) -> Iterator[raw_messages.Raw]:
        """All messages in file order; sets `cut` when the file ends early."""
        stream = StreamReader(cursor, emit_chunks=True, validate_crcs=True, record_size_limit=raw_messages.RECORD_LIMIT)  # type: ignore[arg-type]
        end = len(MAGIC)
        try:
            for record in stream.records:
                start, end = end, cursor.at
                if isinstance(record, records.Footer):
                    self._check_summary(record, cursor.again(self._summary_from, end - 4))
                yield from self._record(record, start, end)
            if self._declared is not None and self._declared != self.count:
                raise raw_messages.DamagedBytes(
                    because("message_count_wrong", declared=self._declared, found=self.count)
                )
        except raw_messages.Short:
            last = cursor.at + cursor.left
            self.cut = because("cut_inside_record" if cursor.left else "cut_before_index", byte=last)
        self._close_run()
        self.unchecked = self.unchecked or self._unguarded > 0

    def _check_summary(self, footer: records.Footer, body: bytes) -> None:
        """The library checks the data section, not this one. A checksum of 0 means that there is none."""
        if footer.summary_crc and footer.summary_crc != crc32(body):
            raise raw_messages.DamagedBytes(because("summary_checksum_wrong"))

    def _record(self, record: McapRecord, start: int, end: int) -> Iterator[raw_messages.Raw]:
        """One top-level record between two bytes of the file. What the summary repeats is known already."""
        if isinstance(record, records.Schema | records.Channel | records.Message) and not self._summary_from:
            self._run_from, self._run_until = self._run_from or start, end
            for raw in self._known(record):
                self._unguarded += 1
                self._run.append(raw._replace(body=b""))
                yield raw
            if self._run_until - self._run_from > RUN_BYTES:
                self._close_run()
            return
        self._close_run()
        match record:
            case records.Chunk():
                yield from self._chunk(record, end)
            case records.Metadata():
                self.metadata[record.name] = record.metadata
            case records.Statistics():
                self._declared = record.message_count
            case records.DataEnd():
                self._unguarded = 0 if record.data_section_crc else self._unguarded
                self._summary_from = end
            case _:
                pass

    def _chunk(self, chunk: records.Chunk, end: int) -> Iterator[raw_messages.Raw]:
        body = unpack(chunk.data, packing=chunk.compression, size=chunk.uncompressed_size)
        if chunk.uncompressed_crc and crc32(body) != chunk.uncompressed_crc:
            raise raw_messages.DamagedBytes(because("block_checksum_wrong"))
        messages = [raw for record in _inside(body) for raw in self._known(record)]
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

    def _add(self, offset: int, length: int, messages: Sequence[raw_messages.Raw], packing: str, unpacked: int) -> None:
        self._blocks.append(
            raw_messages.Block(
                file=self._number,
                offset=offset,
                length=length,
                packing=packing,
                unpacked=unpacked,
                first_ns=min(raw.log_ns for raw in messages),
                last_ns=max(raw.log_ns for raw in messages),
                channels=self._shared_channels(raw.channel for raw in messages),
            )
        )

    def _shared_channels(self, channels: Iterable[raw_messages.Channel]) -> frozenset[raw_messages.Channel]:
        found = frozenset(channels)
        return self._sets.setdefault(found, found)

    def _known(self, record: McapRecord) -> Iterator[raw_messages.Raw]:
        """The message that a record is, if it is one; schemas and channels are learnt."""
        match record:
            case records.Message():
                self.count += 1
                yield _raw(record, self._table)
            case records.Schema():
                self._schemas[record.id] = record
            case records.Channel():
                self._table[record.id] = self._channel(record)
            case _:
                pass

    def _channel(self, channel: records.Channel) -> raw_messages.Channel:
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id != 0:
            raise raw_messages.DamagedBytes(because("schema_undefined", topic=channel.topic, schema=channel.schema_id))
        return raw_messages.Channel(
            topic=channel.topic,
            type=ros2_name(schema.name) if schema else "",
            encoding=channel.message_encoding,
            schema_encoding=schema.encoding if schema else "",
            definition=schema.data.decode() if schema else "",
        )


def _inside(body: bytes) -> Iterator[McapRecord]:
    """The records of an unpacked block, or of a run of records outside blocks."""
    cursor = raw_messages.Cursor(BytesIO(body))
    try:
        yield from StreamReader(cursor, skip_magic=True, record_size_limit=raw_messages.RECORD_LIMIT).records  # type: ignore[arg-type]
    except raw_messages.Short:
        if cursor.left:
            raise raw_messages.DamagedBytes(because("record_beyond_block")) from None


def _raw(message: records.Message, table: dict[int, raw_messages.Channel]) -> raw_messages.Raw:
    if message.channel_id not in table:
        raise raw_messages.DamagedBytes(because("channel_undeclared", channel=message.channel_id))
    return raw_messages.Raw(message.log_time, table[message.channel_id], unpack_message(message.data))
