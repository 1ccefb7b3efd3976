"""Feeds changed bytes to every parser of foreign files, each in its limited process: it answers or refuses, no more.

`python -m experiments.campaigns fuzz --minutes 10` runs each parser for so long; parts with other seeds add up. An
offence is a parser that dies, or an exception that is not a typed refusal; exceeding a limit is a refusal.
"""

import argparse
import io
import json
import random
import struct
import tempfile
import time
import zipfile
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import laspy
import numpy as np
from msgspec import to_builtins
from pypcd4.pypcd4 import PointCloud
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from experiments.campaigns.code import code_digest
from experiments.campaigns.fuzz_page import FuzzRun, publish
from harness.adapters.bounded_yaml import plain_values
from harness.adapters.clouds import read_cloud
from harness.adapters.limited_process import LimitedProcess, Limits, Work
from harness.adapters.pictures import looked_at, size_of
from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.stores.anchors import parsed_anchors
from harness.adapters.stores.dossier import open_dossier
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import Reason

ROOT = Path(__file__).resolve().parents[2]
LIMITS = Limits(memory_bytes=256 * 2**20, cpu_s=20.0, wall_s=120.0, output_bytes=64 * 2**20)
UNTYPED, DIED = "parser_failed", "parser_died"
ODOMETRY = "nav_msgs/msg/Odometry"


def dossier(body: bytes) -> bytes:
    """Open it as `regen verify` does, without deriving the decisions again."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(body))
    except (OSError, zipfile.BadZipFile, RuntimeError, ValueError):
        return b""
    with archive:
        open_dossier(archive, where="fuzzed")
    return b""


def pcd(body: bytes) -> bytes:
    """Read it as `regen map import` does."""
    return _read(body, "cloud.pcd", read_cloud)


def las(body: bytes) -> bytes:
    """A point cloud in LAS."""
    return _read(body, "cloud.las", read_cloud)


def laz(body: bytes) -> bytes:
    """A point cloud in LAZ."""
    return _read(body, "cloud.laz", read_cloud)


def ply(body: bytes) -> bytes:
    """Read it as `regen map import` does."""
    return _read(body, "cloud.ply", read_cloud)


def mcap(body: bytes) -> bytes:
    """Read it whole as `regen mission replay` does."""
    return _read(body, "drive.mcap", _samples)


def bag_folder(body: bytes) -> bytes:
    """Read a rosbag2 folder with this metadata."""
    return _read(body, "metadata.yaml", lambda file: _samples(file.parent))


def bag(body: bytes) -> bytes:
    """Read a ROS 1 bag whole as `regen mission replay` does."""
    return _read(body, "drive.bag", _samples)


def yaml_text(body: bytes) -> bytes:
    """Read it as a site file or a candidate."""
    plain_values(body.decode(errors="replace"), where="fuzzed")
    return b""


def anchors(body: bytes) -> bytes:
    """Read it as `regen audit verify --anchor` does."""
    parsed_anchors(body.decode(errors="replace"))
    return b""


def image(body: bytes) -> bytes:
    """Decode it as a robot's camera image, and as one of a recording."""
    for work in (size_of, partial(looked_at, Digest(""))):
        work(body)
    return b""


def _read(body: bytes, name: str, reader: Callable[[Path], object]) -> bytes:
    with tempfile.TemporaryDirectory(prefix="regen-fuzz-") as folder:
        file = Path(folder) / name
        file.write_bytes(body)
        reader(file)
    return b""


def _samples(path: Path) -> None:
    with open_recording(path, size_of=size_of) as recording:
        for _ in recording.samples():
            pass


def _scatter() -> PointCloud:
    return PointCloud.from_xyz_points(np.arange(300, dtype=np.float32).reshape(-1, 3))


def _pcd_seed() -> bytes:
    into = io.BytesIO()
    _scatter().save(into)
    return into.getvalue()


def _ply_seed() -> bytes:
    head = "ply\nformat ascii 1.0\ncomment made here\nelement vertex 3\nproperty float x\nproperty float y\n"
    return (head + "property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n").encode()


def _las_seed(name: str = "seed.las") -> bytes:
    with tempfile.TemporaryDirectory(prefix="regen-fuzz-") as folder:
        written = laspy.LasData(laspy.LasHeader(point_format=1, version="1.2"))
        written.x, written.y, written.z = np.arange(300.0).reshape(3, -1)
        written.write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def _dossier_seed() -> bytes:
    into = io.BytesIO()
    with zipfile.ZipFile(into, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("dossier.json", "signature.json", "events.jsonl", "records.jsonl"):
            archive.writestr(name, json.dumps({"algorithm": "ed25519", "public_key": "00", "signature": "00"}))
    return into.getvalue()


def _mcap_seed() -> bytes:
    return (ROOT / "tests" / "fixtures" / "warehouse-inspection.mcap").read_bytes()


def _image_seed() -> bytes:
    blobs: list[bytes] = []

    def keep(body: bytes) -> Digest:
        blobs.append(body)
        return sha256(body)

    with open_recording(ROOT / "tests" / "fixtures" / "warehouse-inspection.mcap", size_of=size_of) as recording:
        for _ in recording.samples(keep):
            pass
    return next(body for body in blobs if body.startswith(b"\xff\xd8"))


def _bag_seed() -> bytes:
    with tempfile.TemporaryDirectory(prefix="regen-fuzz-") as folder:
        file = Path(folder) / "seed.bag"
        with Writer(file) as writer:
            channel = writer.add_connection("/odom", ODOMETRY, typestore=get_typestore(Stores.ROS1_NOETIC))
            for number in range(1, 50):
                head = struct.pack("<IIII4sI4s", number, number, 0, 4, b"odom", 4, b"base")
                writer.write(channel, number * 10**9, head + struct.pack("<85d", *bytes(6), 1, *bytes(78)))
        return file.read_bytes()


def _metadata_seed() -> bytes:
    return (
        b"rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  message_count: 1\n"
        b"  relative_file_paths:\n    - metadata.yaml\n  compression_mode: FILE\n"
    )


@dataclass(frozen=True)
class FuzzedParser:
    """A parser and one file that it reads, or nearly."""

    work: Work
    seed: Callable[[], bytes]


PARSERS: Mapping[str, FuzzedParser] = {
    "dossier": FuzzedParser(dossier, _dossier_seed),
    "pcd": FuzzedParser(pcd, _pcd_seed),
    "ply": FuzzedParser(ply, _ply_seed),
    "las": FuzzedParser(las, _las_seed),
    "laz": FuzzedParser(laz, lambda: _las_seed("seed.laz")),
    "mcap": FuzzedParser(mcap, _mcap_seed),
    "bag folder": FuzzedParser(bag_folder, _metadata_seed),
    "bag": FuzzedParser(bag, _bag_seed),
    "yaml": FuzzedParser(yaml_text, lambda: (ROOT / "harness" / "baseline" / "site" / "site.yaml").read_bytes()),
    "image": FuzzedParser(image, _image_seed),
    "anchors": FuzzedParser(anchors, lambda: f"12 {'0a' * 32}\n".encode()),
}


@dataclass
class FuzzReport:
    """What became of one parser: files tried, read, refused with a reason, refused by a limit; and what must not be."""

    tried: int = 0
    read: int = 0
    refused: int = 0
    limited: int = 0
    offences: list[str] = field(default_factory=list)


def fuzz_parser(fuzzed: FuzzedParser, *, seed: int, seconds: float = 0.0, files: int = 0) -> FuzzReport:
    """Changed files for so long, or so many. The same seed gives the same files."""
    chance, whole, report = random.Random(seed), fuzzed.seed(), FuzzReport()
    until = time.monotonic() + seconds
    with closing(LimitedProcess(fuzzed.work, LIMITS, failure=ContractInvalid)) as child:
        while report.tried < files or time.monotonic() < until:
            report.tried += 1
            try:
                child.run(changed(whole, chance))
                report.read += 1
            except HarnessError as error:
                _count(report, error)
    return report


def _count(report: FuzzReport, error: HarnessError) -> None:
    code = error.what.code if isinstance(error.what, Reason) else ""
    if code in (UNTYPED, DIED):
        report.offences.append(str(error))
    elif code.startswith("parser_"):
        report.limited += 1
    else:
        report.refused += 1


def changed(whole: bytes, chance: random.Random) -> bytes:
    """The file with a few changes: bits, bytes, numbers, pieces taken out, doubled or cut off."""
    body = bytearray(whole)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(body) + 1)
        piece = slice(at, at + chance.randint(1, 64))
        match chance.randrange(7):
            case 0 if at < len(body):
                body[at] ^= 1 << chance.randrange(8)
            case 1:
                body[piece] = chance.randbytes(chance.randint(0, 16))
            case 2:
                body[at:at] = body[piece] * chance.randint(1, 50)
            case 3:
                del body[piece]
            case 4:
                body[at : at + 4] = chance.choice((b"\xff" * 4, bytes(4), b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f"))
            case 5:
                body[piece] = str(chance.choice((-1, 0, 2**31, 2**63, 10**30, 1e308))).encode()
            case _:
                del body[at:]
    return bytes(body)


def run(arguments: argparse.Namespace) -> None:
    """Every parser, or those that are named, for so many minutes; exit 1 if one has an offence."""
    code, runs = code_digest(), {}
    for name in arguments.only or PARSERS:
        began_s = time.monotonic()
        report = fuzz_parser(PARSERS[name], seed=arguments.seed, seconds=60 * arguments.minutes)
        runs[name] = FuzzRun(
            seed=arguments.seed,
            seconds=round(time.monotonic() - began_s, 1),
            code=code,
            tried=report.tried,
            read=report.read,
            refused=report.refused,
            limited=report.limited,
            offences=tuple(report.offences),
        )
    print(json.dumps({name: to_builtins(one) for name, one in runs.items()}, indent=2))
    if arguments.publish:
        publish(runs)
    if any(one.offences for one in runs.values()):
        raise SystemExit(1)
