"""`make sbom`: the software bill of materials, CycloneDX 1.6 JSON: what requirements.lock names and what lies vendored.

cyclonedx-py reads the lock (versions, hashes) and the environment (licences, who needs whom); here both are joined and
the vendored files added. The same lock and the same environment give the same bytes: no clock, no chance, no address of
an index.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "build" / "regenharness.cdx.json"
SUM = re.compile(r"^(?P<digest>[0-9a-f]{64})  (?P<file>\S+)$", re.MULTILINE)
VENDORED = re.compile(r"^(?P<name>.+)-(?P<version>[\d.]+)$")
PINNED = re.compile(r"^requirements line \d+: (?P<pin>.+?)\s+--hash=")
VENDOR_LICENCES = {"htmx": "0BSD", "dejavu": "Bitstream-Vera", "droid-fallback": "Apache-2.0"}
OWN = "root-component"
"""What cyclonedx-py calls the project itself."""
Component = dict[str, Any]


def generated(*arguments: str) -> dict[str, Any]:
    """What cyclonedx-py writes of the project, not yet validated. Raises ValueError with its output if it fails."""
    options = ("--pyproject", str(ROOT / "pyproject.toml"), "--output-reproducible", "--no-validate", "--sv", "1.6")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bill.json"
        command = [sys.executable, "-m", "cyclonedx_py", *arguments, *options, "--of", "JSON", "-o", str(file)]
        answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if answer.returncode or not file.is_file():
            raise ValueError(f"cyclonedx-py cannot read it: {answer.stderr.strip()[-500:]}")
        made: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        return made


def locked(lock: Mapping[str, Any]) -> tuple[Component, ...]:
    """The packages of a lock, each with its package URL as reference. Raises ValueError for one without any hash.

    A lock names every file a package may be, so the hashes belong to the distribution; the index that cyclonedx-py
    assumes is left out. What is for some machines only is optional and says for which.
    """
    bare = [one["name"] for one in lock.get("components", ()) if not _pin(one)]
    if bare or not lock.get("components"):
        raise ValueError(f"the lock has no hash for {', '.join(bare) or 'anything'}; make it anew with `make lock`")
    return tuple(_package(one) for one in lock["components"])


def _pin(component: Component) -> str:
    """The line of the lock without its hashes; empty if it has no hash."""
    found = PINNED.match(component["description"])
    return found["pin"] if found else ""


def _package(component: Component) -> Component:
    [distribution] = [one for one in component["externalReferences"] if one["type"] == "distribution"]
    marker = Requirement(_pin(component)).marker
    made = {name: component[name] for name in ("type", "name", "version", "purl")} | {
        "bom-ref": component["purl"],
        "scope": "optional" if marker else "required",
        "externalReferences": [
            {**distribution, "url": component["purl"], "comment": "one of these files is installed"},
        ],
    }
    if marker:
        made["properties"] = [{"name": "regenharness:environment-marker", "value": str(marker)}]
    return made


def vendored(folder: Path) -> Iterator[Component]:
    """Third-party files that ship beside the packages, one component per file that its SHA256SUMS names."""
    for sums in sorted(folder.glob("*/SHA256SUMS")):
        found = VENDORED.match(sums.parent.name)
        if found is None:
            raise ValueError(f"{sums.parent.name} is no NAME-VERSION")
        for one in SUM.finditer(sums.read_text(encoding="utf-8")):
            if one["file"] != "LICENSE":
                yield {
                    "type": "file",
                    "bom-ref": f"vendored/{sums.parent.name}/{one['file']}",
                    "name": f"{found['name']}/{one['file']}",
                    "version": found["version"],
                    "hashes": [{"alg": "SHA-256", "content": one["digest"]}],
                    "licenses": [{"license": {"id": VENDOR_LICENCES[found["name"]]}}],
                }


def bill(lock: Mapping[str, Any], installed: Mapping[str, Any], files: tuple[Component, ...]) -> dict[str, Any]:
    """The whole document. Licences and needs are those of the very versions that the lock names, where installed."""
    packages = locked(lock)
    names = {one["purl"] for one in packages}
    same = {_normal(one): one for one in names}
    found = {one["bom-ref"]: same.get(_normal(one.get("purl", ""))) for one in installed.get("components", ())}
    refs = {ref: purl for ref, purl in found.items() if purl}
    licences = {refs[one["bom-ref"]]: one.get("licenses") for one in installed["components"] if one["bom-ref"] in refs}
    needs: dict[str, set[str]] = {ref: set() for ref in (OWN, *sorted(names), *(one["bom-ref"] for one in files))}
    for one in installed.get("dependencies", ()):
        if one["ref"] == OWN or one["ref"] in refs:
            needed = {refs[ref] for ref in one.get("dependsOn", ()) if ref in refs}
            needs[refs.get(one["ref"], OWN)] |= needed
    needs[OWN] |= {one["bom-ref"] for one in files}
    components = [
        one | ({"licenses": licence_names} if (licence_names := licences.get(one["purl"])) else {}) for one in packages
    ]
    return {
        **lock,
        "components": [*components, *files],
        "dependencies": [{"ref": ref, "dependsOn": sorted(needed)} for ref, needed in sorted(needs.items())],
    }


def _normal(purl: str) -> str:
    """A package URL in comparable form: PyPI treats runs of hyphens, dots and underscores in a name as one hyphen."""
    name, _, version = purl.partition("@")
    return f"{re.sub('[-_.]+', '-', name).lower()}@{version}"


def invalid(document: str) -> str:
    """The errors of a document under the CycloneDX schema; empty if there are none."""
    found = JsonStrictValidator(SchemaVersion.V1_6).validate_str(document)
    return str(found) if found else ""


def main() -> None:
    """Write the bill of requirements.lock; report its path and the packages that name no licence."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lock", type=Path, default=ROOT / "requirements.lock")
    parser.add_argument("--to", type=Path, default=TARGET)
    options = parser.parse_args()
    try:
        lock, installed = generated("requirements", str(options.lock)), generated("environment", sys.executable)
        made = bill(lock, installed, tuple(vendored(ROOT / "static" / "vendor")))
        document = json.dumps(made, indent=2, ensure_ascii=False, sort_keys=True) + "\n"
        if wrong := invalid(document):
            raise ValueError(wrong)
    except (OSError, ValueError) as error:
        raise SystemExit(f"No bill of materials: {error}") from error
    options.to.parent.mkdir(parents=True, exist_ok=True)
    options.to.write_text(document, encoding="utf-8")
    silent = [one["name"] for one in made["components"] if "licenses" not in one]
    print(f"{options.to}: {len(made['components'])} components, most of them from {options.lock.name}")
    if silent:
        print(f"No licence is known of: {', '.join(silent)} (not installed here, or silent about it)", file=sys.stderr)


if __name__ == "__main__":
    main()
