"""A file that is replaced is the old one or the new one, and nothing is left beside it."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from harness.adapters.replaced_files import OWN, replacing
from tests.integration.runs import ROOT

KILLED = """
import os, signal, sys
from pathlib import Path
from harness.adapters.replaced_files import replacing
with replacing(Path(sys.argv[1])) as file:
    file.write(b"half")
    file.flush()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_file_is_replaced_whole_and_nothing_stays_beside_it(tmp_path: Path) -> None:
    place = tmp_path / "jobs.json"
    place.write_bytes(b"old")
    with replacing(place, mode=OWN) as file:
        file.write(b"new")
        assert place.read_bytes() == b"old"
    assert place.read_bytes() == b"new" and list(tmp_path.iterdir()) == [place]
    assert place.stat().st_mode & 0o777 == 0o600


def test_an_error_on_the_way_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    place = tmp_path / "jobs.json"
    place.write_bytes(b"old")
    with pytest.raises(OverflowError), replacing(place) as file:
        file.write((1 << 70).to_bytes(1))
    assert place.read_bytes() == b"old" and list(tmp_path.iterdir()) == [place]


def test_a_writer_that_is_killed_leaves_the_old_file_and_the_next_one_writes_over_what_it_left(tmp_path: Path) -> None:
    place = tmp_path / "jobs.json"
    place.write_bytes(b"old")
    killed = subprocess.run([sys.executable, "-c", KILLED, str(place)], cwd=ROOT, check=False)
    assert killed.returncode == -signal.SIGKILL and place.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 2
    with replacing(place) as file:
        file.write(b"new")
    assert place.read_bytes() == b"new" and list(tmp_path.iterdir()) == [place]


def test_a_folder_that_is_not_there_is_the_callers_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "none" / "jobs.json"):
        os.abort()
