"""The bill of materials says what the lock says: every package, its version and hashes, who needs it, its licence."""

import hashlib
import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from tools.sbom import ROOT, bill, licence_of, pins, vendored

LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
SMALL = (
    "alpha==1.0 \\\n    --hash=sha256:" + "a" * 64 + " \\\n    --hash=sha256:" + "b" * 64 + "\n"
    "    # via regenharness (pyproject.toml)\n"
    "beta-core==2.0 ; sys_platform == 'win32' \\\n    --hash=sha256:" + "c" * 64 + "\n"
    "    # via\n    #   alpha\n    #   regenharness (pyproject.toml)\n"
)


def written(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tools.sbom", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    file = tmp_path_factory.mktemp("bill") / "new" / "bill.json"
    answer = written("--to", str(file))
    assert answer.returncode == 0, answer.stderr
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def packages(made: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {one["purl"]: one for one in made["components"] if "purl" in one}


def test_every_pin_of_the_lock_is_a_component_with_its_own_hashes(made: dict[str, Any]) -> None:
    named = re.findall(r"^([a-z0-9][\w.-]*)==([^\s;]+)", LOCK, re.MULTILINE)
    assert set(packages(made)) == {f"pkg:pypi/{name.replace('_', '-')}@{version}" for name, version in named}
    hashes = [
        one["content"]
        for component in packages(made).values()
        for reference in component["externalReferences"]
        for one in reference["hashes"]
    ]
    assert sorted(hashes) == sorted(re.findall(r"--hash=sha256:([0-9a-f]{64})", LOCK))


def test_what_lies_vendored_stands_in_it_by_the_digest_of_its_bytes(made: dict[str, Any]) -> None:
    files = {one["bom-ref"]: one for one in made["components"] if one["type"] == "file"}
    lying = {
        f"vendored/{file.relative_to(ROOT / 'static' / 'vendor')}": hashlib.sha256(file.read_bytes()).hexdigest()
        for file in (ROOT / "static" / "vendor").glob("*/*")
        if file.name not in ("LICENSE", "VERSION", "SHA256SUMS")
    }
    assert {ref: one["hashes"][0]["content"] for ref, one in files.items()} == lying
    assert all(one["licenses"] for one in files.values())


def test_the_same_lock_gives_the_same_bytes_and_no_address_of_an_index(tmp_path: Path) -> None:
    bodies = []
    for name in ("one", "two"):
        assert written("--to", str(tmp_path / name)).returncode == 0
        bodies.append((tmp_path / name).read_text(encoding="utf-8"))
    assert bodies[0] == bodies[1]
    assert set(re.findall(r"https?://[^/\"]+", bodies[0])) == {"http://cyclonedx.org"}


def test_everything_that_is_needed_is_a_component_and_everything_is_needed(made: dict[str, Any]) -> None:
    own = made["metadata"]["component"]["bom-ref"]
    refs = {own, *(one["bom-ref"] for one in made["components"])}
    needs = {one["ref"]: set(one["dependsOn"]) for one in made["dependencies"]}
    wanted = set().union(*needs.values())
    assert wanted == refs - {own}
    direct = {re.split(r"[\[>=<]", one)[0] for one in PROJECT["dependencies"]}
    assert {packages(made)[ref]["name"] for ref in needs[own] if ref.startswith("pkg:")} == direct


def test_licences_are_those_that_this_very_version_states(made: dict[str, Any]) -> None:
    stated = {one["name"]: one["licenses"] for one in made["components"] if "licenses" in one}
    assert stated["fastapi"] == [{"expression": metadata.metadata("fastapi")["License-Expression"]}]
    assert stated["authlib"] == [{"license": {"name": metadata.metadata("authlib")["License"]}}]
    assert stated["jinja2"] == [{"license": {"name": "BSD License"}}]
    assert stated["trimesh"] == [{"license": {"name": "MIT License"}}], "a whole text is no name"
    assert licence_of("fastapi", "0.0.1") == [], "another version may have another licence"
    assert licence_of("nobody-installed-this", "1") == []


def test_a_lock_says_who_needs_whom_and_for_which_machines() -> None:
    found = bill({**PROJECT, "name": "regenharness"}, pins(SMALL), (), lambda name, version: [])
    alpha, beta = found["components"]
    assert (alpha["scope"], beta["scope"]) == ("required", "optional")
    assert beta["properties"] == [{"name": "regenharness:environment-marker", "value": "sys_platform == 'win32'"}]
    assert found["dependencies"] == [
        {"ref": "pkg:pypi/alpha@1.0", "dependsOn": ["pkg:pypi/beta-core@2.0"]},
        {"ref": "pkg:pypi/beta-core@2.0", "dependsOn": []},
        {
            "ref": f"pkg:pypi/regenharness@{PROJECT['version']}",
            "dependsOn": ["pkg:pypi/alpha@1.0", "pkg:pypi/beta-core@2.0"],
        },
    ]
    other = bill(PROJECT, pins(SMALL.replace("a" * 64, "d" * 64)), (), lambda name, version: [])
    assert other["serialNumber"] != found["serialNumber"]


@pytest.mark.parametrize(
    ("lock", "said"),
    [
        ("alpha==1.0\n    # via regenharness (pyproject.toml)\n", "no hash for alpha"),
        ("alpha>=1.0 \\\n", "line 1"),
        ("", "no hash for anything"),
        ("-e ./somewhere\n", "line 1"),
    ],
)
def test_what_is_no_lock_with_hashes_gives_no_bill(lock: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "lock").write_text(lock, encoding="utf-8")
    answer = written("--lock", str(tmp_path / "lock"), "--to", str(tmp_path / "bill.json"))
    assert answer.returncode == 1
    assert said in answer.stderr
    assert not (tmp_path / "bill.json").exists()


def test_a_folder_of_third_parties_files_has_a_version(tmp_path: Path) -> None:
    (tmp_path / "nameless").mkdir()
    (tmp_path / "nameless" / "SHA256SUMS").write_text("", encoding="utf-8")
    with pytest.raises(ValueError, match="nameless is no NAME-VERSION"):
        tuple(vendored(tmp_path))
