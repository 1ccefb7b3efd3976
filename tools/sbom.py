"""`make sbom`: the software bill of materials, CycloneDX 1.6 JSON: what requirements.lock names and what lies vendored.

Versions, hashes and who needs whom come from the lock; licences from the metadata of the installed packages. The same
lock and the same environment give the same bytes: no clock, no chance, no address of an index.
"""

import argparse
import json
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import quote
from uuid import NAMESPACE_URL, uuid5

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "build" / "regenharness.cdx.json"
PIN = re.compile(r"^(?P<name>[A-Za-z0-9][\w.-]*)==(?P<version>[^\s;\\]+)(?: *; *(?P<marker>[^\\]+?))? *\\?$")
HASH = re.compile(r"^ +--hash=sha256:(?P<digest>[0-9a-f]{64}) *\\?$")
WANTED_BY = re.compile(r"^ +# +(?:via +)?(?P<name>[A-Za-z0-9][\w.-]*)(?:\[[^]]*\])?(?: \(.*\))?$")
SUM = re.compile(r"^(?P<digest>[0-9a-f]{64})  (?P<file>\S+)$", re.MULTILINE)
VENDORED = re.compile(r"^(?P<name>.+)-(?P<version>[\d.]+)$")
FREE_TEXT = 64
"""A licence field longer than this is the licence's whole text, not its name."""
OSI = re.compile(r"^License :: (?:OSI Approved :: )?(?P<name>.+)$")
VENDOR_LICENCES = {"htmx": "0BSD", "dejavu": "Bitstream-Vera", "droid-fallback": "Apache-2.0"}
Component = dict[str, Any]


@dataclass(frozen=True)
class Pinned:
    """One line of the lock: a package, the files it may be, for which machines, and who wants it."""

    name: str
    version: str
    marker: str
    hashes: tuple[str, ...]
    wanted_by: tuple[str, ...]

    @property
    def purl(self) -> str:
        return f"pkg:pypi/{re.sub(r'[-_.]+', '-', self.name).lower()}@{quote(self.version)}"


def pins(lock: str) -> tuple[Pinned, ...]:
    """What a lock with hashes names, in its order. Raises ValueError for a line that is none of a lock's."""
    found: list[Pinned] = []
    for number, line in enumerate(lock.splitlines(), start=1):
        if pin := PIN.match(line):
            found.append(Pinned(pin["name"], pin["version"], (pin["marker"] or "").strip(), (), ()))
        elif (one := HASH.match(line)) and found:
            found[-1] = replace(found[-1], hashes=(*found[-1].hashes, one["digest"]))
        elif line.strip() in ("", "# via"):
            continue
        elif (one := WANTED_BY.match(line)) and found:
            found[-1] = replace(found[-1], wanted_by=(*found[-1].wanted_by, one["name"]))
        else:
            raise ValueError(f"line {number} of the lock is none that `make lock` writes: {line[:80]!r}")
    bare = [one.name for one in found if not one.hashes]
    if bare or not found:
        raise ValueError(f"the lock has no hash for {', '.join(bare) or 'anything'}; make it anew with `make lock`")
    return tuple(found)


def licence_of(name: str, version: str) -> list[dict[str, Any]]:
    """What this very version says of its own licence, as CycloneDX writes it; empty if it is not here or silent."""
    try:
        told = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return []
    if told.version != version:
        return []
    fields = told.metadata.json
    if expression := fields.get("license_expression"):
        return [{"expression": expression}]
    named = str(fields.get("license", "")).strip()
    if named and len(named) <= FREE_TEXT and "\n" not in named:
        return [{"license": {"name": named}}]
    classified = (OSI.match(one) for one in fields.get("classifier", ()))
    return [{"license": {"name": one["name"]}} for one in classified if one]


def component(pinned: Pinned, licences: list[dict[str, Any]]) -> Component:
    """One package. A lock names every file a package may be, so its hashes stand with the distribution, not with it."""
    made: Component = {
        "type": "library",
        "bom-ref": pinned.purl,
        "name": pinned.name,
        "version": pinned.version,
        "purl": pinned.purl,
        "scope": "optional" if pinned.marker else "required",
        "externalReferences": [
            {
                "type": "distribution",
                "url": pinned.purl,
                "comment": "one of these files is installed",
                "hashes": [{"alg": "SHA-256", "content": one} for one in pinned.hashes],
            }
        ],
    }
    if licences:
        made["licenses"] = licences
    if pinned.marker:
        made["properties"] = [{"name": "regenharness:environment-marker", "value": pinned.marker}]
    return made


def vendored(folder: Path) -> Iterator[Component]:
    """Third parties' files that ship beside the packages, one component per file that its SHA256SUMS names."""
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


def bill(
    project: Mapping[str, Any],
    packages: tuple[Pinned, ...],
    files: tuple[Component, ...],
    licences: Callable[[str, str], list[dict[str, Any]]],
) -> dict[str, Any]:
    """The whole document; its serial number follows from what it says."""
    own: Component = {
        "type": "application",
        "bom-ref": f"pkg:pypi/{project['name']}@{project['version']}",
        "name": project["name"],
        "version": project["version"],
        "description": project["description"],
        "licenses": [{"license": {"id": project["license"]}}],
    }
    body: dict[str, Any] = {
        "metadata": {"component": own, "tools": {"components": [{"type": "application", "name": "tools/sbom.py"}]}},
        "components": [*(component(one, licences(one.name, one.version)) for one in packages), *files],
        "dependencies": _needs(own, packages, files),
    }
    serial = uuid5(NAMESPACE_URL, json.dumps(body, sort_keys=True))
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{serial}",
        "version": 1,
        **body,
    }


def _needs(own: Component, packages: tuple[Pinned, ...], files: tuple[Component, ...]) -> list[dict[str, Any]]:
    """Who needs whom: the lock says it the other way round."""
    refs: dict[str, set[str]] = {own["name"]: {own["bom-ref"]}}
    for one in packages:
        refs.setdefault(one.name, set()).add(one.purl)
    wants: dict[str, set[str]] = {ref: set() for these in refs.values() for ref in these}
    wants[own["bom-ref"]].update(one["bom-ref"] for one in files)
    for one in packages:
        for name in one.wanted_by:
            for ref in refs[name]:
                wants[ref].add(one.purl)
    return [{"ref": ref, "dependsOn": sorted(wanted)} for ref, wanted in sorted(wants.items())]


def main() -> None:
    """Write the bill of requirements.lock; say where it lies and which packages name no licence."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--lock", type=Path, default=ROOT / "requirements.lock")
    asked.add_argument("--to", type=Path, default=TARGET)
    options = asked.parse_args()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    try:
        packages = pins(options.lock.read_text(encoding="utf-8"))
        made = bill(project, packages, tuple(vendored(ROOT / "static" / "vendor")), licence_of)
    except (OSError, ValueError) as error:
        raise SystemExit(f"No bill of materials: {error}") from error
    options.to.parent.mkdir(parents=True, exist_ok=True)
    options.to.write_text(json.dumps(made, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    silent = [one["name"] for one in made["components"] if "licenses" not in one]
    print(f"{options.to}: {len(made['components'])} components, {len(packages)} of them from {options.lock.name}")
    if silent:
        print(f"No licence is known of: {', '.join(silent)} (not installed here, or silent about it)", file=sys.stderr)


if __name__ == "__main__":
    main()
