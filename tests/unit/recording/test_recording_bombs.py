"""Small recordings that unpack, or claim to unpack, to gigabytes are refused, in a process with limits."""

import struct
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from harness.adapters.limited_process import LimitedProcess
from harness.adapters.providers.recording.limits import recording_limits
from harness.contracts.errors import RecordingInvalid
from harness.contracts.values import encode
from harness.recordings import RecordingToRead, open_checked, read_whole
from tests.builders import bombs

MOST_S = 30.0
FOLDER = "rosbag2_bagfile_information:\n  storage_identifier: {}\n  message_count: {}\n  relative_file_paths: [{}]\n"

FILES = {
    "a chunk of a gigabyte that says 100 bytes": lambda: bombs.mcap_chunk(
        bombs.zstd_zeros(1024), compression="zstd", claimed=100
    ),
    "a chunk that says 16 exbibytes": lambda: bombs.mcap_chunk(b"x", compression="zstd", claimed=2**64 - 1),
    "a chunk of a gigabyte that says so": lambda: bombs.mcap_chunk(
        bombs.zstd_zeros(1024), compression="zstd", claimed=2**30
    ),
    "a record that says 16 exbibytes": lambda: bombs.MCAP + bombs.mcap_record(1, b"", claimed=2**64 - 1),
    "a string in a record that says four gigabytes": lambda: (
        bombs.MCAP + bombs.mcap_record(1, struct.pack("<I", 2**32 - 1))
    ),
    "forty messages of 60 MB in one chunk": bombs.packed_messages,
    "a packed file of half a gigabyte": lambda: bombs.zstd_zeros(512),
    "a bag chunk of 64 MB that says 100 bytes": lambda: bombs.bag_chunk("bz2", bombs.bz2_zeros(64), claimed=100),
    "a bag chunk that says four gigabytes": lambda: bombs.bag_chunk("bz2", bombs.bz2_zeros(1), claimed=2**32 - 1),
    "a bag record that says four gigabytes": lambda: bombs.bag_of(
        bombs.bag_record({"op": b"\x05"}, b"", claimed=2**32 - 1)
    ),
    "a bag header that says four gigabytes": lambda: b"#ROSBAG V2.0\n" + b"\xff" * 8,
}


@pytest.fixture(scope="module")
def reader() -> Iterator[LimitedProcess]:
    """The process that a recording is read in first, kept for all of these."""
    with closing(LimitedProcess(read_whole, recording_limits(Path(__file__)), failure=RecordingInvalid)) as child:
        yield child


def refused(reader: LimitedProcess, path: Path) -> RecordingInvalid:
    asked = encode(RecordingToRead(path=str(path), topics="{}"))
    began_s = time.monotonic()
    with pytest.raises(RecordingInvalid) as caught:
        reader.run(asked, where=str(path))
    assert time.monotonic() - began_s < MOST_S
    return caught.value


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_unpacks_to_more_than_it_may_is_refused(reader: LimitedProcess, name: str, tmp_path: Path) -> None:
    file = tmp_path / "drive.rec"
    file.write_bytes(FILES[name]())
    assert file.stat().st_size < 2**20
    assert refused(reader, file).reason.code not in ("parser_failed", "parser_died")


def test_a_bomb_is_refused_before_a_replay_begins(tmp_path: Path) -> None:
    file = tmp_path / "drive.mcap"
    file.write_bytes(bombs.packed_messages())
    began_s = time.monotonic()
    with pytest.raises(RecordingInvalid) as caught:
        open_checked(file)
    assert caught.value.reason.code == "parser_out_of_memory"
    assert time.monotonic() - began_s < MOST_S


@pytest.mark.parametrize(
    "text",
    [
        bombs.alias_metadata(),
        "rosbag2_bagfile_information: " + "[" * 10_000,
        FOLDER.format("mcap", -1, "a.mcap"),
        FOLDER.format("mcap", "1" * 5000, "a.mcap"),
        FOLDER.format("mcap", 1, "[a, b]"),
        "rosbag2_bagfile_information: {storage_identifier: mcap, storage_identifier: sqlite3}\n",
        "rosbag2_bagfile_information: []\n",
        "rosbag2_bagfile_information:\n" + "  a: 1\n" * 800_000,
    ],
    ids=["aliases", "depth", "negative", "5000 digits", "nested", "twice", "a list", "too long"],
)
def test_a_folder_whose_metadata_is_a_bomb_or_a_lie_is_refused(
    reader: LimitedProcess, text: str, tmp_path: Path
) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    (folder / "metadata.yaml").write_text(text)
    assert refused(reader, folder).reason.code == "recording_metadata_unusable"
