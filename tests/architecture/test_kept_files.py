"""Checks the files of the repository: no path of a development machine, no large file, no index address in a lock."""

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from tests.architecture.sources import ROOT, kept_files

MACHINE_PATH = re.compile(r"(?<![\w.~])/(?:work|farm|root|home/\w+|Users/\w+)/[\w.-]+")
LOCKS = ("requirements.lock", "requirements-test.lock")
LARGEST_BYTES = 4 * 2**20
PUBLIC = frozenset({"localhost", "127.0.0.1", "pypi.org", "github.com"})


def texts() -> Iterator[tuple[str, str]]:
    """(path, text) of every tracked file that is text and not a third party's."""
    for path in kept_files():
        if "/vendor/" not in path:
            body = (ROOT / path).read_bytes()
            if b"\0" not in body:
                yield path, body.decode("utf-8", errors="replace")


def machine_paths(path: str, text: str) -> Iterator[str]:
    """Every absolute path that only exists on somebody's machine."""
    for number, line in enumerate(text.splitlines(), start=1):
        yield from (f"{path}:{number} {found}" for found in MACHINE_PATH.findall(line))


def index_hosts() -> frozenset[str]:
    """Hosts that this machine's pip gets packages from, other than the public ones."""
    command = [sys.executable, "-m", "pip", "config", "list"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    hosts = {urlsplit(url).hostname or "" for url in re.findall(r"https?://[^\s'\"]+", answer.stdout)}
    return frozenset(hosts - PUBLIC - {""})


def named_index(text: str) -> list[str]:
    """Lines of a lock that name where packages come from."""
    return [line for line in text.splitlines() if "://" in line or re.search(r"--(extra-)?index|--find-links", line)]


def test_no_file_names_a_path_of_a_machine() -> None:
    assert [found for path, text in texts() for found in machine_paths(path, text)] == []


def test_a_path_of_a_machine_is_found() -> None:
    assert list(machine_paths("x", "open('" + "/ro" + "ot/x.txt')"))
    assert not list(machine_paths("x", "GET /missions/x and ../shared/data and https://example.org/work/x"))


def test_no_file_names_the_host_of_a_private_index() -> None:
    hosts = index_hosts()
    assert [f"{path} names {host}" for path, text in texts() for host in hosts if host in text] == []


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_names_no_index_and_hashes_everything(lock: str) -> None:
    text = (ROOT / lock).read_text()
    assert named_index(text) == []
    entries = re.split(r"\n(?=[A-Za-z0-9])", text.strip())
    assert [entry.split()[0] for entry in entries if "--hash=sha256:" not in entry] == []


def test_an_index_in_a_lock_is_found() -> None:
    assert named_index("--extra-index-url http" + "s://example.org/simple\nx==1") != []


def test_the_locks_cover_every_declared_dependency() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for lock, wanted in (
        ("requirements.lock", project["dependencies"]),
        ("requirements-test.lock", [*project["dependencies"], *project["optional-dependencies"]["test"]]),
    ):
        locked = set(re.findall(r"^([a-z0-9-]+)==", (ROOT / lock).read_text(), re.MULTILINE))
        names = {re.split(r"[^A-Za-z0-9._-]", entry)[0].lower().replace("_", "-") for entry in wanted}
        assert names - locked == set()


def test_both_locks_agree_on_every_version() -> None:
    pins = [dict(re.findall(r"^([a-z0-9-]+)==(\S+)", (ROOT / lock).read_text(), re.MULTILINE)) for lock in LOCKS]
    assert {name: (pin, pins[1].get(name)) for name, pin in pins[0].items() if pins[1].get(name) != pin} == {}


def test_nothing_large_is_carried() -> None:
    assert [path for path in kept_files() if (ROOT / path).stat().st_size > LARGEST_BYTES] == []
