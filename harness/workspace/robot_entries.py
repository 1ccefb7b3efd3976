"""Checks a robot's entry that somebody is about to save, as `regen check` does, and puts saved ones in force."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import msgspec
import yaml

from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.exploration import GridMap
from harness.contracts.ids import RobotId
from harness.contracts.places import Site
from harness.contracts.reasons import Reason, because
from harness.projections.places import as_changed
from harness.projections.site_changes import ChangedRobot
from harness.workspace import checks
from harness.workspace.contract_yaml import Lines, Step, read_yaml
from harness.workspace.files import RobotEntry, RobotsFile, SecretReference, SimulatedRobotEntry

SECRET_PREFIX, SECRET_FOLDER = "ROBOT_", "secrets"
"""Where a secret may stand that an entry from the console names: `ROBOT_...` of the environment, or a file in secrets/
of the site's folder. Otherwise whoever edits robots could have any secret of this machine sent to an address of theirs.
"""


class EntryLines(Lines):
    """Lines of one entry's own text, asked for by its place in robots.yaml."""

    def of(self, *path: Step) -> int:
        """`of("robots", 3, "token")` is the line of the entry's token, whatever its index."""
        return super().of(*path[2:])


def entry_of(text: str, *, where: str, foreign: bool = False) -> RobotEntry:
    """The entry that a YAML text says. Raises ContractInvalid. `foreign`: as for `read_yaml`."""
    kind: Any = RobotEntry
    entry: RobotEntry = read_yaml(text, kind, where=where, foreign=foreign)
    return entry


def read_robot(
    text: str, *, name: str, robots: Sequence[RobotEntry], site: Site, floor: GridMap | None
) -> tuple[RobotEntry | None, tuple[HarnessError, ...]]:
    """The entry, where it may stand beside the `robots` that there are; else everything that is wrong with its YAML.

    `name`: what it must be called; empty for a new one, whose YAML says that.
    """
    file = Path(f"{name or 'robot'}.yaml")
    lines = EntryLines(text)
    try:
        entry = entry_of(text, where=str(file), foreign=True)
    except HarnessError as error:
        return None, (error,)
    others = tuple(one for one in robots if one.name != entry.name)
    problems = (
        *_name_problems(entry, name, robots, file, lines),
        *checks.robot_problems(RobotsFile(robots=(*others, entry)), file, lines),
        *_secret_problems(entry, next((one for one in robots if one.name == entry.name), None), file, lines),
        *(checks.clearance_problems(site, RobotsFile(robots=(entry,)), file, lines, floor) if floor else ()),
    )
    return (None if problems else entry), problems


def with_changes(
    robots: Sequence[RobotEntry], changes: Mapping[str, ChangedRobot]
) -> tuple[tuple[RobotEntry, ...], dict[RobotId, Reason]]:
    """The robots of the file with the saved changes. A change that cannot be used any more, such as an entry with the
    address of one that was added to the file later, is left out with its reason.
    """
    refused: dict[RobotId, Reason] = {}
    for name, change in changes.items():
        try:
            entry = entry_of(change.text, where=name) if change.text else None
            changed = as_changed(robots, {name: entry}, lambda one: one.name)
            for problem in checks.robot_problems(RobotsFile(robots=changed), Path(name), Lines("")):
                raise problem
        except HarnessError as error:
            refused[RobotId(name)] = error.reason
            continue
        robots = changed
    return tuple(robots), refused


def entry_texts(text: str) -> dict[str, str]:
    """The YAML of each entry of a robots.yaml by its name, without its indentation; {} for a text that is none."""
    root = yaml.compose(text, Loader=yaml.CSafeLoader)
    found: dict[str, str] = {}
    for key, items in root.value if isinstance(root, yaml.MappingNode) else ():
        if key.value != "robots" or not isinstance(items, yaml.SequenceNode):
            continue
        for node in items.value:
            entry = yaml.safe_load(yaml.serialize(node))
            found[entry["name"]] = _sliced(text, node.start_mark, node.end_mark)
    return found


def text_of(entry: RobotEntry, change: ChangedRobot | None, texts: Mapping[str, str]) -> str:
    """A robot's YAML as somebody wrote it in the console, else in the file; written out where nobody did."""
    written = change.text if change is not None else texts.get(entry.name, "")
    if written:
        return written
    found: str = yaml.safe_dump(msgspec.to_builtins(entry), sort_keys=False, allow_unicode=True, width=110)
    return found


def _sliced(text: str, start: Any, end: Any) -> str:
    """What stands between two marks, with the first line's column as the margin."""
    lines = text[start.index : end.index].rstrip().splitlines()
    margin = " " * start.column
    return "\n".join(line.removeprefix(margin) for line in lines) + "\n"


def _name_problems(
    entry: RobotEntry, name: str, robots: Sequence[RobotEntry], file: Path, lines: Lines
) -> Iterator[HarnessError]:
    where = checks.at(file, lines.of("robots", 0, "name"))
    if name and entry.name != name:
        yield ContractInvalid(because("robot_renamed", name=name, found=entry.name), where=where)
    if not name and any(one.name == entry.name for one in robots):
        yield ContractInvalid(because("robot_name_taken", name=entry.name), where=where)


def _secret_problems(entry: RobotEntry, before: RobotEntry | None, file: Path, lines: Lines) -> Iterator[HarnessError]:
    """An entry may name what it names already, as long as the secret goes to the same address."""
    known = {(secret.place, address) for secret, address, _ in _references(before)}
    for secret, address, path in _references(entry):
        if not _may_be_named(secret) and (secret.place, address) not in known:
            allowed = because(
                "secret_out_of_reach", place=secret.place, prefix=SECRET_PREFIX, folder=f"{SECRET_FOLDER}/"
            )
            yield ContractInvalid(allowed, where=checks.at(file, lines.of("robots", 0, *path)))


def _references(entry: RobotEntry | None) -> Iterator[tuple[SecretReference, str, tuple[Step, ...]]]:
    """Each secret that the entry names, the address that it is sent to, and where it stands in the entry."""
    if entry is None or isinstance(entry, SimulatedRobotEntry):
        return
    evidence = entry.evidence.address if entry.evidence is not None else ""
    for secret, path in checks.robot_secrets(entry):
        yield secret, evidence if path[0] == "evidence" else entry.identity, path


def _may_be_named(secret: SecretReference) -> bool:
    if secret.environment:
        return secret.environment.startswith(SECRET_PREFIX)
    path = PurePosixPath(secret.file)
    return len(path.parts) > 1 and path.parts[0] == SECRET_FOLDER and ".." not in path.parts
