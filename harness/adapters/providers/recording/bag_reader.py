"""Reads ROS 1 bags (format 2.0), whole or cut, with rosbags. Checks structure and index: bags have no checksums."""

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from rosbags.rosbag1.reader import Header, RecordType, read_bytes, read_uint32

from harness.adapters.providers.recording import raw_messages
from harness.adapters.providers.recording.packing import unpack
from harness.adapters.providers.recording.type_names import ros2_name
from harness.contracts.reasons import Reason, because

MAGIC = b"#ROSBAG V2.0\n"


class BagReader:
    """One .bag file. With `recover`, a cut or unindexed bag gives its whole part."""

    def __init__(self, path: Path, *, recover: bool = False) -> None:
        self.channels: list[raw_messages.Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.checks = because("index_checked")
        self.cut: Reason | None = None
        self._path, self._recover = path, recover
        self._table: dict[int, raw_messages.Channel] = {}
        self._blocks: list[raw_messages.Block] = []
        self._count = self._indexed = self._chunks = self._declared_chunks = 0

    def scan(self) -> Iterator[raw_messages.Raw]:
        with raw_messages.reading(self._path), self._path.open("rb") as file:
            cursor = raw_messages.Cursor(file)
            with raw_messages.reading(self._path, cursor):
                try:
                    self._opening(cursor)
                    while cursor.left:
                        header, body = _record(cursor)
                        yield from self._read(header, body, cursor.at)
                except raw_messages.Short:
                    self.cut = because("cut_inside_record", byte=cursor.at + cursor.left)
                self._close()
        self.channels = list(dict.fromkeys(self._table.values()))

    def messages(self, topics: frozenset[str]) -> Iterator[raw_messages.Raw]:
        blocks = [block for block in self._blocks if any(channel.topic in topics for channel in block.channels)]
        return raw_messages.in_time_order(blocks, lambda block: self._load(block, topics))

    def _load(self, block: raw_messages.Block, topics: frozenset[str]) -> list[raw_messages.Raw]:
        with raw_messages.reading(self._path), self._path.open("rb") as file:
            file.seek(block.offset)
            body = unpack(file.read(block.length), packing=block.packing, size=block.unpacked)
            return [raw for raw in self._messages(body) if raw.channel.topic in topics]

    def _opening(self, cursor: raw_messages.Cursor) -> None:
        if cursor.read(len(MAGIC)) != MAGIC:
            raise raw_messages.DamagedBytes(because("bag_format_unknown"))
        header, _ = _record(cursor)
        self._declared_chunks = header.get_uint32("chunk_count")
        if header.get_uint64("index_pos") == 0:
            self.cut = because("bag_without_index")

    def _close(self) -> None:
        if not self.cut and (self._chunks, self._count) != (self._declared_chunks, self._indexed):
            raise raw_messages.DamagedBytes(
                because(
                    "bag_index_wrong",
                    declared_blocks=self._declared_chunks,
                    declared=self._indexed,
                    blocks=self._chunks,
                    found=self._count,
                )
            )
        if self.cut:
            where = str(self._path)
            self.cut = raw_messages.cut_off(self.cut, whole=self._count, recover=self._recover, where=where)

    def _read(self, header: Header, body: bytes, end: int) -> Iterator[raw_messages.Raw]:
        match header.get_uint8("op"):
            case RecordType.CHUNK:
                packing, size = header.get_string("compression"), header.get_uint32("size")
                unpacked = unpack(body, packing=packing, size=size)
                messages = list(self._messages(unpacked))
                self._chunks += 1
                self._count += len(messages)
                if messages:
                    self._blocks.append(
                        raw_messages.Block(
                            file=0,
                            offset=end - len(body),
                            length=len(body),
                            packing=packing,
                            unpacked=size,
                            first_ns=min(raw.log_ns for raw in messages),
                            last_ns=max(raw.log_ns for raw in messages),
                            channels=frozenset(raw.channel for raw in messages),
                        )
                    )
                yield from messages
            case RecordType.CONNECTION:
                self._learn(header, body)
            case RecordType.CHUNK_INFO:
                self._indexed += sum(count for _, count in struct.iter_unpack("<II", body))
            case _:
                pass

    def _messages(self, body: bytes) -> Iterator[raw_messages.Raw]:
        cursor = raw_messages.Cursor(BytesIO(body))
        while cursor.left:
            try:
                header, content = _record(cursor)
            except raw_messages.Short:
                raise raw_messages.DamagedBytes(because("record_beyond_block")) from None
            match header.get_uint8("op"):
                case RecordType.CONNECTION:
                    self._learn(header, content)
                case RecordType.MSGDATA:
                    number = header.get_uint32("conn")
                    if number not in self._table:
                        raise raw_messages.DamagedBytes(because("channel_undeclared", channel=number))
                    yield raw_messages.Raw(header.get_time("time"), self._table[number], content)
                case _:
                    pass

    def _learn(self, header: Header, body: bytes) -> None:
        described = Header.read(BytesIO(struct.pack("<I", len(body)) + body))
        self._table[header.get_uint32("conn")] = raw_messages.Channel(
            topic=header.get_string("topic"),
            type=ros2_name(described.get_string("type")),
            encoding="ros1",
            schema_encoding="ros1msg",
            definition=described.get_string("message_definition") if "message_definition" in described else "",
        )


def _record(cursor: raw_messages.Cursor) -> tuple[Header, bytes]:
    """The next record's header and body. Raises Short where the file or the block ends inside it."""
    file: Any = cursor
    return Header.read(file), read_bytes(file, read_uint32(file))
