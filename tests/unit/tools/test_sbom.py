"""The bill of materials says what the lock says: every package, its version and hashes, who needs it, its licence."""

import hashlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tools.sbom import OWN, ROOT, bill, generated, invalid, locked, vendored

LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


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


def component(pin: str, *, number: int = 1) -> dict[str, Any]:
    """A package as cyclonedx-py gives a line of a lock."""
    name, _, rest = pin.partition("==")
    version = rest.partition(" ")[0]
    return {
        "bom-ref": f"requirements-L{number}",
        "description": f"requirements line {number}: {pin}     --hash=sha256:{'a' * 64}",
        "externalReferences": [
            {
                "type": "distribution",
                "url": f"https://pypi.org/simple/{name}/",
                "comment": "implicit dist url",
                "hashes": [{"alg": "SHA-256", "content": "a" * 64}],
            }
        ],
        "name": name,
        "purl": f"pkg:pypi/{name}@{version}",
        "type": "library",
        "version": version,
    }


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


def test_the_same_lock_gives_the_same_bytes_and_no_address_of_an_index(made: dict[str, Any], tmp_path: Path) -> None:
    assert written("--to", str(tmp_path / "again")).returncode == 0
    body = (tmp_path / "again").read_text(encoding="utf-8")
    assert body == json.dumps(made, indent=2, ensure_ascii=False, sort_keys=True) + "\n"
    assert "/simple/" not in body and "timestamp" not in body


def test_it_is_valid_and_a_bill_that_is_not_is_found(made: dict[str, Any]) -> None:
    assert invalid(json.dumps(made)) == ""
    assert "licence" in invalid(json.dumps({**made, "licence": "free"}))


def test_everything_that_is_needed_is_a_component_and_everything_is_needed(made: dict[str, Any]) -> None:
    refs = {one["bom-ref"] for one in made["components"]}
    elsewhere = {one["bom-ref"] for one in made["components"] if one.get("scope") == "optional"}
    needs = {one["ref"]: set(one["dependsOn"]) for one in made["dependencies"]}
    wanted = set().union(*needs.values())
    assert wanted <= refs and refs - wanted <= elsewhere, "what is for other machines is installed on none of ours"
    direct = {re.split(r"[\[>=<]", one)[0] for one in PROJECT["dependencies"]}
    assert {packages(made)[ref]["name"] for ref in needs[OWN] if ref.startswith("pkg:")} == direct


def test_licences_are_those_that_the_packages_state(made: dict[str, Any]) -> None:
    stated = {one["name"]: one["licenses"] for one in made["components"] if "licenses" in one}
    assert stated["fastapi"] == [{"license": {"acknowledgement": "declared", "id": "MIT"}}]
    assert all(one["licenses"] for one in made["components"] if one["name"] in ("jinja2", "authlib", "trimesh"))


def test_another_version_that_is_installed_says_nothing_of_the_one_that_is_locked() -> None:
    lock = {"components": [component("alpha==1.0"), component("beta==2.0 ; sys_platform == 'win32'", number=2)]}
    one = {"bom-ref": "alpha==1.0", "purl": "pkg:pypi/alpha@1.0", "licenses": [{"license": {"id": "MIT"}}]}
    other = {"bom-ref": "beta==3.0", "purl": "pkg:pypi/beta@3.0", "licenses": [{"license": {"id": "MIT"}}]}
    needs = [{"ref": OWN, "dependsOn": ["alpha==1.0"]}, {"ref": "alpha==1.0", "dependsOn": ["beta==3.0"]}]
    found = bill(lock, {"components": [one, other], "dependencies": needs}, ())
    alpha, beta = found["components"]
    assert (alpha["scope"], beta["scope"]) == ("required", "optional")
    assert beta["properties"] == [{"name": "regenharness:environment-marker", "value": 'sys_platform == "win32"'}]
    assert "licenses" in alpha and "licenses" not in beta
    assert found["dependencies"] == [
        {"ref": "pkg:pypi/alpha@1.0", "dependsOn": []},
        {"ref": "pkg:pypi/beta@2.0", "dependsOn": []},
        {"ref": OWN, "dependsOn": ["pkg:pypi/alpha@1.0"]},
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("alpha==1.0\n    # via regenharness (pyproject.toml)\n", "no hash for alpha"),
        ("", "no hash for anything"),
    ],
)
def test_what_is_no_lock_with_hashes_gives_no_bill(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "lock").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=said):
        locked(generated("requirements", str(tmp_path / "lock")))


def test_a_lock_that_is_not_there_gives_no_bill(tmp_path: Path) -> None:
    answer = written("--lock", str(tmp_path / "lock"), "--to", str(tmp_path / "bill.json"))
    assert answer.returncode == 1
    assert "No bill of materials" in answer.stderr
    assert not (tmp_path / "bill.json").exists()


def test_a_folder_of_third_parties_files_has_a_version(tmp_path: Path) -> None:
    (tmp_path / "nameless").mkdir()
    (tmp_path / "nameless" / "SHA256SUMS").write_text("", encoding="utf-8")
    with pytest.raises(ValueError, match="nameless is no NAME-VERSION"):
        tuple(vendored(tmp_path))
