"""ROS 1 bags (format 2.0) as a tape. The format has no checksums of its own: structure and index are compared."""

import struct
from collections.abc import Iterator
from pathlib import Path

from harness.adapters.providers.recording.packing import unpack
from harness.adapters.providers.recording.tape import Block, Channel, Cursor, Raw, Short, in_time_order, reading
from harness.adapters.providers.recording.type_names import ros2_name
from harness.contracts.errors import RecordingInvalid

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG_HEADER, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 5, 6, 7
_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")
_Fields = dict[bytes, bytes]


class BagTape:
    """One .bag file. With `recover`, a cut or unindexed bag gives its whole part."""

    def __init__(self, path: Path, *, recover: bool = False) -> None:
        self.channels: list[Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.checks = "structure and index compared; the format carries no checksums"
        self.cut = ""
        self._path, self._recover = path, recover
        self._table: dict[int, Channel] = {}
        self._blocks: list[Block] = []
        self._count = self._indexed = self._chunks = self._declared_chunks = 0

    def scan(self) -> Iterator[Raw]:
        with reading(self._path), self._path.open("rb") as file:
            cursor = Cursor(file)
            with reading(self._path, cursor):
                try:
                    self._opening(cursor)
                    while cursor.left:
                        fields, body = _record(cursor)
                        yield from self._read(fields, body, cursor.at)
                except Short:
                    self.cut = f"The bag is truncated: it ends at byte {cursor.at + cursor.left} inside a record"
                self._close()
        self.channels = list(dict.fromkeys(self._table.values()))

    def messages(self, topics: frozenset[str]) -> Iterator[Raw]:
        blocks = [block for block in self._blocks if any(channel.topic in topics for channel in block.channels)]
        return in_time_order(blocks, lambda block: self._load(block, topics))

    def _load(self, block: Block, topics: frozenset[str]) -> list[Raw]:
        with reading(self._path), self._path.open("rb") as file:
            file.seek(block.offset)
            body = unpack(file.read(block.length), packing=block.packing, size=block.unpacked)
            return [raw for raw in self._messages(body) if raw.channel.topic in topics]

    def _opening(self, cursor: Cursor) -> None:
        if cursor.take(len(MAGIC)) != MAGIC:
            raise ValueError("it is no bag of format 2.0")
        fields, _ = _record(cursor)
        self._declared_chunks = _uint(fields, b"chunk_count")
        if struct.unpack("<Q", _field(fields, b"index_pos"))[0] == 0:
            self.cut = "The bag has no index: its recorder was cut off"

    def _close(self) -> None:
        if not self.cut and (self._chunks, self._count) != (self._declared_chunks, self._indexed):
            raise ValueError(
                f"its index declares {self._declared_chunks} blocks with {self._indexed} messages; "
                f"it holds {self._chunks} with {self._count}"
            )
        if self.cut and not self._recover:
            raise RecordingInvalid(
                self.cut,
                where=str(self._path),
                do=f"{self._count} messages before that are whole: copy the file again, reindex it, or open it with "
                "recovery, which labels it incomplete",
            )
        self.cut = self.cut and f"{self.cut}; {self._count} messages before that are whole"

    def _read(self, fields: _Fields, body: bytes, end: int) -> Iterator[Raw]:
        match _field(fields, b"op")[0]:
            case op if op == _CHUNK:
                packing, size = _field(fields, b"compression").decode(), _uint(fields, b"size")
                unpacked = unpack(body, packing=packing, size=size)
                messages = list(self._messages(unpacked))
                self._chunks += 1
                self._count += len(messages)
                if messages:
                    self._blocks.append(
                        Block(
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
            case op if op == _CONNECTION:
                self._learn(fields, body)
            case op if op == _CHUNK_INFO:
                self._indexed += sum(count for _, count in struct.iter_unpack("<II", body))
            case _:
                pass

    def _messages(self, body: bytes) -> Iterator[Raw]:
        at = 0
        while at < len(body):
            head, at = _slice(body, at)
            content, at = _slice(body, at)
            fields = _fields(head)
            op = _field(fields, b"op")[0]
            if op == _CONNECTION:
                self._learn(fields, content)
            elif op == _MESSAGE:
                number = _uint(fields, b"conn")
                if number not in self._table:
                    raise ValueError(f"a message belongs to connection {number}, which the bag does not declare")
                seconds, nanoseconds = _TIME.unpack(_field(fields, b"time"))
                yield Raw(seconds * 10**9 + nanoseconds, self._table[number], content)

    def _learn(self, fields: _Fields, body: bytes) -> None:
        described = _fields(body)
        self._table[_uint(fields, b"conn")] = Channel(
            topic=_field(fields, b"topic").decode(),
            type=ros2_name(_field(described, b"type").decode()),
            encoding="ros1",
            schema_encoding="ros1msg",
            definition=described.get(b"message_definition", b"").decode(),
        )


def _record(cursor: Cursor) -> tuple[_Fields, bytes]:
    head = cursor.take(_LENGTH.unpack(cursor.take(_LENGTH.size))[0])
    return _fields(head), cursor.take(_LENGTH.unpack(cursor.take(_LENGTH.size))[0])


def _slice(body: bytes, at: int) -> tuple[bytes, int]:
    (length,) = _LENGTH.unpack_from(body, at)
    end = at + _LENGTH.size + length
    if end > len(body):
        raise ValueError("a record reaches beyond its block")
    return body[at + _LENGTH.size : end], end


def _fields(head: bytes) -> _Fields:
    fields: _Fields = {}
    at = 0
    while at < len(head):
        field, at = _slice(head, at)
        name, _, value = field.partition(b"=")
        fields[name] = value
    return fields


def _field(fields: _Fields, name: bytes) -> bytes:
    if name not in fields:
        raise ValueError(f"a record lacks its field {name.decode()}")
    return fields[name]


def _uint(fields: _Fields, name: bytes) -> int:
    return int(_LENGTH.unpack(_field(fields, name))[0])
