"""H_0 and the site as they ship: reads this package's own data, and any YAML text, into contract values."""

from collections.abc import Hashable
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import yaml

from harness.contracts.configuration import Configuration, ContextRules, RecoveryPolicy, RoutingPreferences
from harness.contracts.errors import ContractInvalid
from harness.contracts.places import Site
from harness.contracts.reasons import because
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Value, decode
from harness.goals.names import check_names
from harness.goals.sources import world_sources
from harness.recovery.policy import check_policy
from harness.supervisor.zones import check_site

T = TypeVar("T")
LONGEST_TEXT = 262_144
DEEPEST = 24
_PACKAGE = "harness.baseline"


class _Sections(Value):
    """configuration.yaml: three of the four sections; the fourth, the templates, has a file each."""

    context_rules: ContextRules
    routing: RoutingPreferences
    recovery: RecoveryPolicy


@lru_cache(maxsize=1)
def baseline() -> Configuration:
    """H_0, with its templates in order of their names, read once.

    Raises ContractInvalid if the shipped files break a rule.
    """
    sections = read_yaml(_shipped("configuration.yaml"), _Sections, where="baseline/configuration.yaml")
    templates = _templates("templates")
    configuration = Configuration(
        context_rules=sections.context_rules,
        templates=templates,
        routing=sections.routing,
        recovery=sections.recovery,
    )
    check_policy(configuration.recovery)
    return configuration


@lru_cache(maxsize=1)
def earlier() -> tuple[Configuration, ...]:
    """H_0 as earlier releases shipped it, read once: their logs pin missions to it and hold no copy."""
    folder = files(_PACKAGE).joinpath("earlier")
    entries = sorted((one for one in folder.iterdir() if one.name.endswith(".json")), key=lambda one: one.name)
    return tuple(decode(entry.read_bytes(), Configuration) for entry in entries)


@lru_cache(maxsize=1)
def further() -> tuple[TaskTemplate, ...]:
    """Templates that ship beside H_0 and are no part of it, in order of their names, read once.

    A mission of one runs under its robot's current configuration as any other; no candidate changes them.
    """
    return _templates("further")


@lru_cache(maxsize=1)
def site() -> Site:
    """The simulated site's places, routes, passages and zones, read once. Raises as `check_site` does."""
    shipped = read_yaml(_shipped("site.yaml"), Site, where="baseline/site.yaml")
    check_site(shipped)
    return shipped


def site_from(file: Path | None) -> Site:
    """The site of a file of one's own, the simulated one without a file.

    Raises ContractInvalid for a file that cannot be read, breaks a rule as `check_site` says, has a name of two things,
    or vouches for a source that no predicate reads (D17).
    """
    if file is None:
        return site()
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeError) as error:
        raise ContractInvalid(because("site_unreadable", error=str(error)), where=str(file)) from error
    own = read_yaml(text, Site, where=str(file))
    check_site(own)
    check_names(own)
    known = world_sources()
    strange = [name for name in own.vouched if name not in known]
    if strange:
        raise ContractInvalid(
            because("vouched_unknown", name=strange[0], names=tuple(sorted(known))), where=f"{file}, vouched"
        )
    return own


def read_yaml(text: str, kind: type[T], *, where: str) -> T:
    """YAML of one contract value. Raises ContractInvalid that names the place in the file or in the value.

    Aliases, repeated keys, deep nesting and texts over 256 KiB are refused before anything is built from them: a file
    of a few lines can otherwise unfold to gigabytes.
    """
    if len(text) > LONGEST_TEXT:
        raise ContractInvalid(because("text_too_long", characters=len(text), limit=LONGEST_TEXT), where=where)
    try:
        _check_events(text, where)
        built = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ContractInvalid(because("yaml_invalid", error=_line(error)), where=where) from error
    except ValueError as error:
        raise ContractInvalid(because("value_unreadable", error=str(error)), where=where) from error
    try:
        return msgspec.convert(built, kind, strict=True)
    except msgspec.ValidationError as error:
        what, _, path = str(error).partition(" - at `")
        raise ContractInvalid(
            because("field_invalid", error=what), where=f"{where}, {path.rstrip('`') or '$'}"
        ) from error


class _Loader(yaml.CSafeLoader):
    """CSafeLoader that takes no key twice, no key that is a list or mapping, and no merged keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == "tag:yaml.org,2002:merge":
                raise yaml.constructor.ConstructorError(None, None, "a key must be a plain word", key.start_mark)
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key.value!r} stands twice", key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def _check_events(text: str, where: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        line = event.start_mark.line + 1 if event.start_mark else 0
        if isinstance(event, yaml.AliasEvent):
            raise ContractInvalid(because("yaml_alias", line=line), where=where)
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            raise ContractInvalid(because("yaml_too_deep", line=line, limit=DEEPEST), where=where)


def _line(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error)
    return f"{problem} (line {mark.line + 1})" if mark else str(problem)


def _templates(name: str) -> tuple[TaskTemplate, ...]:
    folder = files(_PACKAGE).joinpath(name)
    entries = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".yaml"))
    texts = ((entry, folder.joinpath(entry).read_text(encoding="utf-8")) for entry in entries)
    return tuple(read_yaml(text, TaskTemplate, where=f"baseline/{name}/{entry}") for entry, text in texts)


def _shipped(name: str) -> str:
    return files(_PACKAGE).joinpath(name).read_text(encoding="utf-8")
