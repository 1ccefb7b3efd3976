"""Small files that unpack, or claim to unpack, to more than anybody should read. Made here, never stored."""

import bz2
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Mapping

import zstandard
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from harness.contracts.dossier import CONTENTS, EVENTS, RECORDS, SIGNATURE
from harness.contracts.ids import sha256

GIB = 2**30


def zipped(files: Mapping[str, bytes | int], *, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A ZIP of these files; a number stands for so many zeros, written piece by piece."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        for name, body in files.items():
            if isinstance(body, bytes):
                archive.writestr(name, body)
                continue
            info = zipfile.ZipInfo(name)
            info.compress_type = compression
            with archive.open(info, "w", force_zip64=True) as file:
                for _ in range(body // 2**20):
                    file.write(bytes(2**20))
    return out.getvalue()


def signed(contents: bytes) -> bytes:
    """A signature by a key that anybody can make."""
    key = Ed25519PrivateKey.generate()
    public, signature = key.public_key().public_bytes_raw().hex(), key.sign(contents).hex()
    return json.dumps({"algorithm": "ed25519", "public_key": public, "signature": signature}).encode()


def dossier_with(files: Mapping[str, str]) -> bytes:
    """A contents list that names these digests."""
    head = {"position": 1, "digest": "0" * 64}
    told = {
        "format": "regenharness-dossier/1", "mission_id": "msn_1", "robot_id": "vbot-1", "goal": "", "status": "",
        "configuration": "0" * 64, "exported_by": "", "exported_at_s": 0.0, "head": head, "events": 0, "records": 0,
        "files": files, "absent": [],
    }  # fmt: skip
    return json.dumps(told).encode()


def huge_contents() -> bytes:
    """1.9 MB whose contents list unpacks to 1.9 GB."""
    deflated = _deflated_zeros(1900)
    return _stored_as_deflated({CONTENTS: (deflated, 1900 * 2**20)})


def huge_blob() -> bytes:
    """A dossier that its maker signed, with a blob of a gigabyte of zeros."""
    contents = dossier_with({EVENTS: sha256(b""), RECORDS: sha256(b""), "blobs/" + "0" * 64: "0" * 64})
    return zipped(
        {CONTENTS: contents, SIGNATURE: signed(contents), EVENTS: b"", RECORDS: b"", "blobs/" + "0" * 64: GIB}
    )


def lying_sizes() -> bytes:
    """A dossier whose directory says that its contents list has 100 bytes; it unpacks to a gigabyte."""
    return _stored_as_deflated({CONTENTS: (_deflated_zeros(1024), 100)})


def _deflated_zeros(mib: int) -> bytes:
    """A mebibyte of zeros, packed once, so many times."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    packed = packer.compress(bytes(2**20)) + packer.flush(zlib.Z_FULL_FLUSH)
    return packed * mib + zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS).flush()


def _stored_as_deflated(files: Mapping[str, tuple[bytes, int]]) -> bytes:
    """A ZIP of streams that are deflated already, each with the size that it claims."""
    out, directory = bytearray(), bytearray()
    for name, (deflated, claimed) in files.items():
        encoded = name.encode()
        common = struct.pack("<HHHHHIIIHH", 20, 0, 8, 0, 0x21, 0, len(deflated), claimed, len(encoded), 0)
        directory += struct.pack("<4sH", b"PK\x01\x02", 20) + common
        directory += struct.pack("<HHHII", 0, 0, 0, 0, len(out)) + encoded
        out += b"PK\x03\x04" + common + encoded + deflated
    count = len(files)
    end = struct.pack("<4sHHHHIIH", b"PK\x05\x06", 0, 0, count, count, len(directory), len(out), 0)
    return bytes(out + directory + end)


def counting_pcd() -> bytes:
    """146 bytes that claim a field of a hundred million numbers a point."""
    return (
        b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z a\nSIZE 4 4 4 8\nTYPE F F F F\nCOUNT 1 1 1 100000000\n"
        b"WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary\n" + bytes(12)
    )


def lzf_pcd(points: int = 33_000_000) -> bytes:
    """About 6 MB of LZF that unpack to `points` points of 16 bytes, all of them nowhere."""
    unpacked = points * 16
    zeros = b"\x00\x00"  # one literal zero
    run = bytes([0xE0, 255, 0x00])  # 264 bytes again, from one byte before
    body = zeros + run * ((unpacked - 1) // 264 + 1)
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        f"WIDTH {points}\nHEIGHT 1\nPOINTS {points}\nDATA binary_compressed\n"
    )
    return head.encode() + struct.pack("<II", len(body), unpacked) + body


def hidden_ply(points: int = 40_000_000) -> bytes:
    """A PLY whose comments push the count of points behind what a reader may look at, or give another one."""
    comments = b"comment element vertex 3\n" * 400
    return (
        b"ply\nformat ascii 1.0\n" + comments
        + f"element vertex {points}\nproperty list int double x\nproperty double y\nproperty double z\n".encode()
        + b"end_header\n0 0 0\n"
    )  # fmt: skip


def counting_las(points: int = 1_000_000_000, *, packed: bool = False) -> bytes:
    """A LAS file of 14 KB whose header claims a thousand million records."""
    head = bytearray(375)
    head[0:4], head[24:26] = b"LASF", b"\x01\x04"
    struct.pack_into("<HIIBH", head, 94, 375, 375, 0, 6 | (0x80 if packed else 0), 30)
    struct.pack_into("<6d", head, 131, 0.001, 0.001, 0.001, 0, 0, 0)
    struct.pack_into("<Q", head, 247, points)
    return bytes(head) + bytes(14_000)


def far_pcd() -> bytes:
    """One point, a million kilometres away."""
    return (
        b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
        b"DATA ascii\n1000000000 0 0\n"
    )


def listing_ply() -> bytes:
    """A PLY whose one point says that it holds a list of four thousand million numbers."""
    return (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty list uint double x\n"
        b"property float y\nproperty float z\nend_header\n" + b"\xff" * 4 + bytes(16)
    )


def mcap_record(opcode: int, body: bytes, *, claimed: int | None = None) -> bytes:
    """One record of an MCAP file; `claimed`: the length that it says it has."""
    return struct.pack("<BQ", opcode, len(body) if claimed is None else claimed) + body


def mcap_chunk(packed: bytes, *, compression: str, claimed: int) -> bytes:
    """A file with one chunk that says it unpacks to `claimed` bytes."""
    name = compression.encode()
    chunk = struct.pack("<QQQII", 0, 1, claimed, 0, len(name)) + name + struct.pack("<Q", len(packed)) + packed
    head = mcap_record(1, struct.pack("<I", 0) + struct.pack("<I", 0))
    return MCAP + head + mcap_record(6, chunk) + mcap_record(2, bytes(20)) + MCAP


MCAP = b"\x89MCAP0\r\n"


def zstd_zeros(mib: int) -> bytes:
    """So many mebibytes of zeros, packed piece by piece; the frame does not say how many."""
    packer = zstandard.ZstdCompressor(level=3).compressobj()
    return b"".join(packer.compress(bytes(2**20)) for _ in range(mib)) + packer.flush()


def packed_messages(count: int = 40) -> bytes:
    """An MCAP of a few kilobytes whose messages unpack to 60 MB each."""
    body = zstandard.compress(bytes(60 * 10**6))
    schema = struct.pack("<HI", 1, 17) + b"nav_msgs/Odometry" + struct.pack("<I", 7) + b"ros2msg" + struct.pack("<I", 0)
    channel = struct.pack("<HHI", 1, 1, 4) + b"/odo" + struct.pack("<I", 3) + b"cdr" + struct.pack("<I", 0)
    inside = mcap_record(3, schema) + mcap_record(4, channel)
    inside += b"".join(
        mcap_record(5, struct.pack("<HIQQ", 1, number, number, number) + body) for number in range(count)
    )
    return mcap_chunk(inside, compression="", claimed=len(inside))


def bag_record(header: Mapping[str, bytes], body: bytes, *, claimed: int | None = None) -> bytes:
    """One record of a ROS 1 bag; `claimed`: the length of data that it says it has."""
    fields = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value for name, value in header.items()
    )
    return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(body) if claimed is None else claimed) + body


def bag_of(*records: bytes) -> bytes:
    """A ROS 1 bag that says it has one chunk."""
    head = {"op": b"\x03", "index_pos": struct.pack("<Q", 4117), "conn_count": bytes(4), "chunk_count": b"\x01\0\0\0"}
    return b"#ROSBAG V2.0\n" + bag_record(head, bytes(4096)) + b"".join(records)


def bag_chunk(compression: str, packed: bytes, *, claimed: int) -> bytes:
    """A bag whose chunk says it unpacks to `claimed` bytes."""
    header = {"op": b"\x05", "compression": compression.encode(), "size": struct.pack("<I", claimed)}
    return bag_of(bag_record(header, packed))


def bz2_zeros(mib: int) -> bytes:
    packer = bz2.BZ2Compressor()
    return b"".join(packer.compress(bytes(2**20)) for _ in range(mib)) + packer.flush()


def alias_metadata() -> str:
    """A metadata.yaml of a few lines that unfolds to a thousand million names."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 9)]
    described = "rosbag2_bagfile_information:\n  storage_identifier: mcap\n  message_count: 1\n"
    return "\n".join([*lines, f"{described}  relative_file_paths: *a8\n"])
