"""Reads and extends regression suites: versioned YAML, registered by digest, append-only (R158)."""

from importlib.resources import files
from importlib.resources.abc import Traversable
from itertools import pairwise

import msgspec
import yaml

from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.contracts.values import Value
from harness.workspace.contract_yaml import read_yaml
from rsi_reviews.regression.cases import CaseGroup, Suite, cases_of
from rsi_reviews.regression.errors import SuiteEdited, SuiteInvalid, SuiteShrunk

REGISTER = "register.yaml"


class RegisterEntry(Value):
    """One line of the register: a version of a suite and the digest it must have."""

    name: str
    version: int
    digest: Digest


class Register(Value):
    """register.yaml: every version that was ever current, oldest first."""

    versions: tuple[RegisterEntry, ...]


def shipped(name: str) -> Suite:
    """The newest shipped version of a suite. Raises SuiteInvalid, SuiteEdited or SuiteShrunk."""
    return newest(files("rsi_reviews").joinpath("suites"), name)


def newest(folder: Traversable, name: str) -> Suite:
    """The newest registered version in a folder, after every version was read, its digest checked and its
    growth confirmed.
    """
    register = read_yaml(folder.joinpath(REGISTER).read_text(encoding="utf-8"), Register, where=REGISTER)
    lines = sorted((one for one in register.versions if one.name == name), key=lambda one: one.version)
    if not lines:
        raise SuiteInvalid(because("suite_unregistered", name=name), where=REGISTER)
    if [one.version for one in lines] != list(range(1, len(lines) + 1)):
        raise SuiteInvalid(because("suite_versions_not_consecutive", name=name, count=len(lines)), where=REGISTER)
    suites = [_read(folder, line) for line in lines]
    for older, newer in pairwise(suites):
        check_grown(older, newer)
    return suites[-1]


def check_grown(older: Suite, newer: Suite) -> None:
    """Raise SuiteShrunk unless the newer suite holds every case of the older one and has the next version."""
    lost = set(cases_of(older)) - set(cases_of(newer))
    if lost or newer.name != older.name:
        raise SuiteShrunk(
            because(
                "suite_shrunk",
                name=newer.name,
                version=newer.version,
                lost=len(lost),
                older=older.name,
                before=older.version,
            ),
            where=file_name(newer),
        )
    if newer.version != older.version + 1:
        raise SuiteInvalid(
            because("suite_version_skipped", name=newer.name, version=newer.version, before=older.version),
            where=file_name(newer),
        )


def grown(suite: Suite, *additions: CaseGroup) -> Suite:
    """The next version: every existing case, and what a person adds (a disputed mission, a new fault)."""
    newer = msgspec.structs.replace(suite, version=suite.version + 1, groups=(*suite.groups, *additions))
    check_grown(suite, newer)
    return newer


def written(suite: Suite) -> str:
    """A suite as YAML that reads back to the same digest."""
    return yaml.safe_dump(msgspec.to_builtins(suite), sort_keys=False, allow_unicode=True, width=120)


def file_name(suite: Suite) -> str:
    """The file name of a suite's version in its folder."""
    return f"{suite.name}-{suite.version}.yaml"


def _read(folder: Traversable, line: RegisterEntry) -> Suite:
    name = f"{line.name}-{line.version}.yaml"
    suite = read_yaml(folder.joinpath(name).read_text(encoding="utf-8"), Suite, where=name)
    if (suite.name, suite.version) != (line.name, line.version):
        raise SuiteInvalid(because("suite_misnamed", name=suite.name, version=suite.version), where=name)
    if suite.suite_id != line.digest:
        raise SuiteEdited(
            because("suite_edited", digest=suite.suite_id[:12], registered=line.digest[:12]),
            where=name,
        )
    return suite
