"""What a killed writer left half written is cleared away by the next owner of the data folder, and only by it."""

import signal
from pathlib import Path

from harness.adapters.stores.blobs import FileBlobStore
from harness.bootstrap import edit_harness, open_harness, read_harness
from harness.settings import HarnessSettings
from tests.unit.stores.processes import running

SIZE = 200_000


def tear(data: Path) -> list[Path]:
    """Kill a writer in the middle of a blob; what it left behind."""
    with running("torn", str(data / "blobs"), str(SIZE)) as writer:
        assert writer.wait(timeout=60) == -signal.SIGXFSZ
    return unfinished(data)


def unfinished(data: Path) -> list[Path]:
    return list((data / "blobs" / "incoming").iterdir())


def test_the_owner_of_the_folder_clears_what_a_killed_writer_left(tmp_path: Path) -> None:
    settings = HarnessSettings(data_folder=tmp_path, speed=0, fidelity="kinematic")
    with edit_harness(settings):
        kept = FileBlobStore(tmp_path / "blobs").put(b"whole")
    (left,) = tear(tmp_path)
    assert 0 < left.stat().st_size < SIZE
    with read_harness(settings):
        assert unfinished(tmp_path) == [left]
    with edit_harness(settings) as runtime:
        assert unfinished(tmp_path) == []
        assert runtime.blob(kept) == b"whole"


def test_the_supervisor_clears_it_when_it_opens_the_folder(tmp_path: Path) -> None:
    (tmp_path / "blobs").mkdir()
    assert len(tear(tmp_path)) == 1
    with open_harness(HarnessSettings(data_folder=tmp_path, speed=0, fidelity="kinematic")):
        assert unfinished(tmp_path) == []
