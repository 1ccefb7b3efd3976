"""Small foreign files that unpack to gigabytes are refused by their commands, with a reason, little memory and time."""

import json
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.builders import bombs
from tests.integration.runs import ROOT, environment

MOST_MIB, MOST_CPU_S = 400, 30.0
Run = Callable[..., "Ended"]


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code, what it wrote to standard error, and the peak of it and its children."""

    code: int
    said: str
    peak_mib: float
    cpu_s: float


MEASURED = """
import json, os, sys
import app.cli.dossiers, app.cli.local_api, app.cli.maps
from app.cli.main import main
for line in sys.stdin:
    asked = json.loads(line)
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_RDWR), 0)
        os.dup2(0, 1)
        os.dup2(os.open(asked["stderr"], os.O_WRONLY | os.O_CREAT), 2)
        sys.argv = ["regen", *asked["words"]]
        main()
        os._exit(0)
    _, status, used = os.wait4(child, 0)
    print(os.waitstatus_to_exitcode(status), used.ru_maxrss, used.ru_utime + used.ru_stime, flush=True)
"""
"""Has loaded what these commands load, nothing else, and becomes one command after the other: a command's peak counts
what was loaded before, as in a process of its own.
"""


@pytest.fixture(scope="module")
def ended() -> Iterator[Run]:
    """Runs a command to its end and measures it; what it says is written to the folder."""
    words = [sys.executable, "-c", MEASURED]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, cwd=ROOT, env=environment(), stdin=pipe, stdout=pipe, text=True) as measuring:
        into, out = measuring.stdin, measuring.stdout
        assert into is not None and out is not None

        def run(*asked: object, folder: Path) -> Ended:
            errors = folder / "stderr"
            into.write(json.dumps({"words": [str(word) for word in asked], "stderr": str(errors)}) + "\n")
            into.flush()
            code, peak_kib, cpu_s = out.readline().split()
            return Ended(int(code), errors.read_text(), int(peak_kib) / 1024, float(cpu_s))

        yield run
        into.close()


def refused(found: Ended, says: str) -> None:
    assert found.code == 1 and says in found.said, found
    assert "Traceback" not in found.said and found.said.count("\n") == 1, found
    assert found.peak_mib <= MOST_MIB and found.cpu_s <= MOST_CPU_S, found


@pytest.mark.parametrize(
    ("bomb", "says"),
    [
        (bombs.huge_contents, "dossier.json unpacks to 1992294400 bytes"),
        (bombs.huge_blob, "it unpacks from"),
        (bombs.lying_sizes, "dossier.json is missing or damaged"),
        (lambda: bombs.zipped({"dossier.json": b"{}"}, compression=zipfile.ZIP_LZMA), "compressed in another way"),
        (lambda: bombs.zipped({f"blobs/{n}": b"" for n in range(60_000)}), "dossier.json is missing"),
        (lambda: b"PK\x05\x06" + bytes(18), "dossier.json is missing"),
        (lambda: b"not a zip", "The file is no dossier"),
    ],
    ids=["contents of 1.9 GB", "signed blob of 1 GB", "lying sizes", "lzma", "60,000 files", "empty", "text"],
)
def test_regen_verify_refuses_a_bomb(bomb: Callable[[], bytes], says: str, ended: Run, tmp_path: Path) -> None:
    (tmp_path / "bomb.zip").write_bytes(bomb())
    refused(ended("verify", tmp_path / "bomb.zip", folder=tmp_path), says)


@pytest.mark.parametrize(
    ("name", "bomb", "says"),
    [
        ("counting.pcd", bombs.counting_pcd, "has 100000003 numbers"),
        ("lzf.pcd", bombs.lzf_pcd, "promises 33000000 points"),
        ("hidden.ply", bombs.hidden_ply, "promises 40000000 points"),
        ("far.pcd", bombs.far_pcd, "lie more than 100000.0 km from the origin"),
        ("list.ply", bombs.listing_ply, "point cloud"),
        ("records.las", bombs.counting_las, "promises 1000000000 points"),
        ("records.laz", lambda: bombs.counting_las(packed=True), "50000000 points"),
        ("packed.laz", lambda: bombs.counting_las(1_000_000, packed=True), "does not hold together"),
    ],
)
def test_regen_map_import_refuses_a_bomb(
    name: str, bomb: Callable[[], bytes], says: str, ended: Run, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(bomb())
    said = ("--frame", "map", "--metres-per-unit", "1")
    refused(ended("map", "import", tmp_path / name, *said, "--data", tmp_path / "data", folder=tmp_path), says)
